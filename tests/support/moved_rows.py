"""Rows of a table whose fibres a cut window moves."""

import numpy as np

from feti_homog.microstructure.cut_window import TOLERANCE
from feti_homog.microstructure.fibre_table import FibreTable
from feti_homog.microstructure.periodic_table import on_torus
from feti_homog.typing import Float, Int


def moved_rows(table: FibreTable) -> tuple[Int, Float]:
    """Their numbers (m,) and how far they are moved (m,)."""
    kept, _, moves, _ = on_torus(table, "cut")
    distance = np.linalg.norm(moves, axis=1)
    moved = distance > TOLERANCE * table.radius.mean()
    return table.row[kept[moved]], distance[moved]
