"""Commands of `feti-homog`: the parser of their arguments, and a module for each subject, loaded when it is called.

Imports `analysis`, `api`, `case`, `mesh`, `microstructure`, `report`, `results`, `studies`, `system` and `verify`.
`--help` and `--version` start without NumPy and MPI.  Main entries: `parser.command_parser`, `run`, `products`,
`studies` and `verify`.
"""

__all__ = ["parser", "verify"]
