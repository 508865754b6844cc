"""Assembly in one subdomain: stiffness, unit strain loads, averages, integrals along voids.

Engineering shears; degrees of freedom are (node, displacement), node-major.  Elements
are summed triangle by coarse triangle first: a refined one is an element of its own, `MacroElement`, and affine ones
share its integrals.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse import bsr_matrix, csc_matrix, csr_matrix

from feti_homog.fem import bubble
from feti_homog.fem.problem import PLANE, Problem
from feti_homog.fem.shape_functions import gradients
from feti_homog.mesh import FineMesh, ReferenceLattice, Submesh
from feti_homog.typing import Bool, Float, Int, Int32

# Elements that are integrated at once: bounds the memory of their gradients, about 100 MB of quadratic ones.
ELEMENTS_AT_ONCE = 1 << 16
# int N_i dN_j along a side with two nodes, and along a side with a third node in the middle.
LINEAR = np.array([[-0.5, 0.5], [-0.5, 0.5]])
QUADRATIC = np.array([[-3.0, 4.0, -1.0], [-4.0, 0.0, 4.0], [1.0, -4.0, 3.0]]) / 6
Mixed = bool | tuple[bool, ...]


@dataclass(frozen=True)
class Assembly:
    """The matrices of a subdomain with area |Omega| and materials L.

    Attributes:
        K: (dofs, dofs) stiffness, Eq. (28), force per length.
        Q: (dofs, v) int B^T L, so that the macroscopic strain E has the load f = -Q E, Eq. (29), and the
            stress integral is |Omega| L E + Q^T u*.
        slopes: (classes, 2) int dN/dx.
        areas: (materials,) areas of the materials, with the sum |Omega|.
    """

    K: csr_matrix
    Q: Float
    slopes: Float
    areas: Float


def assemble(
    mesh: FineMesh, laws: Float, problem: Problem = PLANE, mixed: Mixed = False, material: Int | None = None
) -> Assembly:
    """Assemble a subdomain with one material stiffness L (v, v) or with several.

    The first rows and columns of L belong to displacement strains, the last to uniform strains.  Quadratic elements
    with isotropic stiffness in the plane may be mixed: with a bubble and a pressure (`fem.bubble`).

    Args:
        laws: L (v, v), or (materials, v, v) with each coarse triangle's `material` (t,).
        mixed: whether elements are mixed, or whether each material has mixed ones.
    """
    macro, c = MacroElement.of(mesh.lattice), problem.components
    classes, n = mesh.node_class[mesh.nodes], mesh.n_classes
    couples, loads = np.empty((len(mesh.nodes), len(macro.rows), c * c)), np.empty((*mesh.nodes.shape, 2))
    stiffnesses = laws.reshape(-1, *laws.shape[-2:])
    Q, slopes, areas = np.zeros((c * n, laws.shape[-1])), np.zeros((n, 2)), np.zeros(len(stiffnesses))
    for number, (L, is_mixed) in enumerate(zip(stiffnesses, np.broadcast_to(mixed, len(stiffnesses)), strict=True)):
        members = np.ones(len(mesh.nodes), bool) if material is None else material == number
        # Turns int dN_a/dx_k dN_b/dx_l into K_(a i)(b j), with (k, l) and (i, j) flat.
        tensor = L[problem.voigt[:, :, None, None], problem.voigt].transpose(1, 3, 0, 2).reshape(4, c * c)
        for kind, integrate in ((members & ~mesh.curved, _affine), (members & mesh.curved, _curved)):
            for part in _chunks(np.flatnonzero(kind), ELEMENTS_AT_ONCE // len(mesh.lattice.triangles)):
                couples[part], loads[part], area = integrate(macro, mesh, part, tensor, L if is_mixed else None)
                areas[number] += area
        nodes = classes[members].ravel()
        slope = np.stack([np.bincount(nodes, loads[members, :, k].ravel(), n) for k in range(2)], axis=1)
        # sum_k int dN/dx_k L[(i,k), :]
        Q += (slope @ np.concatenate(L[problem.voigt], axis=1)).reshape(Q.shape)
        slopes += slope
    # K sums the couples (t, p, c^2) between the classes `rows` and `columns` (t, p).
    rows, columns = classes[:, macro.rows], classes[:, macro.columns]
    by_row = csc_matrix((columns.ravel(), rows.ravel(), np.arange(rows.size + 1)), shape=(n, rows.size)).tocsr()
    places = csr_matrix((by_row.indices, by_row.data, by_row.indptr), shape=(n, n))
    places.sort_indices()
    is_first = np.diff(places.indices, prepend=-1) != 0
    is_first[places.indptr[:-1]] = True  # each class has couples
    first = np.flatnonzero(is_first)
    sums = csr_matrix((np.ones(rows.size), places.data, np.append(first, rows.size)), shape=(len(first), rows.size))
    blocks = (sums @ couples.reshape(rows.size, c * c)).reshape(-1, c, c)
    begin = np.searchsorted(first, places.indptr)
    K = bsr_matrix((blocks, places.indices[first], begin), shape=(c * n,) * 2).tocsr()
    return Assembly(K, Q, slopes, areas)


def element_strain(
    points: Float, triangles: Int32, node_class: Int32, u: Float, problem: Problem = PLANE
) -> tuple[Float, Float]:
    """Compute mean strains (e, m) of elements under displacements u (classes, c), and element areas (e,)."""
    strain, area = np.empty((len(triangles), problem.strains)), np.empty(len(triangles))
    parts_of = [np.nonzero(problem.voigt == number) for number in range(problem.strains)]
    for part in _chunks(np.arange(len(triangles)), ELEMENTS_AT_ONCE):
        g, w = gradients(points[triangles[part]])
        area[part] = w.sum(axis=1)
        mean = np.einsum("eqad,eq->ead", g, w) / area[part, None, None]
        gradient = np.einsum("eai,ead->eid", u[node_class[triangles[part]]], mean)
        strain[part] = np.stack([gradient[:, i, d].sum(axis=1) for i, d in parts_of], axis=1)
    return strain, area


def _chunks(numbers: Int, size: int) -> list[Int]:
    """Cut numbers into chunks that keep memory bounded."""
    return [numbers[first : first + max(size, 1)] for first in range(0, len(numbers), max(size, 1))]


def _affine(
    macro: MacroElement, mesh: FineMesh, part: Int, tensor: Float, mixed: Float | None
) -> tuple[Float, Float, float]:
    """Integrate affine coarse triangles on the unit triangle; `mixed` is the stiffness of mixed elements.

    Returns:
        Stiffness blocks (t, p, c^2) of the p coupled pairs of nodes, integrals (t, q, 2) of the shape function
        gradients, and the total area.
    """
    g, w = gradients(mesh.points[mesh.nodes[part, :3]])
    # The last two of the three linear functions are the reference coordinates: inverse_rk = dr_r / dx_k.
    inverse, determinant = g[:, 0, 1:], 2 * w[..., None]
    pulled = determinant * (np.einsum("trk,tsl->trskl", inverse, inverse).reshape(-1, 4, 4) @ tensor)
    products = macro.products
    if mixed is not None:
        products = np.concatenate([products, macro.hessians], axis=1)
        pulled = np.concatenate([pulled, bubble.affine_couples(mixed, inverse, determinant[:, 0, 0])], axis=1)
    return products @ pulled, macro.integrals @ (determinant * inverse), float(w.sum())


def _curved(
    macro: MacroElement, mesh: FineMesh, part: Int, tensor: Float, mixed: Float | None
) -> tuple[Float, Float, float]:
    """Integrate coarse triangles with curved edges, element by element; arguments as of `_affine`."""
    elements = mesh.lattice.triangles
    points = mesh.points[mesh.nodes[part][:, elements].reshape(-1, elements.shape[1])]
    g, w = gradients(points)
    if mixed is None:
        couples = macro.couples(products(g, w)) @ tensor
    else:
        couples = macro.couples(bubble.Elements.of(points, mixed).couples())
    return couples, macro.nodes(integrals(g, w)), float(w.sum())


@dataclass(frozen=True)
class GroupedSum:
    """Sums over element matrix entries that belong together in one coarse triangle.

    Attributes:
        entries: all entry numbers, flat, sum after sum.
        first: first position of each sum in `entries`.
    """

    entries: Int
    first: Int

    @classmethod
    def of(cls, target: Int) -> GroupedSum:
        """Group entries by `target`, the sum number of each entry."""
        entries = np.argsort(target, axis=None, kind="stable")
        return cls(entries, np.unique(target.ravel()[entries], return_index=True)[1])

    def __call__(self, values: Float) -> Float:
        """Sum the entries (.., k) of t coarse triangles: (t, sums, k)."""
        each = values.reshape(-1, len(self.entries), values.shape[-1])
        return np.add.reduceat(each[:, self.entries], self.first, axis=1)


@dataclass(frozen=True)
class MacroElement:
    """The lattice with q nodes as one element: p ordered pairs of nodes have a common element, and couple.

    Attributes:
        rows, columns: (p,) lattice nodes of each couple, in row-major order.
        couples: from the entries (4**refine, a, a) of the element matrices to the couples.
        nodes: from the nodes (4**refine, a) of the elements to the lattice nodes.
        products: (p, 4) int dN_A/dr_k dN_B/dr_l over the unit triangle, with (k, l) flat.
        hessians: (p, 9) products of second derivatives of the element functions, summed over elements (`fem.bubble`)
            if they are quadratic.
        integrals: (q, 2) int dN_A/dr_k over the unit triangle.
    """

    rows: Int
    columns: Int
    couples: GroupedSum
    nodes: GroupedSum
    products: Float
    hessians: Float
    integrals: Float

    @classmethod
    @lru_cache(maxsize=4)
    def of(cls, lattice: ReferenceLattice) -> MacroElement:
        """Build the element of a lattice."""
        elements, q = lattice.triangles, len(lattice.nodes)
        pair = elements[:, :, None] * q + elements[:, None, :]
        couples, nodes, each = GroupedSum.of(pair), GroupedSum.of(elements), np.unique(pair)
        g, w = gradients(lattice.nodes[elements][..., 1:] / lattice.intervals)
        second = np.einsum("ar,bs->abrs", bubble.HESSIANS, bubble.HESSIANS).reshape(-1, 9)
        # Two-dimensional stiffness does not change with the size: every element has that of the coarse triangle.
        of_all = np.tile(second, (len(elements), 1)) if lattice.order == 2 else np.zeros((pair.size, 9))
        return cls(
            each // q, each % q, couples, nodes, couples(products(g, w))[0], couples(of_all)[0],
            nodes(integrals(g, w))[0],
        )  # fmt: skip


def products(g: Float, w: Float) -> Float:
    """Integrate dN_a/dx_k dN_b/dx_l, (e, a, a, 4), from gradients (e, q, a, 2) and weights (e, q); (k, l) flat."""
    e, q, a, _ = g.shape
    flat = g.reshape(e, q, 2 * a)
    outer = np.matmul((flat * w[..., None]).transpose(0, 2, 1), flat)
    return np.asarray(outer.reshape(e, a, 2, a, 2).transpose(0, 1, 3, 2, 4).reshape(e, a, a, 4))


def integrals(g: Float, w: Float) -> Float:
    """Integrate dN_a/dx_k, (e, a, 2), from gradients (e, q, a, 2) and weights (e, q)."""
    integral: Float = np.einsum("eqak,eq->eak", g, w)
    return integral


def void_integrals(submesh: Submesh, mesh: FineMesh) -> Float:
    """Integrate N n ds along void sides, (classes, 2), n outward from the void; u^T times this is int grad u."""
    sums, nodes = np.zeros((mesh.n_classes, 2)), nodes_along(submesh, mesh, submesh.at_void)
    products = LINEAR if mesh.lattice.triangles.shape[1] == 3 else QUADRATIC
    step = len(products) - 1
    for first in range(0, nodes.shape[1] - 1, step):
        side = nodes[:, first : first + step + 1]
        # The body is on the left, the void on the right: n ds = (-dy, dx).
        tangent = np.einsum("ij,tjk->tik", products, mesh.points[side])
        for k, part in enumerate((-tangent[..., 1], tangent[..., 0])):
            sums[:, k] += np.bincount(mesh.node_class[side].ravel(), part.ravel(), mesh.n_classes)
    return sums


def nodes_along(submesh: Submesh, mesh: FineMesh, edges: Bool) -> Int:
    """Return the nodes (sides, M + 1) of triangle sides on marked torus `edges`, with the body on the left."""
    triangle, side = np.nonzero(edges[submesh.edge_class[submesh.triangle_edges]])
    lattice, sides = mesh.lattice.nodes, []
    for k in range(3):  # from vertex k to vertex k + 1
        nodes = np.flatnonzero(lattice[:, (k + 2) % 3] == 0)
        sides.append(nodes[np.argsort(lattice[nodes, (k + 1) % 3])])
    return np.take_along_axis(mesh.nodes[triangle].astype(np.int64), np.array(sides)[side], axis=1)
