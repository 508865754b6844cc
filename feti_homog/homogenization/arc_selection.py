"""Find faults of debonded arcs in a cell, find the tips that the mesh places or moves, and size elements at tips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from feti_homog.case import Case, interface_section
from feti_homog.homogenization.cell_remarks import LEAST_SIZE
from feti_homog.interface import debonded_arcs
from feti_homog.mesh import ReferenceLattice, Torus
from feti_homog.mesh.fill import element_estimate
from feti_homog.mesh.outline import outline
from feti_homog.microstructure import phase_names
from feti_homog.typing import Bool, Float, Int

# The singular stress at a tip causes an energy error proportional to the element size there; elsewhere the error is
# O(h^(2 order)). At this fraction of the size that balances both errors, tips add little (`scripts/measure_tips.py`).
TIP_SHARE = 0.5
# Largest default ratio of the triangles that tips add to the triangles of a mesh for several openings.
TIP_TRIANGLES = 2.0


def marks(case: Case, fibres: int) -> dict[int, list[float]]:
    """Return sorted tip directions by curve, in degrees: n is the outer curve of fibre n from 0, ~n the inner one."""
    by_curve: dict[int, set[float]] = {}
    for interface in case.interfaces:
        ends = {phase_names.COATING, phase_names.MATRIX} & {*(interface.between or ())}
        is_within = ends == {phase_names.COATING}
        for fibre, directions in debonded_arcs.tips(interface.debonded, case.section.openings, fibres).items():
            by_curve.setdefault(~fibre if is_within else fibre, set()).update(directions)
    return {curve: sorted(by_curve[curve]) for curve in sorted(by_curve)}


def size(case: Case, estimate: element_estimate.ElementEstimate) -> float | None:
    """Return the element size at tips, relative to the cell width; None if the size on interfaces also holds at tips.

    Without `tip_size` in the case, the size follows from the ratio R of the mean fibre radius to the cell width,

        h_t = 2^refine R (h / R)^(2 order) / 2,  h = interface_size / 2^refine,

    at least LEAST_SIZE, at most `interface_size`.  With several openings h_t may be larger, so that tips add at most
    TIP_TRIANGLES times the triangles of the mesh.  In paths and envelopes tips move: only `tip_size` sets a size there.
    """
    cell, tips = case.cell, sum(map(len, marks(case, estimate.fibres).values()))
    if cell.tip_size is not None or case.section.breaks or not tips:
        return cell.tip_size
    radius, around = estimate.mean_radius, estimate.interface_size
    fine = around / 2**cell.refine
    balanced: float = TIP_SHARE * 2**cell.refine * radius * (fine / radius) ** (2 * cell.order)
    size_at_tips = max(balanced, LEAST_SIZE)
    if len(case.section.openings) > 1:
        triangles_of_a_tip = TIP_TRIANGLES * estimate.triangles / tips
        size_at_tips = max(size_at_tips, around / element_estimate.ratio_at_a_tip(triangles_of_a_tip))
    return min(around, size_at_tips)


@dataclass(frozen=True)
class EstimatedNodes:
    """The k interface nodes that the refined mesh will have, placed on straight coarse edges, on rank 0.

    All are (k,): `fibre` numbers from 1, interfaces `pair`, `direction` in degrees (NaN without a centre), and
    `is_vertex`, which marks vertices of coarse triangles.
    """

    fibre: Int
    pair: Int
    direction: Float
    is_vertex: Bool

    @classmethod
    def of(cls, torus: Torus, lattice: ReferenceLattice, pairs: Int, numbers: Int, centres: Float) -> EstimatedNodes:
        """Place nodes on the coarse edges that may debond, except vertices that never part.

        `pairs` are as in `cell_remarks.pairs_of`; constituents (n,) have fibre `numbers` (n,) and `centres` (n, 2).
        """
        first, second, edge = torus.sides
        pair = pairs[torus.mesh.phase[first], torus.mesh.phase[second]]
        sides = torus.constituent[np.stack([first, second])][:, pair >= 0]
        inner = np.take_along_axis(sides, torus.nesting[sides].argmax(axis=0)[None], axis=0)[0]
        between = edge[pair >= 0]
        plane = np.unique(torus.torus_edge, return_index=True)[1][between]
        fraction = np.linspace(0.0, 1.0, lattice.intervals + 1)[None, :, None]
        ends = torus.mesh.points[torus.edges[plane]]
        points = ends[:, :1] * (1 - fraction) + ends[:, 1:] * fraction
        parts = np.ones(points.shape[:2], bool)
        parts[:, [0, -1]] = ~torus.never_part[torus.node_class[torus.edges[plane]]]
        side, step = np.nonzero(parts)
        directions = debonded_arcs.angles(points[parts], inner[side], centres, torus.mesh.shift)
        is_vertex = (step == 0) | (step == lattice.intervals)
        return cls(numbers[inner[side]], pair[pair >= 0][side], directions, is_vertex)


def checked(
    case: Case, nodes: EstimatedNodes, centres: Float, faults: Sequence[str]
) -> tuple[tuple[debonded_arcs.MovedTips, ...], list[str]]:
    """Return the tips that the mesher moved, by interface, and all faults: the given `faults`, then faults of arcs.

    The mesher moves tips to vertices, but not in a user's mesh.  Arcs on fibres that cannot have arcs are faults.
    Without other faults, arcs and nonzero [angle] openings that select no node are faults, too.  `centres` (fibres, 2)
    are NaN for fibres without a centre.
    """
    lines, moved = list(faults), list[debonded_arcs.MovedTips]()
    for label, interface in interface_section.labelled(case.interfaces):
        lines += debonded_arcs.faults(interface.debonded, centres, label)
    if lines:
        return (), lines
    openings: Sequence[float | None] = case.section.openings or [None]
    for pair, (label, interface) in enumerate(interface_section.labelled(case.interfaces)):
        of_pair = nodes.pair == pair
        fibres, directions = nodes.fibre[of_pair], nodes.direction[of_pair]
        places = nodes.is_vertex[of_pair] & (not case.cell.has_own_mesh)
        tips = debonded_arcs.tips(interface.debonded, case.section.openings, len(centres))
        farthest = float(np.degrees(outline.MERGED))
        moved.append(debonded_arcs.moved_tips(tips, fibres[places], directions[places], farthest))
        for (number, arc), opening in product(enumerate(interface.debonded), openings):
            angle = opening if arc.angle is None else arc.angle
            line = f"[{label}] debonded[{number}]"
            inside = debonded_arcs.debonded([arc], opening, fibres, directions, moved[pair])
            for fibre in [None] if isinstance(arc.fibre, str) else arc.fibre:
                of_fibre = inside if fibre is None else inside[fibres == fibre]
                if not angle or of_fibre.any():
                    continue
                if fibre is not None and fibre not in fibres:
                    kind = f"between {' and '.join(interface.between)}" if interface.between else "that can debond"
                    first = ", ".join(map(str, np.unique(fibres)[:3].tolist()))
                    lines.append(f"{line}.fibre: fibre {fibre} has no interface {kind}; the first with one: {first}")
                    continue
                whose = "any fibre" if fibre is None else f"fibre {fibre}"
                words = f"no node of {whose} is within the arc of {angle:g} degrees"
                lines.append(f"{line}: {words}; make it wider, or the elements smaller")
    return tuple(moved), list(dict.fromkeys(lines))
