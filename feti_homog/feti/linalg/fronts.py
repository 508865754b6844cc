"""Elimination where two groups of ranks meet: the fronts of the multifrontal method.

With the blocks A_EE, A_FE, A_FF of the front's matrix, for the unknowns E that are eliminated and those that are left,

    L L^T = A_EE,  half = A_FE L^-T,  and A_FF - half half^T remains.

`FrontOfOne` has L and half on one rank.  Large fronts are those of `shared_fronts`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dsyrk, dtrsm

from feti_homog.feti.linalg import dense_cholesky
from feti_homog.feti.linalg.packed_symmetric import full_from_lower
from feti_homog.feti.linalg.rank_tree import Meeting
from feti_homog.feti.linalg.remainder import FrontLayout, Remainder
from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class Front(ABC):
    """A front of a meeting.

    Attributes:
        meeting: where it is.
        places: as in `FrontLayout`.
        eliminated, left: e and f.
        is_definite: whether A_EE is positive definite, as far as this rank knows.
    """

    meeting: Meeting
    places: tuple[Int, Int]
    eliminated: int
    left: int
    is_definite: bool

    def forward(self, left: Float) -> tuple[Float, Float]:
        """y = L^-1 f_E, and what the group leaves of right-hand sides of which this rank's half has `left` (b, k); both
        on the first rank, (0, k) on the others.  Collective in the meeting."""
        return self._eliminate(self._summed(left))

    def backward(self, y: Float, x: Float) -> Float:
        """The unknowns (b, k) of this rank's half on its first rank, (0, k) on the others, for y of `forward` and the
        unknowns x (f, k) that the group had left, on the first rank.  Collective in the meeting."""
        comm, second = self.meeting
        eliminated = self._substitute(y, x)
        if comm.rank == 0:
            both = np.concatenate([eliminated, x])
            comm.Send(both[self.places[1]], second)
            return np.asarray(both[self.places[0]])
        found = np.empty((len(self.places[1]) if comm.rank == second else 0, x.shape[1]))
        if comm.rank == second:
            comm.Recv(found, 0)
        return found

    def _summed(self, left: Float) -> Float:
        """(n, k) the sum of what both halves have left, on the first rank."""
        comm, second = self.meeting
        if comm.rank == second:
            comm.Send(np.ascontiguousarray(left), 0)
        if comm.rank:
            return np.zeros((0, left.shape[1]))
        other = np.empty((len(self.places[1]), left.shape[1]))
        comm.Recv(other, second)
        f = np.zeros((self.eliminated + self.left, left.shape[1]))
        f[self.places[0]] += left
        f[self.places[1]] += other
        return f

    @abstractmethod
    def _eliminate(self, f: Float) -> tuple[Float, Float]:
        """y and f_F - half y for f (n, k) of the first rank, there."""

    @abstractmethod
    def _substitute(self, y: Float, x: Float) -> Float:
        """x_E = L^-T (y - half^T x) for y (e, k) and x (f, k) of the first rank, there."""

    @abstractmethod
    def destroy(self) -> None:
        """Free what Python does not.  Collective in the meeting."""


@dataclass(frozen=True)
class FrontOfOne(Front):
    """A front of the first rank of a meeting.

    Attributes:
        L: (e, e), lower; (0, 0) on all ranks but the first.
        half: (f, e); so, too.
    """

    L: Float
    half: Float

    def _eliminate(self, f: Float) -> tuple[Float, Float]:
        y = _triangular(self.L, f[: len(self.L)])
        return y, f[len(self.L) :] - self.half @ y

    def _substitute(self, y: Float, x: Float) -> Float:
        return _triangular(self.L, y - self.half.T @ x, transposed=True)

    def destroy(self) -> None:
        """There is nothing."""


def eliminated_alone(meeting: Meeting, layout: FrontLayout, A: Float) -> tuple[Front, Remainder]:
    """The front of a matrix that the first rank has, (n, n), the others (0, n)."""
    e, left = layout.eliminated, len(layout.unknowns)
    own = np.arange(0 if meeting.comm.rank else left)
    if meeting.comm.rank:
        nothing = np.zeros((0, 0))
        front = FrontOfOne(meeting, layout.places, e, left, True, nothing, nothing)
        return front, layout.remainder(own, np.zeros((0, left)))
    L, half, rest = (np.asfortranarray(block) for block in (A[:e, :e], A[e:, :e], A[e:, e:]))
    L, is_definite = cholesky(L)
    if half.size:
        half = dtrsm(1.0, L, half, side=1, lower=1, trans_a=1, overwrite_b=1)
        rest = full_from_lower(dsyrk(-1.0, half, beta=1.0, c=rest, lower=1, overwrite_c=1))
    front = FrontOfOne(meeting, layout.places, e, left, is_definite, L, half)
    return front, layout.remainder(own, np.ascontiguousarray(rest))


def cholesky(A: Float) -> tuple[Float, bool]:
    """Lower L with L L^T = A (n, n), which is overwritten, and whether A is positive definite; else L is NaN."""
    try:
        return dense_cholesky.cholesky(A), True
    except np.linalg.LinAlgError:
        return np.full_like(A, np.nan), False


def _triangular(L: Float, f: Float, transposed: bool = False) -> Float:
    """L^-1 f, or L^-T f, for f (e, k)."""
    return dtrsm(1.0, L, f, lower=1, trans_a=transposed) if f.size else f
