"""report.html: one page of a result with its numbers, pictures, curves and deformed states, readable without a network.

Imports `materials`, `report.plots`, `report.text` and `results`.  Loads Bokeh.  Main entry: `page.write`.
"""
