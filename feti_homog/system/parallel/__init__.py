"""Work on many ranks: exceptions that reach all ranks, distributed arrays, division of loads.

Imports `system.runtime`.  Main entries: `mpi_errors.run_main` and `mpi_errors.agree`.
"""

__all__ = ["distributed_arrays", "mpi_errors"]
