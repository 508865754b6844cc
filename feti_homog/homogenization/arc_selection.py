"""Debonded arcs in a cell: whether they select any node, where their tips are, how fine the mesh is there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from feti_homog.case.case import Case
from feti_homog.case.interface_section import Arc, InterfaceSection, interface_label
from feti_homog.interface import debonded_arcs
from feti_homog.interface.debonded_arcs import MovedTips
from feti_homog.mesh.outline.outline import MERGED
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.mesh.sizes.element_estimate import ElementEstimate, ratio_at_a_tip
from feti_homog.microstructure.phase_names import COATING, MATRIX
from feti_homog.typing import Bool, Float, Int

# The stress at a tip is singular, so that the energy errs by about the size of the elements there, elsewhere by
# h^(2 order). At this share of a balance the tips err no more than the rest (`scripts/measure_tips.py`).
TIP_SHARE = 0.5
# Where one mesh has the tips of many openings, of which one at a time is there: triangles that all tips together add by
# default / those of the mesh without them, at most.
TIP_TRIANGLES = 2.0
# Size at tips / width of the cell by default, at least.
LEAST_SIZE = 1e-5


def on_interface(case: Case, interface: InterfaceSection, fibres: int) -> dict[int, list[float]]:
    """Directions in [0, 360) of the tips of its arcs on so many fibres, by the fibre's number from 0.

    They are those at all openings.
    """
    return debonded_arcs.tips(interface.debonded, case.section.openings, fibres)


def marks(case: Case, fibres: int) -> dict[int, list[float]]:
    """Directions of all tips on so many fibres, by the number of their curve (`BareOutline.of`)."""
    found: dict[int, set[float]] = {}
    for interface in case.interfaces:
        is_within = interface.between is not None and {COATING, MATRIX} & set(interface.between) == {COATING}
        for fibre, own in on_interface(case, interface, fibres).items():
            found.setdefault(~fibre if is_within else fibre, set()).update(own)
    return {curve: sorted(found[curve]) for curve in sorted(found)}


def size(case: Case, estimate: ElementEstimate) -> float | None:
    """Element size at tips / width of the cell, None for that of the interface: that of the case, or by default

        h_t = 2^refine R (h / R)^(2 order) / 2,  h = interface_size / 2^refine,

    with R the mean radius / width; but with several openings not so small that their tips took more than TIP_TRIANGLES.
    Along paths tips move, and only that of the case counts; so it is with envelopes, for they begin paths.
    """
    cell, tips = case.cell, sum(len(own) for own in marks(case, estimate.fibres).values())
    if cell.tip_size is not None or case.section.breaks or not tips:
        return cell.tip_size
    radius, around = estimate.mean_radius, estimate.interface_size
    fine = around / 2**cell.refine
    balanced: float = TIP_SHARE * 2**cell.refine * radius * (fine / radius) ** (2 * cell.order)
    wanted = max(balanced, LEAST_SIZE)
    if len(case.section.openings) > 1:
        share = TIP_TRIANGLES * estimate.triangles / tips
        wanted = max(wanted, around / ratio_at_a_tip(share))
    return min(around, wanted)


@dataclass(frozen=True)
class InterfaceNodes:
    """Nodes of interfaces on rank 0, before the refinement.

    (k,) numbers of fibres from 1, interfaces of the case, directions in degrees about their centres, and whether they
    are vertices of the coarse mesh.
    """

    fibre: Int
    pair: Int
    direction: Float
    is_vertex: Bool

    @classmethod
    def of(cls, torus: Torus, lattice: ReferenceLattice, pairs: Int, numbers: Int, centres: Float) -> InterfaceNodes:
        """Place the nodes on edges that may debond, on their chords, but for vertices that never part.

        `pairs` as in `share_entities`, `numbers` (constituents,) those of fibres.
        """
        left, right, edge = torus.sides
        pair = pairs[torus.mesh.phase[left], torus.mesh.phase[right]]
        sides = torus.constituent[np.stack([left, right])][:, pair >= 0]
        inner = np.take_along_axis(sides, torus.nesting[sides].argmax(axis=0)[None], axis=0)[0]
        between = edge[pair >= 0]
        plane = np.unique(torus.torus_edge, return_index=True)[1][between]
        share = np.linspace(0.0, 1.0, lattice.intervals + 1)[None, :, None]
        ends = torus.mesh.points[torus.edges[plane]]
        points = ends[:, :1] * (1 - share) + ends[:, 1:] * share
        parts = np.ones(points.shape[:2], bool)
        parts[:, [0, -1]] = ~torus.never_part[torus.node_class[torus.edges[plane]]]
        own, step = np.nonzero(parts)
        return cls(
            numbers[inner[own]],
            pair[pair >= 0][own],
            debonded_arcs.angles(points[parts], inner[own], centres, torus.mesh.period),
            (step == 0) | (step == lattice.intervals),
        )

    def moved_tips(self, case: Case, fibres: int) -> tuple[MovedTips, ...]:
        """Find the tips of each interface, on so many fibres, that the mesher has put into a vertex near them.

        A user's mesh has its vertices where they are.
        """
        if case.cell.has_own_mesh:
            return (debonded_arcs.NOT_MOVED,) * len(case.interfaces)
        most, moved = float(np.degrees(MERGED)), []
        for pair, interface in enumerate(case.interfaces):
            own = self.is_vertex & (self.pair == pair)
            wanted = on_interface(case, interface, fibres)
            moved.append(debonded_arcs.moved_tips(wanted, self.fibre[own], self.direction[own], most))
        return tuple(moved)

    def within(self, pair: int) -> InterfaceNodes:
        """Return those of one interface of the case."""
        own = self.pair == pair
        return InterfaceNodes(self.fibre[own], self.pair[own], self.direction[own], self.is_vertex[own])

    def selects(self, arc: Arc, opening: float | None, fibre: int | None, moved: MovedTips) -> bool:
        """Return whether any node, of that fibre if it is given, is within the arc."""
        inside = debonded_arcs.debonded([arc], opening, self.fibre, self.direction, moved)
        return bool((inside if fibre is None else inside[self.fibre == fibre]).any())


def fibre_faults(case: Case, centres: Float) -> list[str]:
    """List the faults of the fibres of arcs in a cell.

    Its fibres have these centres (fibres, 2), NaN where there is none.
    """
    return [
        fault
        for pair, interface in enumerate(case.interfaces)
        for fault in debonded_arcs.faults(interface.debonded, centres, interface_label(pair, len(case.interfaces)))
    ]


def faults(case: Case, nodes: InterfaceNodes, moved: Sequence[MovedTips]) -> list[str]:
    """Faults of arcs, and of openings of [angle], other than 0 that select no node of a fibre."""
    openings: Sequence[float | None] = case.section.openings or [None]
    found = []
    for pair, interface in enumerate(case.interfaces):
        own, label = nodes.within(pair), interface_label(pair, len(case.interfaces))
        for (place, arc), opening in product(enumerate(interface.debonded), openings):
            whole = opening if arc.angle is None else arc.angle
            fibres = [None] if isinstance(arc.fibre, str) else list(arc.fibre)
            empty = [fibre for fibre in fibres if whole and not own.selects(arc, opening, fibre, moved[pair])]
            line = f"[{label}] debonded[{place}]"
            found += [_fault(line, whole, fibre, own, interface.between) for fibre in empty]
    return list(dict.fromkeys(found))


def _fault(
    line: str, opening: float | None, fibre: int | None, nodes: InterfaceNodes, between: Sequence[str] | None
) -> str:
    if fibre is not None and fibre not in nodes.fibre:
        which = "that can debond" if between is None else f"between {' and '.join(between)}"
        return f"{line}.fibre: fibre {fibre} has no interface {which}"
    whose = "any fibre" if fibre is None else f"fibre {fibre}"
    return f"{line}: no node of {whose} is within the arc of {opening} degrees; make it wider, or the elements smaller"
