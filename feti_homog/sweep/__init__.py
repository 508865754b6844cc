"""Many cases from one file: expanded, run here or in a job array, collected into one table.

May use every floor but `cli`.  Main entries: `plan.load`, `execute.run_all` and `collect.collect`.
"""
