"""Results in words: the printed summary and its tables.

May use `results`.  Main entry: `summary.summary`.
"""
