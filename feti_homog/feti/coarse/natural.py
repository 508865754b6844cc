"""The natural coarse space G = B R of rigid-body motions, Eq. (37), and its projector P."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from mpi4py import MPI
from scipy.sparse import block_diag, csc_matrix, csr_matrix, diags

from feti_homog.feti.linalg.sparse_matrices import DistributedSolver, assemble_owned_rows
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.thresholds import ZERO_TOLERANCE
from feti_homog.mesh import periodic_topology
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Float, Int


class NaturalCoarseSpace:
    """The rigid-body motions of all subdomains, and P = I - G (G^T G)^-1 G^T.

    P projects onto multipliers in equilibrium, G^T lam = 0: in Eq. (37) R^T f = 0, because the load f of a macroscopic
    strain does no work on rigid-body motions.  G has a row for every multiplier and a column for every kernel mode.  A
    rank stores its owned rows of G, and a factor of G^T G or a part of it (`DistributedSolver`).

    Attributes:
        kernel_dimension: number m of kernel modes in the cell.
        owned_modes: modes of the local subdomains, as a slice of all modes.
        R: (boundary dofs, owned modes) kernels on the boundaries.
        G: (owned rows, m) jumps of the modes.
        body: (m,) body numbers of the modes.
        pinned_body: last body with held nodes or supporting springs; -1 without such a body.
        unconstrained_modes: (m, z) orthonormal amplitudes of the motions that no active row resists, sparse.
        unknowns: (u,) modes that this rank needs: owned ones, and those in owned rows of G or in unconstrained modes.
        factorizations: number of factorizations of G^T G.
        solver: solver for G^T G.
    """

    def __init__(self, operators: InterfaceOperators) -> None:
        """Assemble G, and factor G^T G with all rows active.  Collective.

        Options with the prefix `feti_natural_`, and exceptions, are as in `DistributedSolver`.
        """
        comm, jump_operator, subdomains = operators.comm, operators.jump_operator, operators.subdomains
        kernels = [s.R[dofs] for s, dofs in zip(subdomains, operators.dofs, strict=True)]
        modes = sum(R.shape[1] for R in kernels)
        first = comm.exscan(modes) or 0
        self.comm = comm
        self.owned_modes = slice(first, first + modes)
        self.kernel_dimension: int = comm.allreduce(modes)
        self.R = csr_matrix(block_diag(kernels)) if kernels else csr_matrix((0, 0))
        body = np.repeat([s.submesh.body for s in subdomains], [R.shape[1] for R in kernels])
        self.body = np.concatenate(comm.allgather(body)).astype(np.int64)
        pinned = [s.submesh.body for s in subdomains if len(s.held) or s.is_supported]
        self.pinned_body: int = comm.allreduce(max(pinned, default=-1), MPI.MAX)
        owned = jump_operator.owned[1] - jump_operator.owned[0]
        columns = np.arange(first, first + modes)
        self.G = assemble_owned_rows(comm, operators.B @ self.R, jump_operator.rows, columns, (owned, modes))
        self.factorizations, self._active = 0, np.ones(owned)
        self._diagonal = distributed_arrays.allreduce_sum(comm, np.asarray(self.G.power(2).sum(axis=0)).ravel())
        self.unconstrained_modes = csc_matrix((self.kernel_dimension, 0))
        self._reaching = np.union1d(self.G.indices, columns).astype(np.int64)
        self.solver = DistributedSolver(comm, self.kernel_dimension, "feti_natural_")
        self.factor()

    def activate(self, active: Float) -> None:
        """Set the active rows, where `active` (owned rows,) is 1.  Collective.

        The next product with (G^T G)^-1 factors G^T G of these rows.  Motions Z that no active row resists, for example
        of a free fibre, get the largest diagonal entry s of G^T G as stiffness: G^T G + s Z Z^T.
        """
        self._active, self._is_factored = active, False
        self.unconstrained_modes = self.free_motions(active)

    @property
    def G_active(self) -> csr_matrix:
        """Return G (owned rows, m) with 0 in inactive rows."""
        return (diags(self._active) @ self.G).tocsr()

    def factor(self) -> None:
        """Factor G^T G of the active rows, if there are modes; raises like `DistributedSolver.factor`.  Collective."""
        self._is_factored = True
        if not self.kernel_dimension:
            return
        # Rows of Z: unconstrained modes whose first subdomain is on this rank.
        modes = self.unconstrained_modes
        first = modes.indices[modes.indptr[:-1]]
        Z = modes[:, (first >= self.owned_modes.start) & (first < self.owned_modes.stop)].T.tocsr()
        self.unknowns = np.union1d(self._reaching, Z.indices).astype(np.int64)
        self._G = self.G_active[:, self.unknowns].tocsr()
        self._GT = self._G.T.tocsr()
        Z = Z[:, self.unknowns]
        gram = (self._GT @ self._G + self._diagonal.max(initial=0.0) * (Z.T @ Z)).tocsr()
        self.solver.factor(self.unknowns, gram)
        self.factorizations += 1

    @cached_property
    def _gram(self) -> GramMatrix:
        """Set up the matrix G^T A G of changing active rows A.  Collective when first read.

        In the plane, a row between whole bodies takes 36 products.  Modes of the pinned body are left out: its pieces
        are glued together and cannot move.
        """
        return GramMatrix(self.comm, self.G, np.flatnonzero(self.body != self.pinned_body))

    def free_motions(self, active: Float) -> csc_matrix:
        """Compute a basis (m, z) for the null space of G^T G on rows where `active` (owned rows,) is 1.  Collective."""
        return self._gram.null_space(active, ZERO_TOLERANCE * self._diagonal)

    def amplitudes(self, x: Float) -> Float:
        """Compute amplitudes (G^T G)^-1 G^T x (m,) or (m, k) of x (owned rows,) or (owned rows, k).  Collective."""
        if not self._is_factored:
            self.factor()
        positions = np.searchsorted(self.unknowns, np.arange(self.kernel_dimension)[self.owned_modes])
        amplitudes = np.zeros((self.kernel_dimension, *x.shape[1:]))
        amplitudes[self.owned_modes] = self.solver.solve(self._GT @ x)[positions]
        return distributed_arrays.allreduce_sum(self.comm, amplitudes)

    def balancing(self, forces: Float) -> Float:
        """Compute the least-norm multipliers lam = G (G^T G)^-1 e (owned rows, k) with G^T lam = e.  Collective.

        `forces` (owned modes, k) are the rows of e for local subdomains; lam is 0 on inactive rows.
        """
        if not self._is_factored:
            self.factor()
        right = np.zeros((len(self.unknowns), forces.shape[1]))
        right[np.searchsorted(self.unknowns, np.arange(self.kernel_dimension)[self.owned_modes])] = forces
        return np.asarray(self._G @ self.solver.solve(right))

    def project(self, x: Float) -> Float:
        """Compute the projection P x of x (owned rows,) or (owned rows, k), 0 on inactive rows.  Collective."""
        if not self.kernel_dimension:
            return x.copy()
        if not self._is_factored:
            self.factor()
        return np.asarray(x - self._G @ self.solver.solve(self._GT @ x))

    def destroy(self) -> None:
        """Free the factor of G^T G.  Collective."""
        self.solver.destroy()


class GramMatrix:
    """The matrix G^T A G for changing active rows A = diag(a), summed from stored products."""

    def __init__(self, comm: MPI.Intracomm, G: csr_matrix, movable: Int) -> None:
        """Store the products of all entry pairs in each row of G, and group the `movable` modes.  Collective."""
        self._comm, self._m = comm, G.shape[1]
        count = np.diff(G.indptr)
        # For every row, its number of products, and the number of the first; for every product, its entry and value.
        self._count = count**2
        self._first = np.cumsum(self._count) - self._count
        row = np.repeat(np.arange(len(count)), self._count)
        within = np.arange(len(row)) - self._first[row]
        a, b = G.indptr[row] + within // count[row], G.indptr[row] + within % count[row]
        key = G.indices[a].astype(np.int64) * self._m + G.indices[b]
        diagonal = np.arange(self._m) * (self._m + 1)
        self._keys = np.unique(np.concatenate([diagonal, *comm.allgather(np.unique(key))]))
        self._entry, self._product = np.searchsorted(self._keys, key), G.data[a] * G.data[b]
        self._active, self._own = np.zeros(G.shape[0]), np.zeros(len(self._keys))
        self._rows, self._columns = np.divmod(self._keys, self._m)
        # Modes that G^T G couples have a common eigenproblem, about as large as the kernel of a fibre.  A tuple has
        # modes (groups, size), positions of the blocks in the entries, and blocks, eigenvalues and eigenvectors from
        # the last call of `null_space`.
        self._groups: list[tuple[Int, Int, Float, Float, Float]] = []
        for members in self.groups(movable):
            numbers = self.places(members)
            nothing = np.full(numbers.shape, np.nan)
            self._groups.append((members, numbers, nothing, nothing[..., 0].copy(), nothing.copy()))

    def entries(self, active: Float) -> Float:
        """Compute the entries of G^T A G, row by row; `active` (owned rows,) is a.  Collective.

        Only products of rows that changed since the last call are added or subtracted.
        """
        changed = np.flatnonzero(active != self._active)
        count = self._count[changed]
        at = distributed_arrays.ranges(self._first[changed], count)
        products = self._product[at] * np.repeat((active - self._active)[changed], count)
        self._own = self._own + np.bincount(self._entry[at], products, len(self._own))
        self._active = active.copy()
        return distributed_arrays.allreduce_sum(self._comm, self._own)

    def null_space(self, active: Float, tolerance: Float) -> csc_matrix:
        """Compute a basis (m, z) for the null space of G^T A G.  Collective.

        `active` (owned rows,) is a.  Among coupled modes, eigenvalues up to the largest `tolerance` (m,) count as 0.
        """
        padded, columns = np.append(self.entries(active), 0.0), 0
        rows, numbers, values = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
        for members, places, blocks, eigenvalues, vectors in self._groups:
            now = padded[places]
            changed = np.flatnonzero((now != blocks).any(axis=(1, 2)))
            if len(changed):  # a broken bond changes one or two groups
                eigenvalues[changed], vectors[changed] = np.linalg.eigh(now[changed])
                blocks[changed] = now[changed]
            which, mode = np.nonzero(eigenvalues <= tolerance[members].max(axis=1, keepdims=True))
            rows.append(members[which].ravel())
            numbers.append(np.repeat(columns + np.arange(len(which)), members.shape[1]))
            values.append(vectors[which, :, mode].ravel())
            columns += len(which)
        entry = np.concatenate(values), (np.concatenate(rows), np.concatenate(numbers))
        Z = csc_matrix(entry, shape=(self._m, columns))
        Z.eliminate_zeros()
        Z.sort_indices()
        return Z

    def groups(self, modes: Int) -> list[Int]:
        """Group the numbers `modes` by couplings in G^T G; return an array (groups, size) for every group size."""
        position = np.full(self._m, -1)
        position[modes] = np.arange(len(modes))
        i, j = position[self._rows], position[self._columns]
        coupled = (i >= 0) & (j >= 0)
        group = periodic_topology.components(len(modes), i[coupled], j[coupled])
        order, sizes = np.argsort(group, kind="stable"), np.bincount(group)
        starts = np.cumsum(sizes) - sizes
        return [modes[order[starts[sizes == size][:, None] + np.arange(size)]] for size in np.unique(sizes)]

    def places(self, members: Int) -> Int:
        """Look up the entry numbers (g, s, s) of all mode pairs in groups `members` (g, s).

        A pair without an entry gets the total number of entries.
        """
        key = members[:, :, None] * self._m + members[:, None, :]
        at = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        return np.asarray(np.where(self._keys[at] == key, at, len(self._keys)))
