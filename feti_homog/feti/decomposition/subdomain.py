"""The subdomain: its refined mesh, stiffness K, unit loads Q and kernel R."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_matrix

from feti_homog.errors import MeshError
from feti_homog.fem import PLANE, Problem, assembly, shape_functions
from feti_homog.feti.thresholds import LEAST_ORDERED_DOFS, SCALED_LAME, ZERO_TOLERANCE
from feti_homog.mesh import FineMesh, ReferenceLattice, Submesh, mesh_fibres, refinement
from feti_homog.typing import Float, Int


@dataclass(eq=False)
class Subdomain:
    """One subdomain: a piece of a body, or of several bonded bodies.

    It has n node classes with c displacements each, and a kernel of dimension k.  K takes by far the most memory:
    `build` assembles K, the first `take_stiffness` hands K over to the caller, and later calls assemble K anew.

    Attributes:
        submesh: coarse mesh.
        mesh: refined mesh.
        problem: the c displacements of a node, m displacement strains and v unit loads.
        L: (v, v) stiffness of the material, see `assembly.assemble`; with several materials, the mean over the area.
        laws, material: arguments of `assembly.assemble`; with one material, `laws` is (1, v, v) and `material` None.
        Q: (cn, v) unit loads, forces f = -Q E; with tractions t = Sigma n on the sides (cn, v + m), f = -Q [E, Sigma].
        slopes: (n, 2) int dN/dx; 0 at held classes.
        areas: (materials,) area of every material.
        R: (cn, k) orthonormal kernel of K: translations, and a rotation in the plane if the piece can turn,
            without the motions that held classes prevent; k = 0 if springs hold the subdomain.
        held: node classes with u* = 0: pinned classes, and nodes on sides with the displacement E x.
        positions: (n, 2) unwrapped positions of the classes.
        is_thin: whether the body is thin, such as a ring much thinner than its radius, so that K+ is ill-conditioned.
        is_outer: whether no other body lies around the body.
        mixed: whether elements have a bubble and an internal pressure, see `assembly.assemble`.
    """

    submesh: Submesh
    mesh: FineMesh
    problem: Problem
    L: Float
    laws: Float
    material: Int | None
    Q: Float
    slopes: Float
    areas: Float
    R: Float
    held: Int
    positions: Float
    _built_stiffness: csr_matrix | None = field(repr=False)
    _support: csr_matrix | None = field(default=None, init=False, repr=False)
    is_thin: bool = False
    is_outer: bool = False
    mixed: assembly.Mixed = False

    @classmethod
    def build(
        cls,
        submesh: Submesh,
        lattice: ReferenceLattice,
        laws: Float,
        problem: Problem = PLANE,
        material: Int | None = None,
        mixed: assembly.Mixed = False,
        **flags: bool,
    ) -> Subdomain:
        """Refine the submesh and assemble K and Q, without communication.

        `laws`, `material` and `mixed` are as in `assembly.assemble`; `flags` are `is_thin` and `is_outer`.

        Raises:
            MeshError: an element is inverted, or |K R| exceeds ZERO_TOLERANCE |K|.
        """
        mesh = refinement.refine(submesh, lattice)
        # Nodes that are moved to the exact interface may invert triangles.
        triangles = mesh.nodes[mesh.curved][:, mesh.lattice.triangles[:, :3]].reshape(-1, 3)
        a, b, c = (mesh.points[triangles[:, k]] for k in range(3))
        doubled = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        inverted = np.flatnonzero(~(doubled > 0))
        if len(inverted):
            x, y = mesh.points[triangles[inverted[0]]].mean(axis=0) + submesh.origin
            kind = f" of {submesh.phase}" if submesh.phase else ""
            raise MeshError(
                f"[cell] refine, order: {len(inverted)} refined elements{kind} are inverted, the first "
                f"near ({x:.6g}, {y:.6g}); expected a mesh fine enough for its curved interfaces"
            )
        return cls.on(submesh, mesh, laws, problem, material, mixed, **flags)

    @classmethod
    def on(
        cls,
        submesh: Submesh,
        mesh: FineMesh,
        laws: Float,
        problem: Problem,
        material: Int | None = None,
        mixed: assembly.Mixed = False,
        **flags: bool,
    ) -> Subdomain:
        """Assemble K and Q on the refined `mesh`, without communication; raises MeshError for |K R|, like `build`."""
        body = assembly.assemble(mesh, laws, problem, mixed, material)
        shift, closes = mesh_fibres.unwrap(submesh)
        positions = np.empty((mesh.n_classes, 2))
        positions[mesh.node_class[mesh.nodes]] = mesh.points[mesh.nodes] + shift[:, None]
        held = submesh.pinned
        if submesh.boundary == "displacement":
            held = np.union1d(held, mesh.node_class[assembly.nodes_along(submesh, mesh, submesh.at_side)])
        R = kernel(problem, positions, closes, held)
        K = _held(body.K, problem, held)
        # The rigid-body modes are in the kernel of K; NaN is above any tolerance.
        residual = abs(K @ R).max(initial=0.0) / abs(K.data).max()
        if not residual <= ZERO_TOLERANCE:
            faults = f"|K R| / |K| = {residual:.1e}, expected at most {ZERO_TOLERANCE:.0e}; its elements are degenerate"
            raise MeshError(f"{label(submesh)}: {faults}")
        Q, slopes = np.hstack([body.Q, assembly.side_loads(submesh, mesh, problem)]), body.slopes
        Q[problem.dofs(held)], slopes[held] = 0.0, 0.0
        laws = laws.reshape(-1, *laws.shape[-2:])
        L = np.einsum("k,kij->ij", body.areas / body.areas.sum(), laws) if len(laws) > 1 else laws[0]
        subdomain = cls(
            submesh, mesh, problem, L, laws, material, Q, slopes, body.areas, R, held, positions, K,
            mixed=mixed, **flags,
        )  # fmt: skip
        if submesh.boundary == "traction" and submesh.index == 0:
            # Springs hold a cell whose sides move freely; tractions in equilibrium cause no force in these springs.
            subdomain._support = subdomain._springs(K, np.arange(mesh.n_classes))
            subdomain._built_stiffness, subdomain.R = (K + subdomain._support).tocsr(), R[:, :0]
        return subdomain

    def mean_strain(self, dofs: Int) -> Float:
        """Compute the weights w (k, m) of `dofs` (k,) in the integrals of the m displacement strains.

        w^T u is the contribution of the displacements u to int eps over the subdomain, plus int u (x) n ds along its
        edges at voids, with n outward from the voids: around a void, the sum is int eps over the void.
        """
        m, slopes = self.problem.strains, self.slopes
        if self.submesh.at_void.any():
            slopes = slopes + assembly.boundary_integrals(self.submesh, self.mesh, self.submesh.at_void)
        return np.asarray((slopes @ np.concatenate(np.eye(m)[self.problem.voigt], axis=1)).reshape(-1, m)[dofs])

    @property
    def area(self) -> float:
        """Return the area of the subdomain."""
        return float(self.areas.sum())

    @property
    def volume_stiffness(self) -> Float:
        """Return the stiffness |Omega| L (v, v), padded by 0 to (v + m, v + m) with tractions on the sides."""
        C = np.zeros((self.Q.shape[1],) * 2)
        C[: len(self.L), : len(self.L)] = self.area * self.L
        return C

    @property
    def loads_inside(self) -> bool:
        """Return whether unit loads act on nodes that are not shared: at voids or sides, or where materials meet."""
        is_pulled = self.Q.shape[1] > len(self.L)
        return self.material is not None or is_pulled or bool(self.submesh.at_void.any())

    @property
    def is_supported(self) -> bool:
        """Return whether springs hold the subdomain, in a cell with given tractions on the sides."""
        return self._support is not None

    def without_rounding(self, answers: Float, dofs: Int) -> Float:
        """Remove rounding from the displacements `answers` = -K+ Q (k, v) of `dofs` (k,).

        If a body can turn and has no voids, its displacement under a strain E is -E x plus a rigid-body motion; else
        the result is `answers`.  Rounding in K+ Q, times the stiffness of the body, may far exceed all forces.
        """
        if self.R.shape[1] < 3 or self.submesh.at_void.any():
            return answers
        strains, R = self.problem.strains, self.R[dofs]
        gradients = (self.problem.gradient(unit) for unit in np.eye(strains))
        affine = np.stack([(self.positions @ gradient.T).ravel()[dofs] for gradient in gradients], axis=1)
        rigid = R @ np.linalg.lstsq(R, answers[:, :strains] + affine, rcond=None)[0]
        return np.hstack([rigid - affine, answers[:, strains:]])

    @property
    def is_mixed(self) -> bool:
        """Return whether any material has mixed elements."""
        return bool(np.any(self.mixed))

    @property
    def n_dofs(self) -> int:
        """Return the number of degrees of freedom, cn."""
        return len(self.Q)

    @property
    def compressible_share(self) -> float:
        """Compute the factor (min(lambda, 2 mu) + 3 mu) / (lambda + 3 mu) for the diagonal of K that scales jumps.

        lambda and mu are the Lame constants of L.  Single nodes of mixed elements are as stiff as lambda, boundary
        motions at constant volume only as mu.  The factor is 1 without mixed elements, and for several materials, of
        which none is nearly incompressible.
        """
        if not self.is_mixed or self.material is not None:
            return 1.0
        first, shear = shape_functions.lame(self.L)
        return (min(first, SCALED_LAME * shear) + 3 * shear) / (first + 3 * shear)

    def elimination_order(self) -> Int | None:
        """Return an elimination order (cn,) of all dofs, or None if the direct solver should choose.

        The direct solver's order is cheaper for fewer than LEAST_ORDERED_DOFS dofs, or without refinement.
        """
        pays = self.n_dofs >= LEAST_ORDERED_DOFS and self.mesh.lattice.intervals > 1
        return self.problem.dofs(refinement.elimination_order(self.mesh)) if pays else None

    def take_stiffness(self) -> csr_matrix:
        """Hand K (cn, cn) over to the caller: first the matrix of `build`, later a new matrix."""
        K, self._built_stiffness = self._built_stiffness, None
        return self.assemble_stiffness() if K is None else K

    def assemble_stiffness(self) -> csr_matrix:
        """Assemble K (cn, cn), Eq. (28), with scaled unit rows for held classes, Eq. (15), and supporting springs."""
        body = assembly.assemble(self.mesh, self.laws, self.problem, self.mixed, self.material)
        K = _held(body.K, self.problem, self.held)
        return K if self._support is None else (K + self._support).tocsr()

    def fixing(self, K: csr_matrix, candidates: Int) -> tuple[Int, Float]:
        """Compute fixing dofs (f,), and the term rho Rf Rf^T (f, f) on these dofs: K plus the term is definite.

        The inverse of the sum is a generalized inverse K+ of K (Brzobohaty, Dostal, Kozubek, Kovar, Markopoulos, IJNME
        88, 2011).  The dofs belong to one to three nodes of `candidates`, far apart; Rf is the kernel on these dofs,
        orthonormalised, and rho the mean diagonal entry of K on them.  Both results are empty if K has no kernel.
        """
        if self.R.shape[1] == 0:
            return np.zeros(0, np.int64), np.zeros((0, 0))
        # For three modes three nodes far apart, else the node farthest from the first held class or from the mean.
        x = self.positions[candidates]
        origin = self.positions[self.held[:1]] if len(self.held) else x.mean(axis=0)
        apart = [np.argmax(((x - origin) ** 2).sum(axis=1))]
        if self.R.shape[1] >= 3:
            apart.append(np.argmax(((x - x[apart[0]]) ** 2).sum(axis=1)))
            ex, ey = (x - x[apart[0]]).T
            dx, dy = x[apart[1]] - x[apart[0]]
            apart.append(np.argmax(np.abs(dx * ey - dy * ex)))
        # On a straight line two nodes are enough, and the third repeats one of them.
        nodes = np.unique(candidates[apart])
        dofs = self.problem.dofs(nodes)
        Rf = np.linalg.qr(self.R[dofs])[0]
        return dofs, K.diagonal()[dofs].mean() * Rf @ Rf.T

    def regularised(self, K: csr_matrix, candidates: Int) -> csr_matrix:
        """Compute the definite matrix K + rho Rf Rf^T (cn, cn); see `fixing`."""
        return (K + self._springs(K, candidates)).tocsr()

    def _springs(self, K: csr_matrix, candidates: Int) -> csr_matrix:
        """Assemble rho Rf Rf^T (cn, cn), the stiffness of springs at fixing nodes; see `fixing`."""
        dofs, block = self.fixing(K, candidates)
        rows, columns = np.meshgrid(dofs, dofs, indexing="ij")
        return csr_matrix((block.ravel(), (rows.ravel(), columns.ravel())), shape=K.shape)


def kernel(problem: Problem, positions: Float, rotates: bool, held: Int) -> Float:
    """Compute an orthonormal kernel (cn, k): translations, and a turn if `rotates`, with `held` nodes at rest."""
    n, c = len(positions), problem.components
    free = np.zeros((n, c, 0)) if len(held) else np.tile(np.eye(c), (n, 1, 1))
    if rotates and problem.turns and len(held) < 2:
        centre = positions[held[0]] if len(held) else positions.mean(axis=0)
        x, y = (positions - centre).T
        turn = np.stack([-y, x], axis=1)[..., None] / max(np.ptp(x), np.ptp(y))
        free = np.concatenate([free, turn], axis=2)
    return np.linalg.qr(free.reshape(c * n, free.shape[2]))[0]


def label(submesh: Submesh) -> str:
    """Return the name of a subdomain in messages: number, phase and a point."""
    x, y = submesh.points[0] + submesh.origin
    kind = f" ({submesh.phase})" if submesh.phase else ""
    return f"subdomain {submesh.index}{kind} near ({x:.6g}, {y:.6g})"


def _held(K: csr_matrix, problem: Problem, held: Int) -> csr_matrix:
    """Replace rows and columns of nodes `held` in K by a multiple of I, in place; return K."""
    if not len(held):
        return K
    is_held, largest = np.zeros(K.shape[0], bool), K.diagonal().max()
    is_held[problem.dofs(held)] = True
    row = np.repeat(np.arange(K.shape[0]), np.diff(K.indptr))
    of_held = is_held[K.indices] | is_held[row]
    K.data[of_held] = np.where(K.indices[of_held] == row[of_held], largest, 0.0)
    K.eliminate_zeros()
    return K
