"""Commands of `feti-homog`: the parser of the arguments, and a module for each subject, imported when needed.

Imports `analysis`, `api`, `case`, `mesh`, `microstructure`, `report`, `results`, `studies`, `system` and `verify`.
`--help` and `--version` start without NumPy and MPI.  Main entries: `parser`, `run`, `products`, `studies`, `verify`.
"""

__all__ = ["parser", "verify"]
