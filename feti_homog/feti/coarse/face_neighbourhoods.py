"""The neighbourhoods of the faces of a body whose boundary is too long for one dense eigenproblem.

For displacements p of a face the energy of the body is at least that of the neighbourhood N of the face, whatever else
moves:

    min { x^T S x : x = p on the face } >= p^T S_N p.

So displacements that are soft in the body, x, are soft in some neighbourhood, on its face; there may be more of these.
With all but the face held fixed, the neighbourhood is stiffer than the body:  S restricted to the face <= S_fixed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from feti_homog.feti.coarse.trace_spaces import trace_space
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.linalg.schur_complement import schur_complement
from feti_homog.feti.operators.explicit import ExplicitInterfaceOperator
from feti_homog.feti.thresholds import DEFAULTS, MIN_FACE_NODES, Thresholds
from feti_homog.mesh.periodic_topology import components, edge_pairs
from feti_homog.mesh.submesh import part
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class FaceNeighbourhood:
    """The neighbourhood of a face in its body, as a subdomain of its own, condensed to the face's n dofs.

    Attributes:
        at: (n,) positions of these dofs among the boundary dofs of the body.
        operator: its dense boundary operators.
        R: (n, k) its kernel on the face.
        P: (n, m) its trace space.
        S_fixed: (n, n) stiffness of the face if other faces, and what is outside the neighbourhood, are held fixed.
    """

    at: Int
    operator: ExplicitInterfaceOperator
    R: Float
    P: csr_matrix
    S_fixed: Float


def face_neighbourhoods(
    body: Subdomain, dofs: Int, face: Int, thresholds: Thresholds = DEFAULTS
) -> list[FaceNeighbourhood]:
    """Return the neighbourhoods of a face: one for each connected part of what is near it and has enough of its
    nodes.

    Args:
        dofs: (n,) boundary dofs of the body, sorted.
        face: positions among `dofs` of the face's, all of each node.
    """
    on_face = np.zeros(body.mesh.n_classes, bool)
    nodes = body.problem.nodes(dofs)
    on_face[nodes[face]] = True
    on_others = np.zeros_like(on_face)
    on_others[nodes] = ~on_face[nodes]
    near = _near(body, on_face, thresholds.face_layers)
    edges = body.submesh.edge_class[body.submesh.triangle_edges[near]]
    label = components(len(near), *edge_pairs(edges))
    found = (
        _neighbourhood(body, dofs, near[label == k], on_face, on_others, thresholds.min_trace_dofs)
        for k in range(label.max() + 1)
    )
    return [neighbourhood for neighbourhood in found if neighbourhood is not None]


def _neighbourhood(
    body: Subdomain, dofs: Int, triangles: Int, on_face: Bool, on_others: Bool, min_trace_dofs: int
) -> FaceNeighbourhood | None:
    """Return the neighbourhood of some coarse triangles if it has enough of the face."""
    outside = np.zeros_like(on_face)
    outside[body.mesh.node_class[np.delete(body.mesh.nodes, triangles, axis=0)]] = True
    piece = part(body.submesh, triangles)
    own = Subdomain.build(piece, body.mesh.lattice, body.L, body.problem, is_thin=body.is_thin)
    of_body = np.empty(own.mesh.n_classes, np.int64)
    of_body[own.mesh.node_class[own.mesh.nodes]] = body.mesh.node_class[body.mesh.nodes[triangles]]
    nodes = np.flatnonzero(on_face[of_body])
    if len(nodes) < MIN_FACE_NODES:
        return None
    all_of = body.problem.dofs
    face, at = all_of(nodes), np.searchsorted(dofs, all_of(of_body[nodes]))
    movable = all_of(np.flatnonzero(on_face[of_body] | ~(outside | on_others)[of_body]))
    K = own.take_stiffness()
    S_fixed = schur_complement(K[movable][:, movable].tocsr(), np.searchsorted(movable, face))
    P = trace_space(own.submesh, own.mesh.lattice, own.problem, nodes, min_trace_dofs)
    return FaceNeighbourhood(at, ExplicitInterfaceOperator(own, K, face), own.R[face], P, S_fixed)


def _near(body: Subdomain, on_face: Bool, layers: int) -> Int:
    """Coarse triangles within so many layers of the marked nodes."""
    classes = body.mesh.node_class[body.mesh.nodes]
    near = on_face[classes].any(axis=1)
    for _ in range(layers - 1):
        corners = np.zeros(len(on_face), bool)
        corners[classes[near, :3]] = True
        near |= corners[classes[:, :3]].any(axis=1)
    return np.flatnonzero(near)
