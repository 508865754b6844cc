"""Faults of the shapes of the fibres of a table."""

from __future__ import annotations

from feti_homog.case.fibre_table import FibreTable
from feti_homog.fibres.outlines.shapes import BOTH_SIZES, SHAPES, have_both_sizes
from feti_homog.typing import Bool

# Inner / outer radius of hollow fibres.
WIDEST_CORE = 0.05, 0.98
HOLLOW_WORDS = f"expected inner_radius / radius from {WIDEST_CORE[0]:g} to {WIDEST_CORE[1]:g}, or 0"


def check_shapes(table: FibreTable, faults: list[str]) -> None:
    """Add the faults of shapes and of hollow fibres to `faults`."""
    rows, before = table.columns, len(faults)
    _tell(table, have_both_sizes(rows), BOTH_SIZES, faults)
    for shape in SHAPES:
        for are_faulty, words in shape.faults(rows):
            _tell(table, are_faulty, words, faults)
    if len(faults) > before:
        return
    hollow, inner = table.inner_radius > 0, table.inner_radius / table.radius
    _tell(table, hollow & ((inner < WIDEST_CORE[0]) | (inner > WIDEST_CORE[1])), HOLLOW_WORDS, faults)
    _tell(table, hollow & (table.coating > 0), "has an inner_radius and a coating; give one", faults)


def _tell(table: FibreTable, are_faulty: Bool, words: str, faults: list[str]) -> None:
    faults += [f"[cell] {table.name}: row {row}: {words}" for row in table.row[are_faulty].tolist()]
