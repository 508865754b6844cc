"""Errors that springs at nodes make in the energy of each pair of responses, beside those of elements and arcs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from feti_homog.feti.decomposition.neighbours import InterfaceNeighbours
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.tips.debonded_arcs import InterfaceChains
from feti_homog.typing import Float, Int


def spring_errors(cell: TornCell, responses: Sequence[Response]) -> tuple[Float, Float]:
    """(k, k) each: `_beyond_tips`, and `_of_unlike_sides` of linear elements in the plane.  Collective."""
    nodes, state = cell.solver.jump_operator.nodes, responses[0].state
    rows = nodes.row[:, None] + np.arange(cell.solver.jump_operator.components)
    force = np.stack([response.scale * response.state.solution.lam[rows] for response in responses], axis=2)
    jump = force * state.solution.compliance[rows][:, :, None]
    of_ranks = cell.comm.allgather((state.status, nodes.points, nodes.normal, nodes.length, force, jump))
    status, points, normal, length, force, jump = (np.concatenate(each) for each in zip(*of_ranks, strict=True))
    chains = InterfaceChains(InterfaceNeighbours(cell.comm, cell.solver.jump_operator, cell.subdomains).adjacency)

    def between(start: Int, stop: Int) -> Float:
        """(n, 2) from nodes to nodes, images the nearest."""
        ends = points[stop] - points[start]
        return np.asarray(ends - np.round(ends / cell.summary.period) * cell.summary.period)

    tips = chains.tips(status)
    behind, ahead = (np.hypot(*between(tips.node, other).T) for other in (tips.behind, tips.ahead))
    beyond = _beyond_tips(behind / (behind + ahead), force[tips.node], jump[tips.node])
    if cell.lattice.order == 2 or force.shape[1] == 1:
        return beyond, np.zeros(beyond.shape)
    at = np.flatnonzero(chains.neighbours[:, 0] >= 0)
    sides = np.stack([between(at, other) for other in chains.neighbours[at].T])
    turn = np.diff(normal[chains.neighbours[at]], axis=1)[:, 0]
    return beyond, _of_unlike_sides(sides, turn, normal[at], force[at] / length[at, None, None], jump[at])


def _beyond_tips(share: Float, force: Float, jump: Float) -> Float:
    """(k, k) int t_i . d_j on what nodes (t,) at tips hold of debonded faces: a tip is bonded on its whole length.

    `share` (t,) of the length, `force` and `jump` (t, c, k).
    """
    return np.asarray(np.einsum("t,tci,tcj->ij", share, force, jump))


def _of_unlike_sides(sides: Float, turn: Float, normal: Float, traction: Float, jump: Float) -> Float:
    """(k, k) sum over sides h^2 / 12 (d_i . K' d_j), from start to end, which unlike sides leave if K turns with n.

    The trapezoidal rule and the interpolation of u err by h^2 / 12 (t_i'' . d_j - t_j . d_i'') more than `arc_energy`
    has, with t = K d, K = k_n n n + k_t t t and K' = (k_n - k_t) (n . t') (n t + t n) along the interface.

    Args:
        sides: (2, n, 2) from each node to both neighbours.
        turn: (n, 2) normal of the second less that of the first.
        normal: (n, 2).
        traction, jump: (n, 2, k) along normal and tangent.
    """
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    squares = (sides**2).sum(axis=2)
    curvature = (turn * tangent).sum(axis=1) / np.abs(((sides[1] - sides[0]) * tangent).sum(axis=1))
    weight = curvature * (squares[0] - squares[1]) / 12
    half = np.einsum("n,nki,nkj->ij", weight, traction[:, [0, 1]] * [[1.0], [-1.0]], jump[:, [1, 0]])
    return np.asarray(half + half.T)
