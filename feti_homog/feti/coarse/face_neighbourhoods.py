"""Rings: what surrounds the faces of a body too large to be examined as one.

For displacements p of a face the energy of the body is at least that of the ring around it, whatever else moves:

    min { x^T S x : x = p on the face } >= p^T S_ring p.

So displacements that are soft in the body, x, are soft in some ring, on its face; there may be more of these.  With
all but the face held, the ring is stiffer than the body:  S restricted to the face <= S_clamped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from feti_homog.cell.periodic_topology import components, edge_pairs
from feti_homog.cell.submesh import part
from feti_homog.feti.coarse.trace_spaces import trace
from feti_homog.feti.decomposition.subdomain import Subdomain, both_directions
from feti_homog.feti.operators.explicit import ExplicitInterfaceOperator, schur_complement
from feti_homog.typing import Bool, Float, Int

# Coarse triangles from the face to the far side of its ring.
LAYERS = 2
# Nodes that hold a ring; a face with fewer can do little but move as one.
FEWEST = 2


@dataclass(frozen=True)
class Ring:
    """The neighbourhood of a face in its body, as a subdomain of its own, condensed to the face's n dofs.

    Attributes:
        at: (n,) positions of these dofs among the boundary dofs of the body.
        operator: its dense boundary operators.
        R: (n, k) its kernel on the face.
        P: (n, m) its trace space.
        clamped: (n, n) stiffness of the face if other faces, and what is outside the ring, are held.
    """

    at: Int
    operator: ExplicitInterfaceOperator
    R: Float
    P: csr_matrix
    clamped: Float


def rings(body: Subdomain, dofs: Int, face: Int) -> list[Ring]:
    """The rings around a face, one for each connected part of its neighbourhood that has enough of it.

    Args:
        dofs: (n,) boundary dofs of the body, sorted.
        face: positions among `dofs` of the face's, both directions of each node.
    """
    on_face = np.zeros(body.mesh.n_classes, bool)
    on_face[dofs[face] // 2] = True
    others = np.zeros_like(on_face)
    others[dofs // 2] = ~on_face[dofs // 2]
    near = _near(body, on_face)
    edges = body.submesh.edge_class[body.submesh.triangle_edges[near]]
    label = components(len(near), *edge_pairs(edges))
    found = []
    for k in range(label.max() + 1):
        ring = _ring(body, dofs, near[label == k], on_face, others)
        found += [ring] if ring else []
    return found


def _ring(body: Subdomain, dofs: Int, members: Int, on_face: Bool, others: Bool) -> Ring | None:
    """That of the coarse triangles `members`, if it has enough of the face."""
    outside = np.zeros_like(on_face)
    outside[body.mesh.node_class[np.delete(body.mesh.nodes, members, axis=0)]] = True
    ring = Subdomain.build(part(body.submesh, members), body.mesh.lattice, body.L)
    of_body = np.empty(ring.mesh.n_classes, np.int64)
    of_body[ring.mesh.node_class[ring.mesh.nodes]] = body.mesh.node_class[body.mesh.nodes[members]]
    nodes = np.flatnonzero(on_face[of_body])
    if len(nodes) < FEWEST:
        return None
    own, at = both_directions(nodes), np.searchsorted(dofs, both_directions(of_body[nodes]))
    free = both_directions(np.flatnonzero(on_face[of_body] | ~(outside | others)[of_body]))
    K = ring.take_stiffness()
    clamped = schur_complement(K[free][:, free].tocsr(), np.searchsorted(free, own))
    P = trace(ring.submesh, ring.mesh.lattice, nodes)
    return Ring(at, ExplicitInterfaceOperator(ring, K, own), ring.R[own], P, clamped)


def _near(body: Subdomain, on_face: Bool) -> Int:
    """Coarse triangles within LAYERS of the marked nodes."""
    classes = body.mesh.node_class[body.mesh.nodes]
    near = on_face[classes].any(axis=1)
    for _ in range(LAYERS - 1):
        corners = np.zeros(len(on_face), bool)
        corners[classes[near, :3]] = True
        near |= corners[classes[:, :3]].any(axis=1)
    return np.flatnonzero(near)
