"""Many cases from one file: sweeps, fits of constants, and the scatter that uncertain inputs cause.

Main entries: `sweep.plan.load`, `fit.execute.run` and `uncertainty.scatter`.
"""
