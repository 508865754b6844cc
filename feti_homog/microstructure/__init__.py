"""Fibres in a cross-section: outlines, tables, arrangements on the torus, and their statistics.

Imports `microstructure.shapes`, `schema` and `system`.  Main entries: `arrangement.Arrangement`,
`periodic_table.table_arrangement`, `random_fibres`.
"""
