"""One subdomain: its refined mesh, stiffness, load and kernel."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_matrix

from feti_homog.errors import MeshError
from feti_homog.fem import PLANE, Problem, assembly, bubble
from feti_homog.feti.thresholds import LEAST_ORDERED_DOFS, SCALED_LAME, ZERO_TOLERANCE
from feti_homog.mesh import FineMesh, ReferenceLattice, Submesh, mesh_fibres, refinement
from feti_homog.typing import Float, Int


@dataclass(eq=False)
class Subdomain:
    """One subdomain: a piece of a body or of several bonded bodies.

    It has n node classes with c displacements each, and a kernel of dimension k.  K is by far the largest part:
    `build` assembles it, the first `take_stiffness` hands it over to its caller, and later calls assemble it anew.

    Attributes:
        submesh: the coarse share.
        mesh: the refined mesh.
        problem: the displacements of the problem.
        L: (v, v) stiffness of the material, see `assemble`; the mean over the area if there are several.
        laws, material: the arguments of `assemble`; the first is (1, v, v), the second None, of one material.
        Q: (cn, v) load of the unit strains: f = -Q E.
        slopes: (n, 2) int dN/dx, 0 of the pinned class.
        areas: (materials,) of each material.
        R: (cn, k) orthonormal kernel of K: translations, and a rotation in the plane if the piece can turn,
            less the motions that the pinned class stops.
        positions: (n, 2) unwrapped positions of the classes.
        is_thin: whether the body is, such as a ring much thinner than its radius: the inverse is ill-conditioned.
        is_outer: whether no other body lies around it.
        mixed: whether its elements have a bubble and a pressure of their own, see `assemble`.
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
    positions: Float
    _built_stiffness: csr_matrix | None = field(repr=False)
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
        """Refine and assemble, without communication; `flags` are `is_thin` and `is_outer`.

        One material or several: `laws`, `material` and `mixed` as in `assemble`.

        Raises:
            MeshError: an element is inverted, or the rigid-body modes are not in the kernel of K.
        """
        mesh = refinement.refine(submesh, lattice)
        # Bending towards the circles may turn triangles over.
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
        """Assemble on a refined mesh, without communication.  Arguments and errors as of `build`."""
        body = assembly.assemble(mesh, laws, problem, mixed, material)
        shift, closes = mesh_fibres.unwrap(submesh)
        positions = np.empty((mesh.n_classes, 2))
        positions[mesh.node_class[mesh.nodes]] = mesh.points[mesh.nodes] + shift[:, None]
        R = kernel(problem, positions, closes, submesh.pinned)
        K = _pinned(body.K, problem, submesh.pinned)
        # The rigid-body modes are in the kernel of K; NaN is above any tolerance.
        residual = abs(K @ R).max(initial=0.0) / abs(K.data).max()
        if not residual <= ZERO_TOLERANCE:
            faults = f"|K R| / |K| = {residual:.1e}, expected at most {ZERO_TOLERANCE:.0e}; its elements are degenerate"
            raise MeshError(f"{label(submesh)}: {faults}")
        Q, slopes = body.Q, body.slopes
        if submesh.pinned >= 0:
            Q[problem.dofs(np.array([submesh.pinned]))], slopes[submesh.pinned] = 0.0, 0.0
        laws = laws.reshape(-1, *laws.shape[-2:])
        L = np.einsum("k,kij->ij", body.areas / body.areas.sum(), laws) if len(laws) > 1 else laws[0]
        return cls(
            submesh, mesh, problem, L, laws, material, Q, slopes, body.areas, R, positions, K, mixed=mixed, **flags
        )

    def mean_strain(self, dofs: Int) -> Float:
        """Compute weights (k, m): their transpose times the displacements of `dofs` (k,) is a part of int eps*.

        The integral is over the subdomain and its share of the voids beside it, int_Omega eps* + int u (x) n ds, n
        outward from the voids; 0 at voids.
        """
        m, slopes = self.problem.strains, self.slopes
        if self.submesh.at_void.any():
            slopes = slopes + assembly.void_integrals(self.submesh, self.mesh)
        return np.asarray((slopes @ np.concatenate(np.eye(m)[self.problem.voigt], axis=1)).reshape(-1, m)[dofs])

    @property
    def area(self) -> float:
        """Area of the subdomain."""
        return float(self.areas.sum())

    @property
    def loads_inside(self) -> bool:
        """Whether unit loads act on nodes that are not shared: at voids, and where materials meet."""
        return self.material is not None or bool(self.submesh.at_void.any())

    def without_rounding(self, answers: Float, dofs: Int) -> Float:
        """Remove rounding from the displacements -K+ Q (k, v) of `dofs` (k,).

        The displacement of a body that can turn, without voids, under a strain E is -E x and a rigid-body motion.  K+
        adds rounding in proportion to the stiffness of the body, which may be far above all forces on it.
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
        """Whether any material has mixed elements."""
        return bool(np.any(self.mixed))

    @property
    def n_dofs(self) -> int:
        """Number of degrees of freedom, cn."""
        return len(self.Q)

    @property
    def compressible_share(self) -> float:
        """Fraction to which the diagonal of K is reduced where it scales jumps.

        A boundary that keeps the volume is as stiff as mu, but single nodes of mixed elements are as stiff as lambda:
        here lambda is at most 2 mu.  The fraction is 1 for several materials, of which none is nearly incompressible.
        """
        if not self.is_mixed or self.material is not None:
            return 1.0
        first, shear = bubble.lame(self.L)
        return (min(first, SCALED_LAME * shear) + 3 * shear) / (first + 3 * shear)

    def elimination_order(self) -> Int | None:
        """Return an elimination order (cn,) of all dofs; None where the library orders at less cost.

        The library does if all nodes are coarse nodes, for then all triangles would have to be halved.
        """
        pays = self.n_dofs >= LEAST_ORDERED_DOFS and self.mesh.lattice.intervals > 1
        return self.problem.dofs(refinement.elimination_order(self.mesh)) if pays else None

    def take_stiffness(self) -> csr_matrix:
        """Hand K (cn, cn) over to the caller: at first the matrix of `build`, later a new one."""
        K, self._built_stiffness = self._built_stiffness, None
        return self.assemble_stiffness() if K is None else K

    def assemble_stiffness(self) -> csr_matrix:
        """Assemble K (cn, cn), Eq. (28); a scaled unit row eliminates the pinned class (15)."""
        body = assembly.assemble(self.mesh, self.laws, self.problem, self.mixed, self.material)
        return _pinned(body.K, self.problem, self.submesh.pinned)

    def fixing(self, K: csr_matrix, candidates: Int) -> tuple[Int, Float]:
        """Return dofs and a dense block rho Rf Rf^T on them that makes K + block SPD.

        Its inverse is a generalized inverse K+ of K.  Rf is the kernel restricted to at most three of the
        `candidates` (nodes), far apart, and orthonormalised (Brzobohaty, Dostal, Kozubek, Kovar, Markopoulos,
        IJNME 88, 2011); rho is the mean diagonal entry of K there.
        """
        if self.R.shape[1] == 0:
            return np.zeros(0, np.int64), np.zeros((0, 0))
        # Three far-apart nodes for three modes, else the one farthest from the pinned class.
        x = self.positions[candidates]
        origin = self.positions[self.submesh.pinned] if self.submesh.pinned >= 0 else x.mean(axis=0)
        apart = [np.argmax(((x - origin) ** 2).sum(axis=1))]
        if self.R.shape[1] >= 3:
            apart.append(np.argmax(((x - x[apart[0]]) ** 2).sum(axis=1)))
            (dx, dy), (ex, ey) = x[apart[1]] - x[apart[0]], (x - x[apart[0]]).T
            apart.append(np.argmax(np.abs(dx * ey - dy * ex)))
        # On a straight line two are enough, and the third is one of them.
        nodes = np.unique(candidates[apart])
        dofs = self.problem.dofs(nodes)
        Rf = np.linalg.qr(self.R[dofs])[0]
        return dofs, K.diagonal()[dofs].mean() * Rf @ Rf.T

    def regularised(self, K: csr_matrix, candidates: Int) -> csr_matrix:
        """Add the block of `fixing` to K."""
        dofs, block = self.fixing(K, candidates)
        rows, columns = np.meshgrid(dofs, dofs, indexing="ij")
        return (K + csr_matrix((block.ravel(), (rows.ravel(), columns.ravel())), shape=K.shape)).tocsr()


def kernel(problem: Problem, positions: Float, rotates: bool, pinned: int) -> Float:
    """Compute orthonormal rigid-body modes (cn, k) of nodes at `positions` (n, 2); `pinned` is a node or -1."""
    n, c = len(positions), problem.components
    free = np.zeros((n, c, 0)) if pinned >= 0 else np.tile(np.eye(c), (n, 1, 1))
    if rotates and problem.turns:
        centre = positions[pinned] if pinned >= 0 else positions.mean(axis=0)
        x, y = (positions - centre).T
        turn = np.stack([-y, x], axis=1)[..., None] / max(np.ptp(x), np.ptp(y))
        free = np.concatenate([free, turn], axis=2)
    return np.linalg.qr(free.reshape(c * n, free.shape[2]))[0]


def label(submesh: Submesh) -> str:
    """Describe a subdomain in messages."""
    x, y = submesh.points[0] + submesh.origin
    kind = f" ({submesh.phase})" if submesh.phase else ""
    return f"subdomain {submesh.index}{kind} near ({x:.6g}, {y:.6g})"


def _pinned(K: csr_matrix, problem: Problem, pinned: int) -> csr_matrix:
    """Replace the rows and columns of a pinned node in K by a multiple of I; -1 pins no node."""
    if pinned < 0:
        return K
    dofs, largest = problem.dofs(np.array([pinned])), K.diagonal().max()
    K.data[np.isin(K.indices, dofs)] = 0.0
    for dof in dofs:
        row = slice(*K.indptr[dof : dof + 2])
        K.data[row] = np.where(K.indices[row] == dof, largest, 0.0)
    K.eliminate_zeros()
    return K
