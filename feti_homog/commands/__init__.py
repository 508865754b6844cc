"""Parse the arguments of `feti-homog` and run its commands: one module for each subject, imported when needed.

Imports `analysis`, `api`, `case`, `mesh`, `microstructure`, `report`, `results`, `studies`, `system` and `verify`.
`--help` and `--version` need neither NumPy nor MPI.  Main entries: `parser`, `run`, `products`, `studies`, `verify`.
"""

__all__ = ["parser", "verify"]
