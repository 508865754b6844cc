"""Kernels and soft modes V of all subdomains, and the coarse displacements Z_0 that follow from V.

With all soft modes (theta < tau, see `local_eigenproblems`), the largest eigenvalue of the preconditioned dual operator
is at most 1 + N / tau for any geometry and any materials.  N - 1 is the largest number of neighbours of a subdomain
(GenEO: Spillane & Rixen, IJNME 95, 2013).  Measured eigenvalues are about 1 / tau.

Modes are averaged over node copies: Z_0 = (I - B_D^T B) V with B_D of `adaptive`.  As B B_D^T = I, B Z_0 = 0: Z_0 moves
the cell with glued active rows.  A mode reaches (is nonzero on) only its subdomain and the subdomain's neighbours.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from mpi4py import MPI
from scipy.sparse import csc_matrix, csr_matrix

from feti_homog.feti.coarse.local_eigenproblems import SubdomainBlocks, eigenproblem
from feti_homog.feti.decomposition.interface_neighbours import Neighbours
from feti_homog.feti.linalg.sparse_matrices import add_shared_rows
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.operators.preconditioners import StiffnessScaled
from feti_homog.feti.thresholds import DEFAULTS, Thresholds
from feti_homog.system.parallel import distributed_arrays, mpi_errors
from feti_homog.typing import Float, Float32, Int

# Jumps B V that the modes of one subdomain cause on its rows, or on rows shared with a neighbour: row positions (r,),
# coarse mode numbers (c,), and values (r, c).
Jumps = tuple[Int, Int, Float]


class AveragedModes:
    """The averaged modes Z_0 on the local subdomains, for any active rows.

    Attributes:
        total: number n of coarse modes in the cell.
        columns: for every local subdomain, (m,) numbers of the modes that reach the subdomain, ascending.
        reaching: (u,) numbers of the modes that reach any local subdomain, ascending.
        is_own: (u,) whether the mode belongs to a local subdomain.
    """

    def __init__(
        self, comm: MPI.Intracomm, blocks: Sequence[SubdomainBlocks], neighbours: Neighbours, V: Sequence[Float]
    ) -> None:
        """Exchange the jumps B V; `V` holds an array (boundary dofs, modes) for every subdomain.  Collective."""
        self._blocks, self._V, self._sizes = blocks, V, [len(rows) for rows in neighbours.rows]
        counts = np.zeros(len(neighbours.rank), np.int64)
        counts[neighbours.index] = [v.shape[1] for v in V]
        comm.Allreduce(MPI.IN_PLACE, counts)
        ends = np.cumsum(counts)  # last coarse mode of each subdomain in the cell, + 1
        self._jumps: list[list[Jumps]] = [[] for _ in blocks]

        def messages() -> Iterator[tuple[int, int, tuple[Int, Float]]]:
            for i, (block, v) in enumerate(zip(blocks, V, strict=True)):
                Z, s = block.B @ v, neighbours.index[i]
                first = ends[s] - v.shape[1]
                for t, rows in neighbours.common[i].items():
                    # All modes of a subdomain reach the subdomain, even a mode that opens no jump.
                    modes = np.arange(v.shape[1]) if t == s else np.flatnonzero(Z[rows].any(axis=0))
                    yield i, t, (first + modes, Z[np.ix_(rows, modes)])

        common = neighbours.common
        neighbours.exchange(messages(), lambda i, s, message: self._jumps[i].append((common[i][s], *message)))
        self.total = int(ends[-1]) if len(ends) else 0
        self._first = [int(ends[s]) - v.shape[1] for s, v in zip(neighbours.index, V, strict=True)]
        none = np.zeros(0, np.int64)
        self.columns = [np.unique(np.concatenate([none, *(modes for _, modes, _ in part)])) for part in self._jumps]
        self.reaching = np.unique(np.concatenate([none, *self.columns]))
        numbers = [first + np.arange(v.shape[1]) for first, v in zip(self._first, V, strict=True)]
        self.is_own = np.isin(self.reaching, np.concatenate([none, *numbers]))

    def of_subdomain(self, i: int, BW: csr_matrix) -> Float:
        """Compute the averaged modes Z_0 (boundary dofs, m) on local subdomain i.

        The kernel of subdomain i has no energy and is left out, so that motions of stiff subdomains keep all digits.
        `BW` (rows, boundary dofs) has the subdomain's part of `scaled_constraints`, on the active rows.
        """
        columns, kernel = self.columns[i], self._blocks[i].R.shape[1]
        jump = np.zeros((self._sizes[i], len(columns)))
        for rows, numbers, values in self._jumps[i]:
            jump[np.ix_(rows, np.searchsorted(columns, numbers))] = values
        Z = np.asfortranarray(-(BW.T @ jump))
        soft = self._V[i][:, kernel:]
        at = np.searchsorted(columns, self._first[i] + kernel + np.arange(soft.shape[1]))
        Z[:, at] += soft
        return Z

    def translations(self, comm: MPI.Intracomm) -> Float:
        """Express the c translations of the cell by amplitudes (u, c) of the modes.  Collective."""
        subdomains = [block.subdomain for block in self._blocks]
        c = subdomains[0].problem.components if subdomains else 0
        amplitudes = np.zeros((self.total, comm.allreduce(c, MPI.MAX)))
        for first, s in zip(self._first, subdomains, strict=True):
            amplitudes[first : first + s.R.shape[1]] = np.stack([s.R[i::c].sum(axis=0) for i in range(c)], axis=1)
        return np.asarray(distributed_arrays.allreduce_sum(comm, amplitudes)[self.reaching])


def subdomain_blocks(
    operators: InterfaceOperators, scaling: StiffnessScaled, rows: Sequence[Int]
) -> list[SubdomainBlocks]:
    """Cut the blocks of every local subdomain out of B and W^-1 B D^-1; `rows` are `Neighbours.rows`.  Collective."""
    B, BW = operators.B.tocsc(), scaled_constraints(scaling)
    blocks = []
    for i, (subdomain, operator) in enumerate(zip(operators.subdomains, operators.with_springs, strict=True)):
        constraints, scaled = (local_columns(matrix, operators.slices[i], rows[i]) for matrix in (B, BW))
        dofs, facewise = operators.dofs[i], operators.facewise[i]
        blocks.append(SubdomainBlocks(subdomain, dofs, operator, constraints, scaled, facewise))
    return blocks


def scaled_constraints(scaling: StiffnessScaled) -> csc_matrix:
    """Compute W^-1 B D^-1 (local rows, boundary dofs) from `scaling`, 0 on inactive rows.  Collective."""
    jump_operator = scaling.jump_operator
    owned = jump_operator.owned[1] - jump_operator.owned[0]
    inverse = scaling.W_inverse.tocoo()
    at = np.searchsorted(jump_operator.rows, jump_operator.owned[0])
    shape = (len(jump_operator.rows), jump_operator.global_rows)
    wide = csr_matrix((inverse.data, (inverse.row + at, inverse.col + jump_operator.owned[0])), shape=shape)
    W_inverse = add_shared_rows(jump_operator.comm, wide, jump_operator.rows, jump_operator.is_shared_row, owned)
    return (W_inverse[:, jump_operator.rows] @ scaling.BD).tocsc()


def kernels_and_soft_modes(
    blocks: Sequence[SubdomainBlocks], neighbours: Neighbours, threshold: float, thresholds: Thresholds = DEFAULTS
) -> list[Float]:
    """Compute the modes V (n, k + m) of every local subdomain.  Collective.

    On its n boundary dofs, a subdomain has k kernel modes, followed by m soft modes with theta < `threshold`.

    Raises:
        MeshError: a face neighbourhood on some rank is not a valid subdomain.
    """
    parts = list(zip(blocks, neighbours.common, strict=True))
    problems = mpi_errors.agree(neighbours.comm, lambda: [eigenproblem(*part, thresholds) for part in parts])
    received: list[list[tuple[int, Float32]]] = [[] for _ in blocks]  # the neighbours' parts of M^-1, on common rows

    def messages() -> Iterator[tuple[int, int, Float32]]:
        for i, problem in enumerate(problems):
            for s, share in problem.preconditioner_shares():
                yield i, s, share

    neighbours.exchange(messages(), lambda i, sender, share: received[i].append((sender, share)))
    V = []
    for block, problem, shares in zip(blocks, problems, received, strict=True):
        modes = problem.modes(shares, threshold)
        # Like kernels, soft modes are scaled to displacements of about 1, so that all energies have the unit of stress.
        # Powers of two change no digit.
        exponent = np.frexp(np.abs(modes).max(axis=0, initial=0.0))[1]
        V.append(np.hstack([block.R, np.ldexp(modes, -exponent)]))
        shares.clear()
    return V


def local_columns(matrix: csc_matrix, span: slice, rows: Int) -> csr_matrix:
    """Cut the columns `span` out of a matrix; `rows` are sorted, and contain all nonzeros of these columns."""
    indptr = matrix.indptr[span.start : span.stop + 1]
    part = slice(indptr[0], indptr[-1])
    at = np.searchsorted(rows, matrix.indices[part])
    shape = (len(rows), span.stop - span.start)
    return csc_matrix((matrix.data[part], at, indptr - indptr[0]), shape=shape).tocsr()
