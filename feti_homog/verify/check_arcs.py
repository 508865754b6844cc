"""The law of what is debonded from the start: the arcs of the case, about the centres of the fibres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from feti_homog.typing import Bool, Float
from feti_homog.verify.check_interfaces import BONDED
from feti_homog.verify.check_loads import StateNumbers
from feti_homog.verify.check_mesh import from_centre
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings

# The mesher moves the tips of arcs by so many degrees at most; what is nearer to a tip is on neither side of it.
AT_TIP = 0.06


def check_arcs(findings: Findings, cell: DiscreteCell, states: Sequence[StateNumbers]) -> None:
    """Nodes inside the arcs are debonded in all states; those outside are bonded, before the load breaks them.

    In a user's mesh a curve may be debonded that is not in the files, so that only the first is known.
    """
    document, case = cell.files.document, cell.files.case
    from_mesh = case["cell"]["geometry"] == "mesh"
    points = document.get("angle", ())
    for state in states:
        # A number that is wrong breaks the law of the tables.
        opening = points[min(max(state.point, 0), len(points) - 1)]["angle"] if points else None
        inside, outside = _sides(cell, opening)
        bonded = state.status == BONDED
        findings.record("arcs", np.count_nonzero(inside & bonded), f"{state.name}, bonded within arcs")
        # The first state of a path by events is the one at which the first bonds break.
        intact = "path" not in document or (state.point == 0 and case["path"]["method"] == "events")
        if intact and not (from_mesh and "interface" in case):
            findings.record("arcs", np.count_nonzero(outside & ~bonded), f"{state.name}, debonded outside of arcs")


def _sides(cell: DiscreteCell, opening: float | None) -> tuple[Bool, Bool]:
    """Which interface nodes (k,) are inside of an arc, and which are outside of all of them."""
    rows, angle = cell.files.interface, directions(cell)
    inside, outside = np.zeros(len(angle), bool), np.ones(len(angle), bool)
    arcs = [(n, arc) for n, section in enumerate(cell.files.interfaces) for arc in section.get("debonded", ())]
    for pair, arc in arcs:
        own = (rows.pair == pair) & ((arc["fibre"] == "all") | np.isin(rows.fibre, arc["fibre"]))
        half = (arc["angle"] if arc.get("angle") is not None else float(opening or 0.0)) / 2
        away = np.abs((angle - arc["centre"] + 180.0) % 360.0 - 180.0)
        inside |= own & ((away < half - AT_TIP) | (half >= 180.0))
        outside &= ~own | ((away > half + AT_TIP) & (half < 180.0)) | (half == 0.0)
    return inside, outside


def directions(cell: DiscreteCell) -> Float:
    """(k,) directions in degrees of the interface nodes from the centres of their fibres."""
    rows = cell.files.interface
    away = from_centre(rows.points, cell.files.fibres.centre[rows.fibre - 1], cell.files.size)
    return np.asarray(np.degrees(np.arctan2(away[:, 1], away[:, 0])))
