"""Local eigenproblems that find what slows the preconditioned dual operator down, of all subdomains.

With the averaged soft modes in equilibrium, the largest eigenvalue of the preconditioned dual operator is at most
1 + N / tau whatever the geometry and the materials, N being the largest number of subdomains that share nodes with one,
itself included (GenEO: Spillane & Rixen, IJNME 95, 2013).  Measured, it is about 1 / tau.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from mpi4py import MPI
from scipy.sparse import csc_matrix, csr_matrix

from feti_homog.feti.coarse.local_eigenproblems import (
    FaceEigenproblems,
    SubdomainBlocks,
    SubdomainEigenproblem,
    eigenproblem,
)
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.neighbours import Neighbours
from feti_homog.feti.linalg.distributed_matrix import add_shared_rows
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.scaled import StiffnessScaled
from feti_homog.feti.thresholds import DEFAULTS, Thresholds
from feti_homog.parallel.mpi_errors import agree
from feti_homog.typing import Float, Float32, Int


def subdomain_blocks(
    comm: MPI.Intracomm,
    jump_operator: JumpOperator,
    operators: InterfaceOperators,
    scaling: StiffnessScaled,
    rows: Sequence[Int],
) -> list[SubdomainBlocks]:
    """Return the blocks of this rank's subdomains; `rows` are those of their nodes. Collective."""
    B, BW = operators.B.tocsc(), scaled_constraints(comm, jump_operator, scaling)
    blocks = []
    for i, (subdomain, operator) in enumerate(zip(operators.subdomains, operators.with_springs, strict=True)):
        own, scaled = (local_columns(matrix, operators.slices[i], rows[i]) for matrix in (B, BW))
        blocks.append(SubdomainBlocks(subdomain, operators.dofs[i], operator, own, scaled, operators.facewise[i]))
    return blocks


def scaled_constraints(comm: MPI.Intracomm, jump_operator: JumpOperator, scaling: StiffnessScaled) -> csc_matrix:
    """(local rows, boundary dofs) W^-1 B D^-1 of the active rows of the scaling, 0 on the others.  Collective."""
    owned = jump_operator.owned[1] - jump_operator.owned[0]
    inverse = scaling.W_inverse.tocoo()
    at = np.searchsorted(jump_operator.rows, jump_operator.owned[0])
    shape = (len(jump_operator.rows), jump_operator.global_rows)
    wide = csr_matrix((inverse.data, (inverse.row + at, inverse.col + jump_operator.owned[0])), shape=shape)
    W_inverse = add_shared_rows(comm, wide, jump_operator.rows, jump_operator.is_shared_row, owned)[
        :, jump_operator.rows
    ]
    return (W_inverse @ scaling.BD).tocsc()


def kernels_and_soft_modes(
    blocks: Sequence[SubdomainBlocks],
    neighbours: Neighbours,
    threshold: float,
    thresholds: Thresholds = DEFAULTS,
) -> list[Float]:
    """V: for each subdomain of this rank (n, k + m) its kernel and its m modes below the threshold.  Collective.

    Raises:
        MeshError: the neighbourhood of a face, on any rank, is no subdomain.
    """
    problems = agree(neighbours.comm, _eigenproblems, blocks, neighbours, thresholds)
    # Of the neighbours' shares in M^-1 the rows that both have.
    received: list[list[tuple[int, Float32]]] = [[] for _ in blocks]

    def messages() -> Iterator[tuple[int, int, Float32]]:
        for i, problem in enumerate(problems):
            for s, share in problem.preconditioner_shares():
                yield i, s, share

    neighbours.exchange(messages(), lambda i, sender, share: received[i].append((sender, share)))
    V = []
    for block, problem, shares in zip(blocks, problems, received, strict=True):
        V.append(np.hstack([block.R, problem.modes(shares, threshold)]))
        shares.clear()
    return V


def _eigenproblems(
    blocks: Sequence[SubdomainBlocks], neighbours: Neighbours, thresholds: Thresholds
) -> list[SubdomainEigenproblem | FaceEigenproblems]:
    """Those of this rank's subdomains, without communication."""
    return [eigenproblem(block, common, thresholds) for block, common in zip(blocks, neighbours.common, strict=True)]


def local_columns(matrix: csc_matrix, span: slice, rows: Int) -> csr_matrix:
    """Return the columns `span` on the sorted `rows`, which hold all their entries."""
    indptr = matrix.indptr[span.start : span.stop + 1]
    part = slice(indptr[0], indptr[-1])
    at = np.searchsorted(rows, matrix.indices[part])
    shape = (len(rows), span.stop - span.start)
    return csc_matrix((matrix.data[part], at, indptr - indptr[0]), shape=shape).tocsr()
