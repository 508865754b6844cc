"""Tables, statistics over realisations and pictures of a sweep.

Imports `case`, `materials`, `report`, `results`, `schema` and `system`.  Main entries: `sweep_table.SweepTable`,
`tables.write` and `figures.plot`.
"""
