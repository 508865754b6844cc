"""Whether debonded arcs select any node: what bonds all in spite of an arc was not meant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from feti_homog.case.case import Case
from feti_homog.case.interface_section import Arc, interface_label
from feti_homog.homogenization import tips
from feti_homog.interface.tips import debonded_arcs
from feti_homog.interface.tips.debonded_arcs import MovedTips
from feti_homog.mesh.outline.circle_arcs import MERGED
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class InterfaceNodes:
    """Nodes of interfaces on rank 0, before the refinement: (k,) numbers of fibres from 1, interfaces of the case,
    directions in degrees about their centres, and whether they are vertices of the coarse mesh.
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
            wanted = tips.on_interface(case, interface, fibres)
            moved.append(debonded_arcs.moved_tips(wanted, self.fibre[own], self.direction[own], most))
        return tuple(moved)

    def within(self, pair: int) -> InterfaceNodes:
        """Those of one interface of the case."""
        own = self.pair == pair
        return InterfaceNodes(self.fibre[own], self.pair[own], self.direction[own], self.is_vertex[own])

    def selects(self, arc: Arc, opening: float | None, fibre: int | None, moved: MovedTips) -> bool:
        """Return whether any node, of that fibre if it is given, is within the arc."""
        inside = debonded_arcs.debonded([arc], opening, self.fibre, self.direction, moved)
        return bool((inside if fibre is None else inside[self.fibre == fibre]).any())


def fibre_faults(case: Case, centres: Float) -> list[str]:
    """List the faults of the fibres of arcs in a cell whose fibres have these centres (fibres, 2), NaN where there is
    none."""
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
