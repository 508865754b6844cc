"""Homogenize fibre composites by FETI; see the README.  The import of this package starts neither MPI nor PETSc.

In your own program, under `mpirun` or not:

    from feti_homog import Case, run
    case = Case.load("case.toml")
    result = run(case)                              # the same on every rank; no files, no output
    print(result)                                   # a short summary; in a notebook, tables
    result.effective_stiffness, result.E1           # arrays and numbers; see `Result`
    run(case.replace({"material.fibre.young": 80.0}))           # other values by dotted key, checked again
    run(case, out="results", fields=True).fields    # with files, and with mesh and states in memory

- `Case`: a checked case, from a file (`Case.load`) or a document with the same sections (`Case.parse`).
- `run`: a case's `Result`.  `run_sweep`, `collect_sweep`: results of many cases, and their table.
- `run_fit`: constants of cases from measured values.
- `draw_state`: draw the deformed cell in a state into Matplotlib's axes.  `read_state`: fields of a state as arrays.
- `launch`: run a program with its own and PETSc's options; errors end it as on the command line.
- `CaseError`, `MeshError`, `ConvergenceError`, all of them `FetiHomogError`: raised on all ranks; `faults`: lines.
"""

import importlib
import os
from typing import TYPE_CHECKING, Any

# Debian's h5py takes its MPI build only if this variable is set before the first import.
os.environ.setdefault("H5PY_ALWAYS_USE_MPI", "1")

from feti_homog.errors import CaseError, ConvergenceError, FetiHomogError, MeshError

__version__ = "1.0.0"

if TYPE_CHECKING:
    from feti_homog.analysis.result import Result
    from feti_homog.api import collect_sweep, launch, run, run_fit, run_sweep
    from feti_homog.case.cases import Case
    from feti_homog.report.plots.deformed_panels import draw_state
    from feti_homog.results.viewed_states import read_state

__all__ = [
    "Case", "CaseError", "ConvergenceError", "FetiHomogError", "MeshError", "Result", "__version__", "collect_sweep",
    "draw_state", "launch", "read_state", "run", "run_fit", "run_sweep",
]  # fmt: skip
HOMES = {
    "Case": "case.cases",
    "Result": "analysis.result",
    "draw_state": "report.plots.deformed_panels",
    "read_state": "results.viewed_states",
}
"""Modules of public names that are imported on first access; names without an entry are in `api`."""


def __dir__() -> list[str]:
    return [*__all__]


def __getattr__(name: str) -> Any:
    """Import a public name on first access, so that start-up is fast.  Raises AttributeError for other names."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{HOMES.get(name, 'api')}"), name)
