"""Errors that springs at nodes make in the energy of each pair of responses, beside those of elements and arcs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import roots_legendre

from feti_homog.feti.decomposition.neighbours import InterfaceNeighbours
from feti_homog.feti.decomposition.shared_entities import along, edge_normals
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.shared_vertices import border_lines
from feti_homog.homogenization.uniform_parts import UniformPart
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact.states import BONDED, Status
from feti_homog.interface.debonded_arcs import InterfaceChains
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.system.parallel.distributed_arrays import allreduce_sum
from feti_homog.typing import Bool, Float, Int

# Gauss points of a side, by which ellipses and products of quadratic functions are exact to rounding or nearly so.
POINTS, WEIGHTS = roots_legendre(6)


@dataclass(frozen=True)
class _Springs:
    """The interface nodes of all ranks; forces and jumps of k responses along normal, tangent and fibre.

    Attributes:
        holds: (n,) whether it is bonded by springs in all directions.
        fibre: (n,) inner body.
        points, normal: (n, 2).
        stiffness: (n, c) stress per jump.
        force, jump: (n, c, k).
    """

    holds: Bool
    fibre: Int
    points: Float
    normal: Float
    stiffness: Float
    force: Float
    jump: Float

    @classmethod
    def of(cls, cell: TornCell, responses: Sequence[Response]) -> _Springs:
        """Gather them.  Collective."""
        jumps, state = cell.solver.jump_operator, responses[0].state
        nodes = jumps.nodes
        rows = nodes.row[:, None] + np.arange(jumps.components)
        force = np.stack([response.scale * response.state.solution.lam[rows] for response in responses], axis=2)
        C = state.solution.compliance[rows]
        holds = (state.status == BONDED) & (C > 0).all(axis=1)
        stiffness = 1 / (np.where(holds[:, None], C, 1.0) * nodes.length[:, None])
        own = holds, nodes.bodies[:, 1], nodes.points, nodes.normal, stiffness, force, force * C[:, :, None]
        return cls(*(np.concatenate(each) for each in zip(*cell.comm.allgather(own), strict=True)))

    def in_space(self, components: Float) -> Float:
        """(n, 2, k) vectors in the plane of components (n, 2, k) along normal and tangent; (n, 1, k) stay."""
        if components.shape[1] == 1:
            return components
        tangent = np.column_stack([-self.normal[:, 1], self.normal[:, 0]])
        return np.asarray(self.normal[..., None] * components[:, None, 0] + tangent[..., None] * components[:, None, 1])


def spring_errors(cell: TornCell, responses: Sequence[Response]) -> tuple[Float, Float]:
    """(k, k) each: what tips have beyond them, and what sides have but for what `arc_energy` knows.  Collective."""
    springs = _Springs.of(cell, responses)
    neighbours = InterfaceNeighbours(cell.comm, cell.solver.jump_operator, cell.subdomains)
    status = np.concatenate(cell.comm.allgather(responses[0].state.status))
    beyond = _beyond_tips(springs, InterfaceChains(neighbours.adjacency), status, cell.summary.period)
    number, of_sides, first = neighbours.node_numbers(cell.solver.jump_operator), np.zeros(beyond.shape), 0
    for part in cell.parts:
        own = number[first : first + part.mesh.n_classes]
        first += part.mesh.n_classes
        of_sides += _of_sides(springs, part, own, cell.lattice)
    return beyond, allreduce_sum(cell.comm, of_sides)


def _beyond_tips(springs: _Springs, chains: InterfaceChains, status: Status, period: Float) -> Float:
    """(k, k) int t_i . d_j on what nodes at tips hold of debonded faces: a tip is bonded on its whole length."""
    tips = chains.tips(status)
    ends = springs.points[np.stack([tips.behind, tips.ahead])] - springs.points[tips.node]
    behind, ahead = np.linalg.norm(ends - np.round(ends / period) * period, axis=2)
    return np.asarray(
        np.einsum("t,tci,tcj->ij", behind / (behind + ahead), springs.force[tips.node], springs.jump[tips.node])
    )


def _of_sides(springs: _Springs, part: UniformPart, number: Int, lattice: ReferenceLattice) -> Float:
    """(k, k) energy of springs at nodes less that of springs along the sides of a fibre, less what is known on arcs.

    `number` (classes,) among the springs, -1 of others.  Both energies are those of the functions on sides that nodes
    have; the exact jump d adds to the energy of springs and of t on how far d is from these as much as these lack.
    """
    order = lattice.order
    triangle, k, line = border_lines(part.submesh, part.mesh, part.mesh.node_class[part.mesh.nodes])
    at = number[line]
    known = at.min(axis=1) >= 0
    known[known] = (springs.fibre[at[known]] == part.submesh.constituent[triangle[known], None]).all(axis=1)
    normal, turn = edge_normals(part.submesh, triangle[known], k[known])
    first = np.arange(0, lattice.intervals, order)
    nodes = at[known][:, first[:, None] + np.arange(order + 1)]
    edge, side = np.nonzero(springs.holds[nodes].all(axis=2))
    nodes, normal, turn = nodes[edge, side], normal[edge], turn[edge]
    places = (side[:, None] + (1 + POINTS) / 2) * order / lattice.intervals
    ahead = np.stack([along(normal, turn, place) for place in places.T], axis=1)
    speed = np.hypot(*np.moveaxis(ahead, 2, 0))
    ds = speed * WEIGHTS / 2 * order / lattice.intervals
    length = ds.sum(axis=1)
    # Functions of linear elements are linear in place on the chord, so nearly in length along the arc.
    xi = np.broadcast_to((1 + POINTS) / 2, ds.shape)
    if order == 1:
        bend = 3 * (ds @ POINTS) / length
        xi = xi - bend[:, None] * xi * (1 - xi)
        shape, weights = np.stack([1 - xi, xi]), np.repeat(length[:, None] / 2, 2, axis=1)
    else:
        shape = np.stack([(1 - xi) * (1 - 2 * xi), 4 * xi * (1 - xi), xi * (2 * xi - 1)])
        weights = np.einsum("fq,afq->fa", ds, shape)
    stiffness, jump = springs.stiffness[nodes], springs.jump[nodes]
    moved = springs.in_space(springs.jump)[nodes]
    traction = springs.in_space(springs.stiffness[:, :, None] * springs.jump)[nodes]
    blended = np.einsum("afq,fadi->fqdi", shape, moved)
    if moved.shape[2] == 2:
        unit = ahead / speed[:, :, None]
        frame = np.stack([unit, np.stack([-unit[..., 1], unit[..., 0]], axis=2)], axis=2)
        blended = np.einsum("fqcd,fqdi->fqci", frame, blended)
    at_nodes = np.einsum("fa,fac,faci,facj->ij", weights, stiffness, jump, jump, optimize=True)
    between = np.einsum("afq,fac->fqc", shape, stiffness)
    on_sides = np.einsum("fq,fqc,fqci,fqcj->ij", ds, between, blended, blended, optimize=True)
    share = np.where(turn > 0, length, 0.0) / {1: 12, 2: 60}[order]
    differences = (np.diff(each, n=order, axis=1)[:, 0] for each in (traction, moved))
    on_arcs = np.einsum("f,fdi,fdj->ij", share, *differences, optimize=True)
    return np.asarray(at_nodes - on_sides - on_arcs - on_arcs.T)
