"""The pattern of a table of fibres that were measured in a window, as in a micrograph."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.errors import CaseError
from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.microstructure.fibre_table import FibreTable, read_table
from feti_homog.microstructure.shapes.shapes import BOTH_SIZES, have_both_sizes
from feti_homog.typing import Bool

# Centres nearer than this share of the radius are one fibre twice.
SAME_CENTRE = 1e-6


def read_window(path: Path, size: tuple[float, float] | None = None) -> FibrePattern:
    """Return the fibres of a table, at least two, in a window of this width and height.

    Without these, the window is that which the table gives; ellipses count as discs of the same centres and areas.

    Voids are left out. The window begins at the `left` and `bottom` of the table, else at 0.

    Raises:
        CaseError: the table is faulty, or its size unknown; a fibre has its centre outside of the window, or is there
            twice.
    """
    table = read_table(path).solid
    width, height = size or (table.width, table.height)
    if width is None or height is None:
        raise CaseError(
            f'{table.name}: the size of the window is missing; expected a line such as "# width = 120, height = 80"'
        )
    centres = table.centres - [table.left or 0.0, table.bottom or 0.0]
    radii = table.radius
    outside = ~np.all((centres >= 0) & (centres <= [width, height]), axis=1)
    faults = [
        *_faults(table, have_both_sizes(table.columns), BOTH_SIZES),
        *_faults(table, outside, f"its centre is outside of the window of {width:g} x {height:g}"),
    ]
    if not faults:
        pairs = cKDTree(centres).query_pairs(SAME_CENTRE * float(radii.min()), output_type="ndarray")
        again = np.isin(np.arange(len(centres)), pairs.max(axis=1, initial=-1))
        faults = _faults(table, again, "there is a fibre at the same place before")
    if len(centres) < 2:
        faults.append(f"{table.name}: expected at least two fibres, got {len(centres)}")
    if faults:
        raise CaseError(*faults)
    return FibrePattern(width, height, centres, radii, periodic=False)


def _faults(table: FibreTable, are_faulty: Bool, words: str) -> list[str]:
    return [f"{table.name}: row {row}: {words}" for row in table.row[are_faulty]]
