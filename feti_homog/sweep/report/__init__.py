"""What the cases of a sweep come to: tables, statistics over realisations, pictures.

May use `output` and the floors below it.  Main entries: `statistics.Collected`, `tables.write` and `figures.plot`.
"""
