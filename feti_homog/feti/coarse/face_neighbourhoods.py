"""Face neighbourhoods of large bodies, and trace spaces of piecewise linear displacements.

Under displacements p of a face, triangles near the face, its neighbourhood N, store no more energy than the body:

    min { x^T S x : x = p on the face } >= p^T S_N p.

So every soft displacement of the body is soft in the neighbourhood too; the converse need not hold.  Fixing the other
faces and all nodes outside the neighbourhood stiffens the face: S restricted to the face <= S_fixed.

Refinement hardly changes the soft modes of a subdomain.  So the search uses the coarsest trace space with enough dofs:
displacements P q, interpolated from values q at the coarse vertices and at every k-th node along coarse edges; where
edges have no nodes inside, from every second coarse vertex.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags, identity, kron
from scipy.sparse.csgraph import connected_components, dijkstra

from feti_homog.fem import Problem
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.linalg.dense_matrices import schur_complement
from feti_homog.feti.operators.one_subdomain import ExplicitInterfaceOperator
from feti_homog.feti.thresholds import DEFAULTS, Thresholds
from feti_homog.mesh import ReferenceLattice, Submesh, periodic_topology, submeshes
from feti_homog.typing import Float, Int


def trace_space(
    submesh: Submesh, lattice: ReferenceLattice, problem: Problem, nodes: Int, min_dofs: int = DEFAULTS.min_trace_dofs
) -> csr_matrix:
    """Build the prolongation P (c n, c m) of the trace space, from m to n boundary nodes.

    `nodes` (n,) are sorted node classes of the refined piece, with c components; c m >= min(c n, `min_dofs`).  Edge
    ends that are not boundary nodes have zero displacement.
    """
    vertices, inner, c = len(submesh.class_keys), lattice.intervals - 1, problem.components
    if not inner:
        if c * len(nodes) < 2 * min_dofs:
            return identity(c * len(nodes), format="csr")
        one_sided = np.bincount(submesh.edge_class[submesh.triangle_edges].ravel()) == 1
        ends = submesh.vertex_class[submesh.edges[one_sided[submesh.edge_class]]]
        pairs = np.searchsorted(nodes, ends[np.isin(ends, nodes).all(axis=1)].T)
        return _every_second(len(nodes), c, pairs.astype(np.int64).tobytes())
    position = np.where(nodes >= vertices, (nodes - vertices) % inner + 1, 0)
    k = 1
    while lattice.intervals % (2 * k) == 0 and c * np.count_nonzero(position % (2 * k) == 0) >= min_dofs:
        k *= 2
    keep = position % k == 0
    m = int(keep.sum())
    number = np.full(vertices + len(submesh.edge_keys) * inner, -1)
    number[nodes[keep]] = np.arange(m)
    between = np.flatnonzero(~keep)
    edge, lower = (nodes[between] - vertices) // inner, position[between] // k * k
    ends = np.empty((len(submesh.edge_keys), 2), np.int64)
    ends[submesh.edge_class] = submesh.vertex_class[submesh.edges]
    first = vertices + edge * inner - 1
    lower_node = np.where(lower == 0, ends[edge, 0], first + lower)
    upper_node = np.where(lower + k == lattice.intervals, ends[edge, 1], first + lower + k)
    weight = (position[between] - lower) / k
    rows = np.concatenate([np.flatnonzero(keep), between, between])
    columns = np.concatenate([np.arange(m), number[lower_node], number[upper_node]])
    values = np.concatenate([np.ones(m), 1 - weight, weight])
    is_free = columns >= 0
    rows, columns, values = rows[is_free], columns[is_free], values[is_free]
    entries = np.repeat(values, c), (problem.dofs(rows), problem.dofs(columns))
    return csr_matrix(entries, shape=(c * len(nodes), c * m))


@lru_cache(maxsize=16)
def _every_second(n: int, c: int, pairs: bytes) -> csr_matrix:
    """Build the prolongation (c n, c m) from every second boundary vertex; `pairs` (2, e) are the ends of edges.

    Results stay in a cache, because the pieces of a label image have few different boundaries.
    """
    rows, columns = np.frombuffer(pairs, np.int64).reshape(2, -1)
    beside = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n)).tocsr()
    beside += beside.T
    start = np.unique(connected_components(beside, directed=False)[1], return_index=True)[1]
    is_odd = dijkstra(beside, indices=start, unweighted=True, min_only=True) % 2 == 1
    # Ends and forks of lines remain, and adjacent nodes at odd distances, which a closed line of odd length has.
    between = is_odd & (np.diff(beside.indptr) == 2) & (beside @ is_odd == 0)
    return kron((diags(1.0 - between) + diags(between / 2) @ beside).tocsr()[:, ~between], identity(c)).tocsr()


@dataclass(frozen=True)
class FaceNeighbourhood:
    """A face neighbourhood as a subdomain, condensed to the n face dofs.

    Attributes:
        at: (n,) positions of the face dofs among the boundary dofs of the body.
        operator: dense boundary operators of the neighbourhood.
        R: (n, k) kernel on the face.
        P: (n, m) prolongation from the trace space.
        S_fixed: (n, n) stiffness of the face while the other faces and all nodes outside the neighbourhood are fixed.
    """

    at: Int
    operator: ExplicitInterfaceOperator
    R: Float
    P: csr_matrix
    S_fixed: Float


def face_neighbourhoods(
    body: Subdomain, dofs: Int, face: Int, thresholds: Thresholds = DEFAULTS
) -> list[FaceNeighbourhood]:
    """Build the neighbourhoods of a face: connected triangles within `face_layers` layers.

    A neighbourhood with a single face node is skipped.  Raises MeshError like `Subdomain.build`.

    Args:
        dofs: (n,) boundary dofs of the body, sorted.
        face: positions of the face dofs among `dofs`, node by node.
    """
    on_face = np.zeros(body.mesh.n_classes, bool)
    nodes = body.problem.nodes(dofs)
    on_face[nodes[face]] = True
    on_others = np.zeros_like(on_face)
    on_others[nodes] = ~on_face[nodes]
    classes = body.mesh.node_class[body.mesh.nodes]
    is_near = on_face[classes].any(axis=1)
    for _ in range(thresholds.face_layers - 1):
        corners = np.zeros(len(on_face), bool)
        corners[classes[is_near, :3]] = True
        is_near |= corners[classes[:, :3]].any(axis=1)
    triangles = np.flatnonzero(is_near)
    edges = body.submesh.edge_class[body.submesh.triangle_edges[triangles]]
    label = periodic_topology.components(len(triangles), *periodic_topology.edge_pairs(edges))
    neighbourhoods, lattice, problem = [], body.mesh.lattice, body.problem
    for k in range(label.max() + 1):
        members = triangles[label == k]
        outside = np.zeros_like(on_face)
        outside[np.delete(classes, members, axis=0)] = True
        piece = submeshes.part(body.submesh, members)
        subdomain = Subdomain.build(piece, lattice, body.L, problem, is_thin=body.is_thin, mixed=body.mixed)
        of_body = np.empty(subdomain.mesh.n_classes, np.int64)
        of_body[subdomain.mesh.node_class[subdomain.mesh.nodes]] = classes[members]
        face_nodes = np.flatnonzero(on_face[of_body])
        if len(face_nodes) < 2:  # a single node can only translate, and has no soft mode
            continue
        face_dofs = problem.dofs(face_nodes)
        movable = problem.dofs(np.flatnonzero(on_face[of_body] | ~(outside | on_others)[of_body]))
        K = subdomain.take_stiffness()
        S_fixed = schur_complement(K[movable][:, movable].tocsr(), np.searchsorted(movable, face_dofs))
        P = trace_space(piece, lattice, problem, face_nodes, thresholds.min_trace_dofs)
        operator = ExplicitInterfaceOperator(subdomain, K, face_dofs)
        at = np.searchsorted(dofs, problem.dofs(of_body[face_nodes]))
        neighbourhoods.append(FaceNeighbourhood(at, operator, subdomain.R[face_dofs], P, S_fixed))
    return neighbourhoods
