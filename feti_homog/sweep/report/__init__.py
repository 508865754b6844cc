"""What the cases of a sweep come to: tables, statistics over realisations, pictures.

May use `report` and the floors below it.  Main entries: `sweep_table.SweepTable`, `tables.write` and `figures.plot`.
"""
