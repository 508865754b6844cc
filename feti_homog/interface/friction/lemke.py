"""Admissible statuses of debonded faces by Lemke's complementary pivoting (Cottle, Pang & Stone, 1992).

With the parts of the slip a, b >= 0, g_t = slip + a - b, the conditions of a node are those of Klarbring (1986),

    w = (p, mu p - f_t, mu p + f_t) >= 0,   z = (g_n, a, b) >= 0,   w z = 0,   w = q + M z.

The search by pivots of `coulomb_faces` is quicker and nearly always succeeds; this is what is left if it comes back to
where it was.
"""

from __future__ import annotations

import numpy as np

from feti_homog.interface.contact.states import Status
from feti_homog.interface.friction.status_system import BACKWARD, FORWARD, OPEN_FACE, STICK, StatusSystem, free_rows
from feti_homog.typing import Bool, Float, Int

# Pivots below this are rounding, relative to the largest entry of their column.
LEAST_PIVOT = 1e-11
PIVOTS_PER_ROW = 20
# Rays on which the method begins, one after the other, and the least entry of their directions.
COVERS, LEAST_COVER = 20, 0.01


def complementary(
    S: Float, friction: Float, allowed: Bool, by_stress: Bool, start: Float, rows: Float
) -> Status | None:
    """(n,) statuses that solve the problem; None if the method ends on a ray.

    Args:
        S: (m, m) of `CoulombFaces`.
        allowed: (n, 4) statuses that a node may have.
        by_stress: (v,) which loads are given by what works on them.
        start: (m,) jumps of nodes that stick, the given strains, and 0.
        rows: (m,) what is given of (S x)_E.
    """
    n, m = len(friction), len(S)
    base = first_guess(friction, allowed)
    system = StatusSystem(S, *free_rows(base, friction, by_stress))
    # Faces without friction have no unknown parts of their slip.
    entry, sign, kind = _unknowns(allowed & (base == STICK)[:, None] | allowed & _touching(allowed, base))
    columns = np.zeros((m, 1 + len(entry)))
    columns[:, 0] = start
    columns[entry, 1 + np.arange(len(entry))] = sign
    given = np.zeros_like(columns)
    given[:, 0] = rows
    solutions = [system.solve(*pair)[0] for pair in zip(columns.T, given.T, strict=True)]
    forces = S[: 2 * n] @ np.stack(solutions, axis=1)
    pressure, node = forces[::2], entry // 2
    sliding = friction[node, None] * pressure[node] + sign[:, None] * forces[1::2][node]
    w = np.where((kind == OPEN_FACE)[:, None], pressure[node], sliding)
    covers = np.random.default_rng(0).uniform(LEAST_COVER, 1.0, (COVERS, len(w)))
    found = (lemke(w[:, 1:], w[:, 0], cover) for cover in (np.ones(len(w)), *covers))
    z = next((each for each in found if each is not None), None)
    if z is None:
        return None
    status = base.copy()
    for each in (FORWARD, BACKWARD, OPEN_FACE):
        status[node[(kind == each) & (z > 0.0)]] = each
    return status


def first_guess(friction: Float, allowed: Bool) -> Status:
    """(n,) STICK of nodes that may touch, FORWARD where nothing rubs, OPEN_FACE of the others."""
    touching = np.where(friction > 0.0, STICK, FORWARD)
    return np.where(allowed[:, FORWARD] | allowed[:, STICK] | allowed[:, BACKWARD], touching, OPEN_FACE).astype(np.int8)


def _touching(allowed: Bool, base: Status) -> Bool:
    """(n, 4) OPEN_FACE of faces without friction that touch."""
    found = np.zeros_like(allowed)
    found[:, OPEN_FACE] = base == FORWARD
    return found


def _unknowns(allowed: Bool) -> tuple[Int, Int, Int]:
    """Entry of x that each z adds to, its sign, and the status that it is of."""
    parts = []
    for status, offset, sign in ((OPEN_FACE, 0, 1), (FORWARD, 1, 1), (BACKWARD, 1, -1)):
        node = np.flatnonzero(allowed[:, status])
        parts.append((2 * node + offset, np.full(len(node), sign), np.full(len(node), status)))
    entry, signs, kind = (np.concatenate(each) for each in zip(*parts, strict=True))
    return entry, signs, kind


def lemke(M: Float, q: Float, cover: Float) -> Float | None:
    """(k,) z >= 0 with w = q + M z >= 0 and w z = 0; None if the method ends on a ray or comes to no end.

    It begins on the ray w = q + z_0 `cover` (k,).
    """
    k = len(q)
    if not k or q.min() >= 0.0:
        return np.zeros(k)
    tableau = np.hstack([np.eye(k), -M, -cover[:, None], q[:, None]])
    basis = np.arange(k)
    row, entering = int(np.argmin(q / cover)), 2 * k
    for _ in range(PIVOTS_PER_ROW * k):
        _pivot(tableau, row, entering)
        left, basis[row] = basis[row], entering
        if left == 2 * k:
            z = np.zeros(2 * k + 1)
            z[basis] = tableau[:, -1]
            return z[k : 2 * k]
        entering = left + k if left < k else left - k
        column = tableau[:, entering]
        able = column > LEAST_PIVOT * max(1.0, np.abs(column).max())
        if not able.any():
            return None
        ratio = np.where(able, tableau[:, -1] / np.where(able, column, 1.0), np.inf)
        tied = np.flatnonzero(ratio <= ratio.min() + LEAST_PIVOT * np.abs(q).max())
        artificial = tied[basis[tied] == 2 * k]
        row = int(artificial[0] if len(artificial) else tied[np.argmax(column[tied])])
    return None


def _pivot(tableau: Float, row: int, column: int) -> None:
    """Make a column that of the identity with 1 in a row."""
    tableau[row] /= tableau[row, column]
    factors = tableau[:, column].copy()
    factors[row] = 0.0
    tableau -= np.outer(factors, tableau[row])
