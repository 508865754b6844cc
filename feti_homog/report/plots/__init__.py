"""Draw pictures from the files of a result folder.

Imports `case`, `materials`, `report.text` and `results`. Loads Matplotlib.  Main entry: `figures.plot`.
"""

__all__ = ["figures", "plot_helpers"]
