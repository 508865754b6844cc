"""The process and its libraries: `runtime` for one rank, `parallel` for all ranks, `petsc` for PETSc.

Main entries: the three packages; `parallel` imports `runtime`, `petsc` imports both.
"""
