"""Estimate the energy error of straight or parabolic element sides that replace circular arcs.

The sides take area from a body or add area to it, and displacements along a side are polynomials between its nodes.
Every body computes its error without communication; for glued bodies the sum depends only on jumps between phases.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.fem.stress_recovery import RecoveredStress
from feti_homog.mesh import ReferenceLattice, Submesh
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class ArcSides:
    """The f element sides of order p that replace arcs; the body lies to the left of every side.

    Attributes:
        element, side: (f,) element number, and number of the corner at which the side starts.
        nodes, points: (f, p + 1) plane nodes along the side, and (f, p + 1, 2) their positions.
        normals: (f, p + 1, 2) unit normals of the arc at the nodes, out of the body.
        area: (f,) area that the body lacks between the side and the arc, negative for a surplus.
        at_void: (f,) whether a void is on the right.
    """

    element: Int
    side: Int
    nodes: Int
    points: Float
    normals: Float
    area: Float
    at_void: Bool

    @classmethod
    def of(cls, body: RecoveredStress, submeshes: Sequence[Submesh], lattice: ReferenceLattice) -> ArcSides:
        """Find the element sides on the arcs of `body`, which consists of `submeshes` refined by `lattice`."""
        corners = lattice.nodes[lattice.triangles[:, :3]]
        is_zero = np.stack([corners, np.roll(corners, -1, axis=1)]) == 0
        # On side k, from vertex k to the next vertex, the barycentric coordinate of the third vertex is zero.
        _, fine, side = np.nonzero(np.roll(is_zero.all(axis=0), 1, axis=2).transpose(2, 0, 1))
        fine, side = fine.reshape(3, -1), side.reshape(3, -1)
        n = fine.shape[1]
        edges = np.cumsum([0, *(len(submesh.turns) for submesh in submeshes)])
        numbers = [submesh.triangle_edges + first for submesh, first in zip(submeshes, edges, strict=False)]
        triangle_edges = np.concatenate(numbers)
        turns = np.concatenate([submesh.turns for submesh in submeshes])
        centres = np.concatenate([submesh.circles[:, :2] for submesh in submeshes])
        coarse, k = np.nonzero(turns[triangle_edges] > 0)
        element = (coarse[:, None] * len(corners) + fine[k]).ravel()
        side, edge = side[k].ravel(), np.repeat(triangle_edges[coarse, k], n)
        triangles = body.triangles[element]
        following = (side + 1) % 3
        places = [side, following] if lattice.order == 1 else [side, 3 + side, following]
        nodes = np.stack([triangles[np.arange(len(triangles)), j] for j in places], axis=1)
        points, turn = body.points[nodes], turns[edge] / n
        spokes = points - centres[edge, None]
        doubled = _cross(spokes[:, 0], spokes[:, -1])
        area = doubled / 2 * (turn / np.sin(turn) - 1)
        if lattice.order == 2:  # the segment of a parabola covers two thirds of the parallelogram around it
            area -= 2 / 3 * _cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        # On an arc, the vector y from the centre obeys y'' = -turn^2 y.
        cosine = np.cos(turn)[:, None]
        first, last = spokes[:, -1] - cosine * spokes[:, 0], cosine * spokes[:, -1] - spokes[:, 0]
        tangents = [first, last] if lattice.order == 1 else [first, last + first, last]
        units = [t / np.hypot(*t.T)[:, None] for t in tangents]
        normals = np.stack([np.column_stack([t[:, 1], -t[:, 0]]) for t in units], axis=1)
        at_void = np.concatenate([submesh.at_void[submesh.edge_class] for submesh in submeshes])
        return cls(element, side, nodes, points, normals, area, at_void[edge])


def arc_energy(body: RecoveredStress, sides: ArcSides, weights: Float) -> Float:
    """Estimate the error (k, k) in int sigma_i : eps_j, for loads i and j, due to sides that replace arcs.

    Diagonal entries are twice the energy error; each side has a weight (f,).  With recovered stresses sigma, the
    estimate is

        -int V (sigma_i : eps_j - t_i . du_j/dn - t_j . du_i/dn) ds - c sum_sides h (D t_i . D u_j + D t_j . D u_i)

    where V is the outward distance from the side to the arc, and t = sigma n.  The first integral is the energy rate of
    a moving boundary.  D is the difference of order p along the nodes of a side with length h, and c = 1/12 or, in
    order 2, 1/60: t does work on the interpolation error, -h^2 / 12 int t' . u' ds or -h^4 / 960 int t'' . u'' ds.
    """
    if not len(sides.element):
        return np.zeros((body.loads.shape[1],) * 2)
    # The first integral by the midpoint rule: area (sigma_i : eps_j - t_i . du_j/dn - t_j . du_i/dn) at the midpoints.
    m, stress = body.problem.strains, _at(body, sides, 0.5)
    macroscopic = np.stack([body.problem.gradient(load[:m]) for load in body.loads.T], axis=-1)  # (c, 2, k)
    loads = np.tile(body.loads, (len(stress), 1, 1))
    loads[:, :m] = body.flexibility @ (stress - body.L[:m, m:] @ body.loads[m:])
    chord = sides.points[:, -1] - sides.points[:, 0]
    h = np.hypot(*chord.T)[:, None]
    tangent = chord / h
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    gradient = loads[:, body.problem.voigt]
    if body.problem.components == 2:  # strains give the symmetric part, and nodes give du/ds along the side
        gradient[:, [0, 1], [1, 0]] /= 2
        u = body.u[body.node_class[sides.nodes]]
        along = (u[:, -1] - u[:, 0]) / h[..., None] + np.einsum("cdk,fd->fck", macroscopic, tangent)
        turn = (normal[..., None] * (along - _along(gradient, tangent))).sum(axis=1)
        turn *= (normal[:, 0] * tangent[:, 1] - normal[:, 1] * tangent[:, 0])[:, None]
        gradient[:, 0, 1] += turn
        gradient[:, 1, 0] -= turn
    area = weights * sides.area
    work = _summed(area, _along(stress[:, body.problem.voigt], normal), _along(gradient, normal))
    rate = _summed(area, loads, body.L @ loads) - work - work.T
    order, last = body.order, len(sides.nodes[0]) - 1
    stress = np.stack([_at(body, sides, fraction) for fraction in np.arange(last + 1) / last], axis=1)
    tractions = np.diff(_along(stress[:, :, body.problem.voigt], sides.normals), n=order, axis=1)[:, 0]
    imposed = np.einsum("cdk,fpd->fpck", macroscopic, sides.points)
    u = np.diff(body.u[body.node_class[sides.nodes]] + imposed, n=order, axis=1)[:, 0]
    interpolation = _summed(weights * h[:, 0] / (12 if order == 1 else 60), tractions, u)
    return -np.asarray(rate + interpolation + interpolation.T)


def _at(body: RecoveredStress, sides: ArcSides, fraction: float) -> Float:
    """Evaluate the recovered stresses (f, m, k) at a length fraction along every side."""
    result = np.empty((len(sides.element), body.problem.strains, body.loads.shape[1]))
    for k in range(3):
        members = np.flatnonzero(sides.side == k)
        lam = np.roll([[1 - fraction, fraction, 0.0]], k, axis=1)
        result[members] = body.recovered(sides.element[members], lam)[:, 0]
    return result


def _along(tensors: Float, vectors: Float) -> Float:
    """Multiply tensors (.., c, 2, k) by vectors (.., 2), and return the products (.., c, k)."""
    x, y = vectors[..., None, 0, None], vectors[..., None, 1, None]
    return np.asarray(tensors[..., 0, :] * x + tensors[..., 1, :] * y)


def _summed(weights: Float, left: Float, right: Float) -> Float:
    """Sum the weighted products w_f left_f^T right_f (k, k) over f, for factors (f, c, k)."""
    k = left.shape[2]
    return np.asarray((left * weights[:, None, None]).reshape(-1, k).T @ right.reshape(-1, k))


def _cross(a: Float, b: Float) -> Float:
    """Compute the cross products a x b (f,) of plane vectors (f, 2)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
