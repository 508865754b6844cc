"""Fibres in a cross-section: outlines, tables, arrangements on the torus, and their statistics.

Imports `microstructure.shapes`, `schema` and `system`.  Main entries: `arrangements.Arrangement`,
`periodic_table.table_arrangement`, `random_fibres`.
"""

from feti_homog.microstructure.arrangements import Arrangement

__all__ = [
    "Arrangement", "arrangements", "fibre_pattern", "fibre_table", "periodic_table", "phase_names", "random_fibres",
    "table_columns",
]  # fmt: skip
