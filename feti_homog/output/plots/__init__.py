"""Pictures, drawn from the files of a result folder; loads Matplotlib.

May use `output.files` and `output.text`.  Main entry: `figures.plot`.
"""
