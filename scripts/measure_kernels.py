"""Measures on one rank the sizes at which the solver should switch between dense kernels.

    .venv/bin/python scripts/measure_kernels.py [--dofs N]

Prints, for each such constant of `feti_homog/feti/thresholds.py`, the times on both sides of it.
"""

import argparse
from collections.abc import Callable
from time import perf_counter

import numpy as np
from scipy.linalg.blas import dsymm, dsymv, dtrmm
from scipy.linalg.lapack import dtrtri

from feti_homog.feti import thresholds
from feti_homog.feti.linalg.dense_matrices import full_from_lower

COLUMNS = (1, 2, 3, 4, 6, 8, 12)


def best(work: Callable[[], object], seconds: float = 0.2) -> float:
    """Return the shortest time of `work` in microseconds, over runs for `seconds` seconds, at least three."""
    times: list[float] = []
    while len(times) < 3 or sum(times) < seconds:
        start = perf_counter()
        work()
        times.append(perf_counter() - start)
    return 1e6 * min(times)


def compare(title: str, pairs: list[tuple[int, float, float]], small: str, large: str) -> None:
    """Print the times of two kernels for each size."""
    print(f"\n{title}\n{'size':>6}{small:>16}{large:>16}   us")
    for size, first, second in pairs:
        print(f"{size:6}{first:16.1f}{second:16.1f}")


def dense_columns(n: int) -> list[tuple[int, float, float]]:
    """Compare symmetric products with one column after the other and with all columns at once."""
    A, found = np.asfortranarray(np.random.default_rng(0).random((n, n))), []
    for k in COLUMNS:
        X = np.asfortranarray(np.random.default_rng(1).random((n, k)))
        one_by_one = best(lambda X=X: [dsymv(1.0, A, x, lower=1) for x in X.T])
        found.append((k, one_by_one, best(lambda X=X: dsymm(1.0, A, X, lower=1))))
    return found


def triangles() -> list[tuple[int, float, float]]:
    """Compare LAPACK's inverse of a triangular matrix with the inverse by two halves."""
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
    """Measure all kernels."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dofs", type=int, default=3000, help="ten times the rows of the matrix")
    dofs = parser.parse_args().dofs
    title = f"DENSE_COLUMNS_ONE_BY_ONE = {thresholds.DENSE_COLUMNS_ONE_BY_ONE}"
    compare(title, dense_columns(max(dofs // 10, 1)), "one by one", "at once")
    compare(f"BLOCK_ROWS = {thresholds.BLOCK_ROWS}", triangles(), "dtrtri", "halves")
    A = np.asfortranarray(np.random.default_rng(0).random((dofs // 2, dofs // 2)))
    print(f"\nBLOCK_ROWS = {thresholds.BLOCK_ROWS}\n{'size':>6}{'us':>16}")
    for block in (16, 32, 64, 128, 256):
        print(f"{block:6}{best(lambda block=block: full_from_lower(A, block)):16.1f}")


if __name__ == "__main__":
    main()
