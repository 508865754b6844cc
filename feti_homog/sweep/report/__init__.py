"""Tables, statistics over realisations and pictures of a sweep.

Imports `case`, `materials`, `microstructure`, `report`, `results`, `runtime` and `schema`.  Main entries:
`sweep_table.SweepTable`, `tables.write` and `figures.plot`.
"""
