"""The process and its libraries: `runtime` for one rank, `parallel` for many, `petsc` for PETSc.

Main entries: its own floors, from below `runtime`, `parallel` and `petsc`.
"""
