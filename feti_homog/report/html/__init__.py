"""report.html: one page of a result with its numbers, pictures, curves and deformed states, readable without a network.

May use `results`, `report.text` and `report.plots`; loads Bokeh.  Main entry: `page.write`.
"""
