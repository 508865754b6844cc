"""Results in words: the printed summary and its tables.

Uses `mechanics`.  Main entry: `summary.summary`.
"""
