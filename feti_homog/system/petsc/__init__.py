"""PETSc's options and their faults, its libraries, errors of its callbacks, C functions that petsc4py lacks.

Imports `system.parallel` and `system.runtime`.  Main entry: `options_database.case_options`.
"""

__all__ = ["c_functions", "libraries", "option_table", "option_values", "options_database"]
