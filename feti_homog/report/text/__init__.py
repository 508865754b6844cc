"""Write results as text: the printed summary, and the tables that it shares with report.html and notebooks.

Imports `case`, `materials`, `microstructure` and `results`.  Main entries: `summary.summary`, `tables.Table`.
"""

__all__ = ["constant_tables", "point_tables", "study_tables", "summary", "tables"]
