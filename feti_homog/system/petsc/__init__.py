"""PETSc's options and their faults, its libraries, errors of its callbacks, C functions that petsc4py lacks.

Imports `system.parallel` and `system.runtime`.  Main entry: `options.case_options`.
"""
