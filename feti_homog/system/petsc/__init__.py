"""Check PETSc's options, start its libraries, keep exceptions of callbacks, and call C functions without a binding.

Imports `system.parallel` and `system.runtime`.  Main entry: `options_database.case_options`.
"""

__all__ = ["c_functions", "libraries", "option_table", "option_values", "options_database"]
