"""A virtual extension of the crack at the tip of a debonded arc, and what it releases.

The nodes around the tip turn about the centre of the fibre by s q, and their displacements with them; q is 1 near the
tip and falls to 0 farther away.  That moves the tip along the interface by s R and leaves bonded nodes bonded and gaps
as they are.  So it is an admissible variation of the equilibrium, whose energy changes as that of the elements does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from feti_homog.fem.virtual_extension import energy_change
from feti_homog.fem.void_boundary import nodes_along
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.typing import Float, Int

QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
# Radius around a tip beyond which nothing turns / distance to what must not turn, and at most / a period of the cell;
# radius within which all turns alike / that one.
REACH, REACH_OF_A_PERIOD, CORE = 0.8, 0.32, 0.5
# Relative distance from a circle beyond which a node of the same fibre is on another image of it.
OFF_CIRCLE = 1e-4


class CrackExtension:
    """The elements of a rank, from which the energy of a crack's extension is summed."""

    def __init__(self, subdomains: Sequence[Subdomain], matrix: str, period: Float) -> None:
        """`matrix` is the name of its phase, `period` (2,) that of the cell."""
        self._matrix, self._period = matrix, period
        self._bodies = [_Elements(s, period) for s in subdomains]

    def energy_changes(self, fibre: Int, tips: Float, spokes: Float, reach: Float, u: Float, E: Float) -> Float:
        """(t,) changes of this rank's energy when the crack at each tip turns by a unit angle.

        Args:
            fibre: (t,) constituents at whose interface the tips are.
            tips, spokes: (t, 2) their places, and those from the centres of their circles.
            reach: (t,) beyond it nothing turns; only the fibre and the matrix are within it.
            u: (dofs of this rank,) u*.
            E: (2, 2) macroscopic strain.
        """
        change, first = np.zeros(len(fibre)), 0
        for body in self._bodies:
            submesh, last = body.subdomain.submesh, first + body.subdomain.n_dofs
            own = u[first:last].reshape(-1, 2)[body.subdomain.mesh.node_class]
            first = last
            for t in np.flatnonzero((submesh.phase == self._matrix) | (fibre == submesh.body)):
                change[t] += body.energy_change(tips[t], spokes[t], reach[t], own, E)
        return change


class _Elements:
    """The elements of a subdomain, found around points."""

    def __init__(self, subdomain: Subdomain, period: Float) -> None:
        mesh = subdomain.mesh
        self.subdomain, self.period = subdomain, period
        self._tree = cKDTree(wrapped(mesh.points, period), boxsize=period)
        elements = np.repeat(np.arange(len(mesh.triangles)), mesh.triangles.shape[1])
        entries = np.ones(len(elements), np.int8), (mesh.triangles.ravel(), elements)
        self._elements_of = csr_matrix(entries, shape=(len(mesh.points), len(mesh.triangles)))

    def energy_change(self, tip: Float, spoke: Float, reach: float, u: Float, E: Float) -> float:
        """The same of these elements and one tip; u (plane nodes, 2)."""
        near = self._tree.query_ball_point(wrapped(tip, self.period), reach)
        if not near:
            return 0.0
        mesh = self.subdomain.mesh
        nodes = mesh.triangles[np.unique(self._elements_of[near].indices)]
        points = mesh.points[nodes]
        away = nearest_image(points - tip, self.period)
        # An element lies as one, at the image of its node that is nearest to the tip.
        nearest = np.argmin((away**2).sum(axis=2), axis=1)[:, None, None]
        away = points + np.take_along_axis(away - points, nearest, axis=1)
        share = np.clip((reach - np.linalg.norm(away, axis=2)) / (reach * (1 - CORE)), 0.0, 1.0)[..., None]
        total = u[nodes] + away @ E
        moved, changed = share * ((away + spoke) @ QUARTER_TURN.T), share * (total @ QUARTER_TURN.T)
        return energy_change(points, total, self.subdomain.L[:3, :3], moved, changed)


def obstacles(subdomains: Sequence[Subdomain], matrix: str, debonding: Int) -> Float:
    """(k, 2) nodes that no extension of a crack may move: of this rank's subdomains those at voids, and the boundaries
    of those that neither are the matrix nor of the constituents `debonding` from it, as fibres within coatings."""
    points = [np.zeros((0, 2))]
    for own in subdomains:
        submesh, edges = own.submesh, own.submesh.at_void
        if submesh.phase != matrix and submesh.body not in debonding:
            edges = edges | (np.bincount(submesh.edge_class[submesh.triangle_edges].ravel()) == 1)
        points.append(own.mesh.points[np.unique(nodes_along(submesh, own.mesh, edges))])
    return np.concatenate(points)


def reach_of_tips(
    tips: Int, spokes: Float, radius: Float, points: Float, fibre: Int, tree: cKDTree, fixed: Float, period: Float
) -> Float:
    """(t,) radius around each tip in which its crack may be extended: no other tip, nothing fixed, no other circle and
    no other image of its own is there.

    Args:
        tips: (t,) the interface nodes that are tips.
        spokes, radius: (t, 2) and (t,) from the centres of their circles to the tips.
        points, fibre: (n, 2) and (n,) of all interface nodes; `tree` of the points on the torus.
        fixed: (k, 2) the `obstacles` of all ranks.
    """
    reach = np.minimum(radius, REACH_OF_A_PERIOD / REACH * period.min())
    near = tree.query_ball_point(wrapped(points[tips], period), reach)
    for t, others in enumerate(near):
        away = nearest_image(points[others] - points[tips[t]], period)
        off_circle = np.abs(np.linalg.norm(away + spokes[t], axis=1) / radius[t] - 1) > OFF_CIRCLE
        is_tip = np.isin(others, np.delete(tips, t))
        limits = off_circle | is_tip | (fibre[others] != fibre[tips[t]])
        reach[t] = min(reach[t], np.linalg.norm(away[limits], axis=1).min(initial=np.inf))
    if len(fixed):
        distance, _ = cKDTree(wrapped(fixed, period), boxsize=period).query(wrapped(points[tips], period))
        reach = np.minimum(reach, distance)
    return REACH * reach


def wrapped(points: Float, period: Float) -> Float:
    """Positions (..., 2) on the torus, in [0, period)."""
    inside = points % period
    return np.where(inside >= period, 0.0, inside)


def nearest_image(offset: Float, period: Float) -> Float:
    """The shortest images of offsets (..., 2)."""
    return np.asarray(offset - np.round(offset / period) * period)
