"""PETSc's options and their faults, its libraries, errors of its callbacks, C functions that petsc4py lacks.

Imports `parallel` and `runtime`.  Main entry: `options.case_options`.
"""
