"""Run many cases from one file: sweeps, fits of constants to measured values, scatter from uncertain inputs.

Imports `analysis`, `case`, `homogenization`, `materials`, `microstructure`, `report`, `results`, `schema` and `system`.
Main entries: `sweep_cases.load`, `case_runs.run_all`, `collect.collect`, `fit_file.load`,
`uncertainty.load` and `study.Study`.
"""

__all__ = [
    "case_folders", "case_runs", "collect", "fit_file", "outputs", "sweep_cases", "sweep_table", "uncertainty",
]  # fmt: skip
