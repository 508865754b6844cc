"""Many ranks: errors that reach all of them, scatter and gather of Python objects, arrays spread over ranks.

May use `runtime` and `errors`.  Main entries: `mpi_errors.run_main` and `mpi_errors.agree`.
"""
