"""Results as text: the printed summary, and the tables that it shares with report.html and notebooks.

Imports `case`, `materials`, `microstructure` and `results`.  Main entries: `summary.summary`, `table.Table`.
"""
