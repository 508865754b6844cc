"""Small sweeps for the tests."""

import csv
from pathlib import Path

from support.base_case import BASE

QUIET = '[output]\nfields = false\npictures = false\nstress_unit = "GPa"\n'
CASE = BASE.replace("mesh_size = 0.05", "mesh_size = 0.3") + QUIET
BY_BODIES = '[decomposition]\ncut = "bodies"\n'  # with multipliers, so that a solve may fail
RANDOM_CELL = 'geometry = "random"\nfibres = 3\nfibre_fraction = 0.4\nmesh_size = 0.3'
RANDOM = CASE.replace('geometry = "hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.3', RANDOM_CELL)

# Of the second point no arrangement can be made.
FAILING = RANDOM.replace("fibres = 3", "fibres = 12\nmin_gap = 0.1")
FAILING_POINTS = "cell.fibre_fraction = [0.2, 0.745, 0.25]\n"


def sweep_file(folder: Path, table: str, case: str = CASE, name: str = "sweep") -> Path:
    """Return a case file with these lines under [sweep]."""
    path = folder / f"{name}.toml"
    path.write_text(f"{case}[sweep]\n{table}" if table else case)
    return path


def rows(folder: Path) -> list[dict[str, str]]:
    """cases.csv, without times and memory."""
    with (folder / "cases.csv").open(encoding="utf-8") as stream:
        found = list(csv.DictReader(stream))
    return [{k: v for k, v in row.items() if not k.startswith(("seconds", "memory"))} for row in found]


def means(folder: Path, output: str) -> list[float]:
    """Means of an output over the realisations of each point, by statistics.csv."""
    with (folder / "statistics.csv").open(encoding="utf-8") as stream:
        return [float(row["mean"]) for row in csv.DictReader(stream) if row["output"] == output]
