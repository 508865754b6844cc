"""Pictures, drawn from the files of a result folder; loads Matplotlib.

May use `results` and `report.text`.  Main entry: `figures.plot`.
"""
