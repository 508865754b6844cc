"""Results in words: the printed summary and its tables.

Uses no other floor.  Main entry: `summary.summary`.
"""
