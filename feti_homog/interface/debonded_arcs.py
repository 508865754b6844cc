"""Find tips and interface nodes of debonded arcs, and follow chains of nodes along interfaces.

Directions are degrees about the centre of a fibre, from x1 towards x2.  The tips of an arc stay bonded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from feti_homog.case import interface_section
from feti_homog.interface.contact import BONDED, Status
from feti_homog.schema import wording
from feti_homog.typing import Bool, Float, Int

# Distance in degrees within which a node is the tip: coordinates in files and on circles are rounded.
TIP_TOLERANCE_DEGREES = 1e-6
# Decimals of directions in degrees for sorting and comparison: rounding must not change the order.
DIRECTION_DIGITS = 9
# Fibre number from 1, and direction of a tip as in `tips` -> direction of this tip in the mesh.
MovedTips = Mapping[tuple[int, float], float]
NOT_MOVED: MovedTips = {}


class InterfaceChains:
    """Chains of interface nodes, stored as the neighbours of each node along its interface.

    Attributes:
        neighbours: (n, 2) neighbours of each node, both -1 unless the node has exactly two.
    """

    def __init__(self, adjacency: csr_matrix) -> None:
        """Find the neighbours of all nodes; `adjacency` (n, n) is 1 between neighbours."""
        two = np.diff(adjacency.indptr) == 2
        self.neighbours = np.full((len(two), 2), -1)
        self.neighbours[two] = adjacency.indices[adjacency.indptr[:-1][two][:, None] + np.arange(2)]

    def tips(self, status: Status) -> CrackTips:
        """Return the crack tips for node states (n,): bonded nodes between a bonded and a debonded neighbour."""
        has_two = self.neighbours[:, 0] >= 0
        debonded = (status != BONDED)[self.neighbours] & has_two[:, None]
        node = np.flatnonzero((status == BONDED) & (debonded[:, 0] != debonded[:, 1]))
        side = np.argmax(debonded[node], axis=1)
        return CrackTips(node, behind=self.neighbours[node, side], ahead=self.neighbours[node, 1 - side])

    def onward(self, start: Int, through: Int, steps: int) -> Int:
        """Follow the interfaces from the nodes `start` (t,) through the nodes `through` (t,).

        Return the chains (t, steps + 1) of node numbers, -1 beyond the end of a chain.
        """
        nodes = [start, through]
        while len(nodes) <= steps:
            before, last = nodes[-2:]
            pair = self.neighbours[last]
            following = np.where(pair[:, 0] == before, pair[:, 1], pair[:, 0])
            nodes.append(np.where(last >= 0, following, -1))
        return np.stack(nodes, axis=1)


@dataclass(frozen=True)
class CrackTips:
    """The t tips of debonded arcs, each with its two neighbours, as numbers of interface nodes.

    Attributes:
        node: (t,) tips, which are bonded.
        behind, ahead: (t,) neighbours of the tips on the debonded and on the bonded side.
    """

    node: Int
    behind: Int
    ahead: Int

    def chosen(self, which: Int | Bool) -> CrackTips:
        """Return the tips that an index or a mask selects."""
        return CrackTips(self.node[which], self.behind[which], self.ahead[which])


def closing_work(length: float, before: Float, force: Float, behind: Float, jump: Float) -> Float:
    """Return the energy release rates (c,) of opening and shear, or of axial shear alone; at least 0.

    Irwin's integral for closing the end of a crack, over the closed length a, is the work per length

        sum_k F_k w(a - s_k) / (2 a)  ->  1 / (2 a) int_0^a t(s) w(a - s) ds

    of forces F (tractions t) at distances s ahead of the tip on jumps w behind the tip.

    Args:
        length: closed length a.
        before, force: (j,) distances s of bonded nodes from the tip, the tip first, and forces (j, c) on these nodes.
        behind, jump: (k,) rising distances of nodes behind the tip, the tip first, and jumps (k, c) at these nodes.
    """
    within = before < length
    w = np.stack([np.interp(length - before[within], behind, component) for component in jump.T], axis=1)
    return np.asarray(np.maximum((force[within] * w).sum(axis=0), 0.0) / (2 * length))


def tips(arcs: Sequence[interface_section.Arc], values: Sequence[float], fibres: int) -> dict[int, list[float]]:
    """Return the sorted tip directions in [0, 360) of each fibre with tips, by fibre number from 0 to `fibres` - 1.

    An arc without an angle takes every opening in `values`, in degrees.  Openings of 0 and 360 have no tips.
    """
    marks: dict[int, set[float]] = {}
    for arc in arcs:
        openings = values if arc.angle is None else (arc.angle,)
        halves = [opening / 2 for opening in openings if 0 < opening < 360]
        ends = {_end(arc, side * half) for half in halves for side in (-1, 1)}
        for fibre in range(1, fibres + 1) if isinstance(arc.fibre, str) else arc.fibre:
            marks.setdefault(fibre - 1, set()).update(ends)
    return {fibre: sorted(marks[fibre]) for fibre in sorted(marks) if marks[fibre]}


def angles(points: Float, fibre: Int, centres: Float, period: Float) -> Float:
    """Return directions (k,) in [-180, 180] of points (k, 2) about the centres of their fibres.

    `fibre` (k,) has indices in `centres` (n, 2); a NaN centre gives NaN.  `period` (2,) is the period of the cell.
    """
    offset = points - centres[fibre]
    offset -= np.round(offset / period) * period
    return np.asarray(np.degrees(np.arctan2(offset[:, 1], offset[:, 0])))


def moved_tips(marks: Mapping[int, Sequence[float]], fibre: Int, direction: Float, limit: float) -> MovedTips:
    """Return the tips, as `MovedTips`, that a mesh moves to a vertex at most `limit` degrees away.

    `marks` are tips from the function `tips`; vertices lie on fibres `fibre` (k,), numbered from 1, in directions (k,).
    """
    moved = {}
    for number, ends in marks.items():
        directions = direction[fibre == number + 1]
        for end in ends:
            offset = (directions - end + 180.0) % 360.0 - 180.0
            nearest = offset[np.argmin(np.abs(offset))] if len(offset) else np.inf
            if TIP_TOLERANCE_DEGREES < abs(nearest) <= limit:
                moved[number + 1, end] = end + float(nearest)
    return moved


def debonded(
    arcs: Sequence[interface_section.Arc], opening: float | None, fibre: Int, angle: Float, moved: MovedTips = NOT_MOVED
) -> Bool:
    """Return the mask (k,) of nodes strictly within debonded arcs; tips stay bonded.

    Nodes lie on fibres (k,), numbered from 1, in directions `angle` (k,); `moved` are the tips that the mesh has moved.
    Arcs without an angle take `opening`, which must then be given.
    """
    inside = np.zeros(len(fibre), bool)
    for arc in arcs:
        width = opening if arc.angle is None else arc.angle
        assert width is not None
        ends = np.empty((2, len(fibre)))  # of the arc at each node, not reduced to [0, 360)
        for end, half in zip(ends, (-width / 2, width / 2), strict=True):
            end[:] = arc.centre + half
            for (number, direction), actual in moved.items():
                if direction == _end(arc, half):
                    end[fibre == number] += actual - direction
        start, stop = ends
        offset = (angle - start) % 360.0
        within = (offset > TIP_TOLERANCE_DEGREES) & (offset < stop - start - TIP_TOLERANCE_DEGREES)
        within = (within & (0 < width < 360)) | (width >= 360.0)
        is_chosen = np.isin(fibre, arc.fibre) if isinstance(arc.fibre, tuple) else np.ones(len(fibre), bool)
        inside |= within & is_chosen
    return inside


def _end(arc: interface_section.Arc, half: float) -> float:
    """Return the direction in [0, 360) of an arc end.  `half` is its signed angle in degrees from the arc centre."""
    return round(arc.centre + half, DIRECTION_DIGITS) % 360.0


def faults(arcs: Sequence[interface_section.Arc], centres: Float, label: str = "interface") -> list[str]:
    """List faults in the debonded arcs of interface `label`; fibre `centres` (n, 2) are NaN without a centre."""
    messages = []
    for number, arc in enumerate(arcs):
        chosen = range(1, len(centres) + 1) if isinstance(arc.fibre, str) else arc.fibre
        written = arc.fibre if isinstance(arc.fibre, str) or len(arc.fibre) > 1 else arc.fibre[0]
        line = f"[{label}] debonded[{number}].fibre = {wording.toml_value(written)}: "
        if max(chosen, default=0) > len(centres):
            most = f"expected at most {len(centres)}; the cell has {len(centres)} fibres, counted from 1"
            messages.append(line + most)
        winding = [fibre for fibre in chosen if fibre <= len(centres) and np.isnan(centres[fibre - 1, 0])]
        if winding and arc.angle not in (0.0, 360.0):
            messages.append(
                f"{line}fibre {winding[0]} has no centre, for it winds around the cell; expected angle = 360, or "
                'a physical curve "debonded" in the mesh'
            )
    return messages
