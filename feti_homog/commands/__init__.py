"""Commands of `feti-homog`, a module for each subject: `add(actions)` gives the parser options and actions.

Imports `analysis`, `api`, `case`, `mesh`, `microstructure`, `report`, `results`, `studies`, `system` and `verify`.
Modules import the computation inside their action, so that `--help` and `--version` start without NumPy and MPI.  Main
entries: `run`, `products` and `studies`.
"""

__all__ = ["products", "run", "studies"]
