"""Assemble the stiffness and the unit loads of a subdomain; compute element strains and integrals along edges.

Shears are engineering shears; degrees of freedom are numbered node by node.  The elements of a coarse triangle are
first summed into one `MacroElement`; all affine coarse triangles have the same reference integrals.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse import bsr_matrix, csc_matrix, csr_matrix

from feti_homog.fem.problem import PLANE, Problem
from feti_homog.fem.shape_functions import HESSIANS, MixedElements, affine_couples, gradients, slopes, strains
from feti_homog.mesh import FineMesh, ReferenceLattice, Submesh
from feti_homog.typing import Bool, Float, Int, Int32

# Number of elements in a chunk; the gradients of a quadratic chunk take about 100 MB.
ELEMENTS_AT_ONCE = 1 << 16
# int N_i dN_j along a side with two nodes, and along a side with a third node in the middle.
LINEAR = np.array([[-0.5, 0.5], [-0.5, 0.5]])
QUADRATIC = np.array([[-3.0, 4.0, -1.0], [-4.0, 0.0, 4.0], [1.0, -4.0, 3.0]]) / 6
Mixed = bool | tuple[bool, ...]


@dataclass(frozen=True)
class Assembly:
    """The assembled matrices of a subdomain with the area |Omega| and the material stiffnesses L.

    Attributes:
        K: (dofs, dofs) stiffness, Eq. (28), force per length.
        Q: (dofs, v) int B^T L, where B u* are the v strains of fluctuating displacements u*.  A macroscopic strain
            E (v,) has the load -Q E, Eq. (29), and the stress integral (int L) E + Q^T u*.
        slopes: (classes, 2) int dN/dx of the shape functions.
        areas: (materials,) areas of the materials; their sum is |Omega|.
    """

    K: csr_matrix
    Q: Float
    slopes: Float
    areas: Float


def assemble(
    mesh: FineMesh, laws: Float, problem: Problem = PLANE, mixed: Mixed = False, material: Int | None = None
) -> Assembly:
    """Assemble the matrices of a subdomain with one or several materials.

    The first rows and columns of L belong to displacement strains, the others to loads that are uniform in the cell.
    Quadratic elements with isotropic stiffness in the plane may be mixed: with bubble and pressure (`MixedElements`).

    Args:
        laws: stiffness L (v, v) or (materials, v, v); several need the `material` (t,) of every coarse triangle.
        mixed: whether the elements are mixed, for all materials or material by material.
    """
    macro, c = MacroElement.of(mesh.lattice), problem.components
    classes, n = mesh.node_class[mesh.nodes], mesh.n_classes
    couples = np.empty((len(mesh.nodes), len(macro.rows), c * c))
    loads = np.empty((*mesh.nodes.shape, 2))
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
    find = _pattern if len(classes) < ELEMENTS_AT_ONCE else _pattern.__wrapped__  # the cache keeps no large pattern
    sums, columns, begin = find(classes.tobytes(), n, mesh.lattice)
    blocks = (sums @ couples.reshape(-1, c * c)).reshape(-1, c, c)
    K = bsr_matrix((blocks, columns, begin), shape=(c * n,) * 2).tocsr()
    return Assembly(K, Q, slopes, areas)


@lru_cache(maxsize=16)  # pieces of a label image have few different classes
def _pattern(classes: bytes, n: int, lattice: ReferenceLattice) -> tuple[csr_matrix, Int32, Int]:
    """Find the pattern of K, (n, n) blocks, from the bytes `classes` of the node classes (t, q) of t coarse triangles.

    Returns a matrix (blocks, t p) that sums couples to blocks, the column of every block, and each row's first block.
    """
    of_triangle, macro = np.frombuffer(classes, np.int32).reshape(-1, len(lattice.nodes)), MacroElement.of(lattice)
    rows, columns = of_triangle[:, macro.rows], of_triangle[:, macro.columns]
    by_row = csc_matrix((columns.ravel(), rows.ravel(), np.arange(rows.size + 1)), shape=(n, rows.size)).tocsr()
    pattern = csr_matrix((by_row.indices, by_row.data, by_row.indptr), shape=(n, n))
    pattern.sort_indices()
    is_first = np.diff(pattern.indices, prepend=-1) != 0
    is_first[pattern.indptr[:-1]] = True  # every class has couples
    first = np.flatnonzero(is_first)
    sums = csr_matrix((np.ones(rows.size), pattern.data, np.append(first, rows.size)), shape=(len(first), rows.size))
    return sums, pattern.indices[first], np.searchsorted(first, pattern.indptr)


def element_strain(points: Float, triangles: Int32, u: Float, problem: Problem) -> Float:
    """Compute the mean strain (e, m) of every element under nodal displacements u (n, c)."""
    strain = np.empty((len(triangles), problem.strains))
    for part in _chunks(np.arange(len(triangles)), ELEMENTS_AT_ONCE):
        g, w = gradients(points[triangles[part]])
        mean = np.einsum("eqad,eq->ead", g, w) / w.sum(axis=1)[:, None, None]
        gradient = slopes(mean[:, None], u[triangles[part]][..., None])
        strain[part] = strains(gradient, problem)[:, 0, :, 0]
    return strain


def _chunks(numbers: Int, size: int) -> list[Int]:
    """Cut an array of numbers into chunks of at most `size` numbers."""
    return [numbers[first : first + max(size, 1)] for first in range(0, len(numbers), max(size, 1))]


def _affine(
    macro: MacroElement, mesh: FineMesh, part: Int, tensor: Float, mixed: Float | None
) -> tuple[Float, Float, float]:
    """Compute stiffness blocks and gradient integrals of the affine coarse triangles `part` (t,).

    `tensor` (4, c^2) turns int dN_a/dx_k dN_b/dx_l into K_(a i)(b j); `mixed` is the stiffness of mixed elements, or
    None.  Returns stiffness blocks (t, p, c^2) of the node couples, gradient integrals (t, q, 2) and the total area.
    """
    g, w = gradients(mesh.points[mesh.nodes[part, :3]])
    # The last two linear functions are the reference coordinates, so that inverse_rk = dr_r / dx_k.
    inverse, determinant = g[:, 0, 1:], 2 * w[..., None]
    pulled = np.einsum("trk,tsl->trskl", inverse, inverse).reshape(-1, 4) @ tensor
    pulled = determinant * pulled.reshape(-1, 4, tensor.shape[1])
    products = macro.products
    if mixed is not None:
        products = np.concatenate([products, macro.hessians], axis=1)
        pulled = np.concatenate([pulled, affine_couples(mixed, inverse, determinant[:, 0, 0])], axis=1)
    return products @ pulled, macro.integrals @ (determinant * inverse), float(w.sum())


def _curved(
    macro: MacroElement, mesh: FineMesh, part: Int, tensor: Float, mixed: Float | None
) -> tuple[Float, Float, float]:
    """Integrate coarse triangles with curved edges, element by element; arguments and results are as in `_affine`."""
    elements = mesh.lattice.triangles
    points = mesh.points[mesh.nodes[part][:, elements].reshape(-1, elements.shape[1])]
    g, w = gradients(points)
    if mixed is None:
        couples = macro.couples(products(g, w)) @ tensor
    else:
        couples = macro.couples(MixedElements.of(points, mixed).couples())
    return couples, macro.nodes(integrals(g, w)), float(w.sum())


@dataclass(frozen=True)
class GroupedSum:
    """A rule that sums groups of element entries in every coarse triangle.

    Attributes:
        entries: flat numbers of the entries in a coarse triangle, sorted by group.
        first: position in `entries` at which every group starts.
    """

    entries: Int
    first: Int

    @classmethod
    def of(cls, target: Int) -> GroupedSum:
        """Group element entries by `target`, the index of the sum that receives each entry."""
        entries = np.argsort(target, axis=None, kind="stable")
        return cls(entries, np.unique(target.ravel()[entries], return_index=True)[1])

    def __call__(self, values: Float) -> Float:
        """Sum the entries (.., k) of t coarse triangles, and return the sums (t, sums, k)."""
        by_triangle = values.reshape(-1, len(self.entries), values.shape[-1])
        return np.add.reduceat(by_triangle[:, self.entries], self.first, axis=1)


@dataclass(frozen=True)
class MacroElement:
    """A refined coarse triangle as one element; p ordered node pairs (couples) have an element in common.

    Attributes:
        rows, columns: (p,) lattice nodes of the couples, in row-major order.
        couples: rule that sums the entries (4**refine, a, a) of the element matrices to the couples.
        nodes: rule that sums the values at the element nodes (4**refine, a) to the q lattice nodes.
        products: (p, 4) int dN_A/dr_k dN_B/dr_l over the unit triangle, with (k, l) flat.
        hessians: (p, 9) sums over elements of products of second derivatives (`affine_couples`); 0 if linear.
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
        """Build the macro element of a lattice."""
        elements, q = lattice.triangles, len(lattice.nodes)
        pair = elements[:, :, None] * q + elements[:, None, :]
        couples, nodes, pairs = GroupedSum.of(pair), GroupedSum.of(elements), np.unique(pair)
        g, w = gradients(lattice.nodes[elements][..., 1:] / lattice.intervals)
        second = np.einsum("ar,bs->abrs", HESSIANS, HESSIANS).reshape(-1, 9)
        # Plane stiffness does not depend on the size, so that every element has the stiffness of the coarse triangle.
        of_all = np.tile(second, (len(elements), 1)) if lattice.order == 2 else np.zeros((pair.size, 9))
        return cls(
            pairs // q, pairs % q, couples, nodes, couples(products(g, w))[0], couples(of_all)[0],
            nodes(integrals(g, w))[0],
        )  # fmt: skip


def products(g: Float, w: Float) -> Float:
    """Integrate gradient products dN_a/dx_k dN_b/dx_l (e, a, a, 4), (k, l) flat; g (e, q, a, 2), weights w (e, q)."""
    e, q, a, _ = g.shape
    flat = g.reshape(e, q, 2 * a)
    outer = np.matmul((flat * w[..., None]).transpose(0, 2, 1), flat)
    return np.asarray(outer.reshape(e, a, 2, a, 2).transpose(0, 1, 3, 2, 4).reshape(e, a, a, 4))


def integrals(g: Float, w: Float) -> Float:
    """Integrate shape function gradients dN_a/dx_k (e, a, 2), given g (e, q, a, 2) and weights w (e, q)."""
    return np.asarray(np.einsum("eqak,eq->eak", g, w))


def side_loads(submesh: Submesh, mesh: FineMesh, problem: Problem) -> Float:
    """Compute loads Q (dofs, m): tractions Sigma n on cell sides are forces -Q Sigma; (dofs, 0) without tractions."""
    if submesh.boundary != "traction":
        return np.zeros((problem.components * mesh.n_classes, 0))
    unit = np.concatenate(np.eye(problem.strains)[problem.voigt], axis=1)
    return np.asarray((boundary_integrals(submesh, mesh, submesh.at_side) @ unit).reshape(-1, problem.strains))


def boundary_integrals(submesh: Submesh, mesh: FineMesh, edges: Bool) -> Float:
    """Integrate int N n ds (classes, 2) of shape functions N along the torus edges in a mask `edges` (torus edges,).

    The normal n points into the body.  So around a void, u^T int N n ds is the integral of grad u over the void.
    """
    sums, nodes = np.zeros((mesh.n_classes, 2)), nodes_along(submesh, mesh, edges)
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
    """Return the plane nodes (sides, intervals + 1) along torus edges in a mask; the body is on their left."""
    triangle, side = np.nonzero(edges[submesh.edge_class[submesh.triangle_edges]])
    lattice, sides = mesh.lattice.nodes, []
    for k in range(3):  # from vertex k to vertex k + 1
        nodes = np.flatnonzero(lattice[:, (k + 2) % 3] == 0)
        sides.append(nodes[np.argsort(lattice[nodes, (k + 1) % 3])])
    return np.take_along_axis(mesh.nodes[triangle].astype(np.int64), np.array(sides)[side], axis=1)
