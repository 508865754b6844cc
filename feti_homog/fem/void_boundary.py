"""Boundary integrals along the sides of a body that lie at a void, where nothing holds it."""

from __future__ import annotations

import numpy as np

from feti_homog.mesh.refinement import FineMesh, ReferenceLattice
from feti_homog.mesh.submesh import Submesh
from feti_homog.typing import Bool, Float, Int

# int N_i dN_j along a side: of two nodes, and of two and the one between them.
LINEAR = np.array([[-0.5, 0.5], [-0.5, 0.5]])
QUADRATIC = np.array([[-3.0, 4.0, -1.0], [-4.0, 0.0, 4.0], [1.0, -4.0, 3.0]]) / 6


def void_integrals(submesh: Submesh, mesh: FineMesh) -> Float:
    """(classes, 2) int N n ds along the sides at voids, n outward from the void: u^T of it is int grad u there."""
    sums, nodes = np.zeros((mesh.n_classes, 2)), nodes_along(submesh, mesh, submesh.at_void)
    products = LINEAR if mesh.lattice.triangles.shape[1] == 3 else QUADRATIC
    step = len(products) - 1
    for first in range(0, nodes.shape[1] - 1, step):
        own = nodes[:, first : first + step + 1]
        # The body is on the left, the void on the right: n ds = (-dy, dx).
        tangent = np.einsum("ij,tjk->tik", products, mesh.points[own])
        for k, part in enumerate((-tangent[..., 1], tangent[..., 0])):
            sums[:, k] += np.bincount(mesh.node_class[own].ravel(), part.ravel(), mesh.n_classes)
    return sums


def nodes_along(submesh: Submesh, mesh: FineMesh, edges: Bool) -> Int:
    """(sides, M + 1) the nodes of each side of a triangle on one of the marked torus `edges`, the body on the left."""
    triangle, side = np.nonzero(edges[submesh.edge_class[submesh.triangle_edges]])
    return np.take_along_axis(mesh.nodes[triangle].astype(np.int64), _sides(mesh.lattice)[side], axis=1)


def _sides(lattice: ReferenceLattice) -> Int:
    """(3, M + 1) lattice nodes on side k, from vertex k to vertex k + 1."""
    found = []
    for k in range(3):
        own = np.flatnonzero(lattice.nodes[:, (k + 2) % 3] == 0)
        found.append(own[np.argsort(lattice.nodes[own, (k + 1) % 3])])
    return np.array(found)
