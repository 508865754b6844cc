"""Many ranks: errors that reach all of them, objects and arrays of all of them, work divided among them.

Imports `system.runtime`.  Main entries: `mpi_errors.run_main` and `mpi_errors.agree`.
"""

__all__ = ["distributed_arrays", "dividing", "mpi_errors"]
