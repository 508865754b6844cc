"""What every floor needs of MPI, PETSc and the process: errors on many ranks, options, memory, progress.

May use `errors` alone.  Main entries: `mpi_errors.run_main` and `mpi_errors.agree`, `petsc_options.case_options`.
"""
