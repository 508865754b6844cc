"""Describe fibres in a cross-section: outlines, tables, images, and arrangements on the torus.

Imports `microstructure.shapes`, `schema` and `system`.  Main entries: `arrangements.Arrangement`,
`periodic_table.table_arrangement`, `random_fibres`.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from feti_homog.microstructure.arrangements import Arrangement

__all__ = [
    "Arrangement", "arrangements", "fibre_pattern", "fibre_table", "image_circles", "label_image", "periodic_table",
    "phase_names", "random_fibres", "table_columns",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Import `Arrangement` on first access: case files do not need SciPy trees.  Raises AttributeError."""
    if name != "Arrangement":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from feti_homog.microstructure.arrangements import Arrangement

    return Arrangement
