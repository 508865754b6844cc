"""Whether debonded arcs select any node: what bonds all in spite of an arc was not meant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.cell.outline import MERGED
from feti_homog.cell.periodic_topology import Torus
from feti_homog.cell.refinement import ReferenceLattice
from feti_homog.config.case import Case
from feti_homog.config.interface_section import Arc
from feti_homog.homogenization import tips
from feti_homog.interface import debonded_arcs
from feti_homog.interface.debonded_arcs import MovedTips
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class InterfaceNodes:
    """Nodes of interfaces on rank 0, before the refinement: (k,) numbers of fibres from 1, directions in degrees about
    their centres, and whether they are vertices of the coarse mesh.
    """

    fibre: Int
    direction: Float
    is_vertex: Bool

    @classmethod
    def of(cls, torus: Torus, lattice: ReferenceLattice, first_fibre: int, centres: Float) -> InterfaceNodes:
        """Those on edges between constituents, on their chords."""
        body = np.repeat(torus.constituent, 3)
        edge = torus.triangle_torus_edges.ravel()
        count = int(edge.max()) + 1
        low, high = np.full(count, body.max()), np.zeros(count, np.int64)
        np.minimum.at(low, edge, body)
        np.maximum.at(high, edge, body)
        between = np.flatnonzero(low != high)
        plane = np.unique(torus.torus_edge, return_index=True)[1][between]
        share = np.linspace(0.0, 1.0, lattice.intervals + 1)[None, :, None]
        ends = torus.mesh.points[torus.edges[plane]]
        points = (ends[:, :1] * (1 - share) + ends[:, 1:] * share).reshape(-1, 2)
        fibre = np.repeat(high[between], lattice.intervals + 1)
        is_vertex = np.tile(np.isin(share.ravel(), (0.0, 1.0)), len(between))
        return cls(
            fibre - first_fibre + 1,
            debonded_arcs.angles(points, fibre, centres, torus.mesh.period),
            is_vertex,
        )

    def moved_tips(self, case: Case) -> MovedTips:
        """Tips that the mesher has put into a vertex near them; a user's mesh has its vertices where they are."""
        if case.cell.has_own_mesh:
            return debonded_arcs.NOT_MOVED
        vertices = self.fibre[self.is_vertex], self.direction[self.is_vertex]
        return debonded_arcs.moved_tips(tips.directions(case), *vertices, float(np.degrees(MERGED)))

    def selects(self, arc: Arc, opening: float | None, fibre: int | None, moved: MovedTips) -> bool:
        """Whether any node, of that fibre if it is given, is within the arc."""
        inside = debonded_arcs.debonded([arc], opening, self.fibre, self.direction, moved)
        return bool((inside if fibre is None else inside[self.fibre == fibre]).any())


def faults(case: Case, nodes: InterfaceNodes, moved: MovedTips) -> list[str]:
    """Faults of arcs, and of openings of [angle], other than 0 that select no node of a fibre."""
    openings: Sequence[float | None] = [None] if case.angle is None else case.angle.values
    found = []
    for place, arc in enumerate(case.arcs):
        for opening in openings:
            whole = opening if arc.angle is None else arc.angle
            fibres = [None] if isinstance(arc.fibre, str) else list(arc.fibre)
            empty = [fibre for fibre in fibres if whole and not nodes.selects(arc, opening, fibre, moved)]
            found += [_fault(place, whole, fibre, nodes) for fibre in empty]
    return list(dict.fromkeys(found))


def _fault(place: int, opening: float | None, fibre: int | None, nodes: InterfaceNodes) -> str:
    line = f"[interface] debonded[{place}]"
    if fibre is not None and fibre not in nodes.fibre:
        return f"{line}.fibre: fibre {fibre} has no interface that can debond"
    whose = "any fibre" if fibre is None else f"fibre {fibre}"
    return f"{line}: no node of {whose} is within the arc of {opening} degrees; make it wider, or the elements smaller"
