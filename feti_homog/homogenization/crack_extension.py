"""Virtual crack extension at a debonded arc's tip, and the energy that it releases.

The nodes around the tip turn about the fibre centre by s q, and their displacements with them; q is 1 near the
tip and falls to 0 farther away.  The tip moves along the interface by s R, bonded nodes stay bonded, and gaps stay as
they are: an admissible variation of the equilibrium, whose energy changes with the element energies.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from feti_homog.fem.assembly import nodes_along
from feti_homog.fem.point_fields import energy_change
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.typing import Float, Int

Array = TypeVar("Array", Float, Int)

QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
# Radius around a tip beyond which nothing turns / distance to boundaries, and at most / a period of the cell; radius
# within which all turns alike / this radius.
REACH, REACH_OF_A_PERIOD, CORE = 0.8, 0.32, 0.5
# Relative distance from a circle beyond which a node of the same bodies is on another boundary or image of them.
OFF_CIRCLE = 1e-4
VOID = -1


class CrackExtension:
    """Subdomain elements, found around points, from which a crack extension's energy is summed."""

    def __init__(self, subdomain: Subdomain, period: Float) -> None:
        """Find the elements around points; the cell has `period` (2,)."""
        mesh = subdomain.mesh
        self.subdomain, self._period = subdomain, period
        self._tree = cKDTree(wrapped(mesh.points, period), boxsize=period)
        elements = np.repeat(np.arange(len(mesh.triangles)), mesh.triangles.shape[1])
        entries = np.ones(len(elements), np.int8), (mesh.triangles.ravel(), elements)
        self._elements_of = csr_matrix(entries, shape=(len(mesh.points), len(mesh.triangles)))

    def energy_change(self, tip: Float, spoke: Float, reach: float, u: Float, E: Float) -> float:
        """Return the energy change when a tip's crack turns by a unit angle.

        Args:
            tip, spoke: (2,) place, and place relative to the circle centre.
            reach: distance beyond which nothing turns.
            u: (dofs,) u*.
            E: (2, 2) macroscopic strain.
        """
        inside = self._tree.query_ball_point(wrapped(tip, self._period), reach)
        if not inside:
            return 0.0
        mesh = self.subdomain.mesh
        nodes = mesh.triangles[np.unique(self._elements_of[inside].indices)]
        points = mesh.points[nodes]
        away = nearest_image(points - tip, self._period)
        # An element moves as one to the image of its node that is nearest to the tip.
        nearest = np.argmin((away**2).sum(axis=2), axis=1)[:, None, None]
        away = points + np.take_along_axis(away - points, nearest, axis=1)
        share = np.clip((reach - np.linalg.norm(away, axis=2)) / (reach * (1 - CORE)), 0.0, 1.0)[..., None]
        total = u.reshape(-1, 2)[mesh.node_class[nodes]] + away @ E
        moved, changed = share * ((away + spoke) @ QUARTER_TURN.T), share * (total @ QUARTER_TURN.T)
        return energy_change(points, total, self.subdomain.L[:3, :3], moved, changed, self.subdomain.is_mixed)


def body_boundaries(comm: MPI.Comm, subdomains: Sequence[Subdomain]) -> tuple[Float, Int]:
    """(k, 2) nodes on body boundaries, from all ranks, and (k,) their bodies; VOID at voids.  Collective.

    Each body has its own nodes where two bodies meet.  Cuts between a body's pieces are no boundaries.
    """
    borders = [np.bincount(s.submesh.edge_class[s.submesh.triangle_edges].ravel()) == 1 for s in subdomains]
    rows = []
    for s, border in zip(subdomains, borders, strict=True):
        key = s.submesh.edge_keys[border]
        rows.append(np.column_stack([key, np.full(len(key), s.submesh.body)]))
    edges, pieces = np.unique(_of_all(comm, rows, np.zeros((0, 2), np.int64)), axis=0, return_counts=True)
    cuts, points, body = edges[pieces > 1], [], []
    for s, border in zip(subdomains, borders, strict=True):
        cut = np.isin(s.submesh.edge_keys, cuts[cuts[:, 1] == s.submesh.body, 0])
        for edge, name in ((border & ~cut & ~s.submesh.at_void, s.submesh.body), (s.submesh.at_void, VOID)):
            points.append(s.mesh.points[np.unique(nodes_along(s.submesh, s.mesh, edge))])
            body.append(np.full(len(points[-1]), name))
    return _of_all(comm, points, np.zeros((0, 2))), _of_all(comm, body, np.zeros(0, np.int64))


def _of_all(comm: MPI.Comm, rows: list[Array], none: Array) -> Array:
    """Gather the rows from all ranks; `none` has no rows.  Collective."""
    joined: Array = np.concatenate(comm.allgather(np.concatenate([none, *rows])))
    return joined


def reach_of_tips(tips: Float, spokes: Float, bodies: Int, boundaries: tuple[Float, Int], period: Float) -> Float:
    """(t,) radius around each tip in which its crack may be extended.

    No other tip lies within it, and no boundary but the tip's circle.

    Args:
        tips, spokes: (t, 2) places, and places relative to their circle centres.
        bodies: (t, 2) constituents on both sides at each tip.
        boundaries: nodes and bodies from `body_boundaries`.
    """
    radius, (points, body) = np.linalg.norm(spokes, axis=1), boundaries
    reach = np.minimum(radius, REACH_OF_A_PERIOD / REACH * period.min())
    places = wrapped(tips, period)
    if len(tips) > 1:
        nearest, _ = cKDTree(places, boxsize=period).query(places, 2)
        reach = np.minimum(reach, nearest[:, 1])
    inside = cKDTree(wrapped(points, period), boxsize=period).query_ball_point(places, reach)
    for t, nodes in enumerate(inside):
        away = nearest_image(points[nodes] - tips[t], period)
        off_circle = np.abs(np.linalg.norm(away + spokes[t], axis=1) / radius[t] - 1) > OFF_CIRCLE
        limits = off_circle | ~np.isin(body[nodes], bodies[t])
        reach[t] = min(reach[t], np.linalg.norm(away[limits], axis=1).min(initial=np.inf))
    return np.asarray(REACH * reach)


def wrapped(points: Float, period: Float) -> Float:
    """Positions (..., 2) on the torus, in [0, period)."""
    inside = points % period
    return np.where(inside >= period, 0.0, inside)


def nearest_image(offset: Float, period: Float) -> Float:
    """Shift offsets (..., 2) to their shortest images."""
    return np.asarray(offset - np.round(offset / period) * period)
