"""Measures on one rank where the dense and sparse kernels of the solver change their ways.

    .venv/bin/python scripts/measure_kernels.py [--dofs N]

Prints, for each such constant of `feti_homog/feti/thresholds.py`, the times on both sides of it.
"""

import argparse
from collections.abc import Callable
from time import perf_counter

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.linalg.blas import dsymm, dsymv, dtrmm
from scipy.linalg.lapack import dtrtri
from scipy.sparse import csr_matrix, diags, kronsum

from feti_homog.feti import thresholds
from feti_homog.feti.linalg.dense_matrices import full_from_lower
from feti_homog.feti.linalg.distributed_solver import DistributedSolver
from feti_homog.feti.linalg.sparse_direct import DirectSolver

COLUMNS = (1, 2, 3, 4, 6, 8, 12)


def best(work: Callable[[], object], seconds: float = 0.2) -> float:
    """Shortest time of `work` in microseconds, of as many runs as take so many seconds, three at least."""
    times: list[float] = []
    while len(times) < 3 or sum(times) < seconds:
        start = perf_counter()
        work()
        times.append(perf_counter() - start)
    return 1e6 * min(times)


def compare(title: str, pairs: list[tuple[int, float, float]], small: str, large: str) -> None:
    """Print the times of two ways for each size."""
    print(f"\n{title}\n{'size':>6}{small:>16}{large:>16}   us")
    for size, first, second in pairs:
        print(f"{size:6}{first:16.1f}{second:16.1f}")


def sparse_columns(solver: DirectSolver | DistributedSolver, matrix: csr_matrix) -> list[tuple[int, float, float]]:
    """Solves for columns one after the other, and all at once."""
    found = []
    for k in COLUMNS:
        B = np.asfortranarray(np.random.default_rng(0).random((matrix.shape[0], k)))
        times = []
        for limit in (k, 0):
            solver.max_columns_one_by_one = limit
            times.append(best(lambda B=B: solver.solve(B)))
        found.append((k, times[0], times[1]))
    return found


def dense_columns(n: int) -> list[tuple[int, float, float]]:
    """Symmetric products with columns one after the other, and all at once."""
    A, found = np.asfortranarray(np.random.default_rng(0).random((n, n))), []
    for k in COLUMNS:
        X = np.asfortranarray(np.random.default_rng(1).random((n, k)))
        one_by_one = best(lambda X=X: [dsymv(1.0, A, x, lower=1) for x in X.T])
        found.append((k, one_by_one, best(lambda X=X: dsymm(1.0, A, X, lower=1))))
    return found


def triangles() -> list[tuple[int, float, float]]:
    """LAPACK's inverse of a triangle, and that by its two halves."""
    found = []
    for n in (16, 32, 48, 64, 96, 128, 256):
        U = np.asfortranarray(np.triu(np.random.default_rng(0).random((n, n)))) + n * np.eye(n)
        h = n // 2
        first, corner, last = (np.asfortranarray(part) for part in (U[:h, :h], U[:h, h:], U[h:, h:]))

        def halves(first: object = first, corner: object = corner, last: object = last) -> object:
            a, b = dtrtri(first, lower=0)[0], dtrtri(last, lower=0)[0]
            return dtrmm(1.0, b, dtrmm(-1.0, a, corner), side=1)

        found.append((n, best(lambda U=U: dtrtri(U, lower=0)), best(halves)))
    return found


def main() -> None:
    """Measure all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dofs", type=int, default=3000, help="of the sparse matrix and, a tenth, of the dense one")
    dofs = parser.parse_args().dofs
    m = round(dofs**0.5)
    line = diags([-1, 2.1, -1], [-1, 0, 1], (m, m))
    matrix = kronsum(line, line).tocsr()
    n = matrix.shape[0]
    cholmod = DirectSolver(matrix, "measure_")
    PETSc.Options("measure_")["pc_factor_mat_solver_type"] = "mumps"
    mumps = DistributedSolver(MPI.COMM_SELF, n, "measure_")
    mumps.factor(np.arange(n), matrix)
    for solver, name in ((cholmod, "CHOLMOD"), (mumps, "MUMPS")):
        title = f"{name}_COLUMNS_ONE_BY_ONE = {getattr(thresholds, f'{name}_COLUMNS_ONE_BY_ONE')}"
        compare(title, sparse_columns(solver, matrix), "one by one", "at once")
    title = f"DENSE_COLUMNS_ONE_BY_ONE = {thresholds.DENSE_COLUMNS_ONE_BY_ONE}"
    compare(title, dense_columns(max(dofs // 10, 1)), "one by one", "at once")
    compare(f"TRIANGLE_INVERSE_ROWS = {thresholds.TRIANGLE_INVERSE_ROWS}", triangles(), "dtrtri", "halves")
    A = np.asfortranarray(np.random.default_rng(0).random((dofs // 2, dofs // 2)))
    print(f"\nMIRRORED_BLOCK_ROWS = {thresholds.MIRRORED_BLOCK_ROWS}\n{'size':>6}{'us':>16}")
    for block in (16, 32, 64, 128, 256):
        print(f"{block:6}{best(lambda block=block: full_from_lower(A, block)):16.1f}")


if __name__ == "__main__":
    main()
