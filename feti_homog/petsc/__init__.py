"""PETSc's options and their faults, its libraries, errors of its callbacks, C functions that petsc4py lacks.

May use `parallel`, `runtime` and `errors`.  Main entry: `options.case_options`.
"""
