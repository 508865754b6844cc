"""What groups of ranks have left of a matrix that they eliminate, and the matrix where two groups meet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from feti_homog.feti.linalg.rank_tree import Meeting
from feti_homog.parallel.exchange import exchange
from feti_homog.typing import Float, Int


class Remainder(NamedTuple):
    """What a group has left of its part of a matrix once it has eliminated what it alone has.

    `unknowns` (b,) are the numbers of the others, ascending, `copies` (b,) how many ranks have each, `met` (b,) how
    many of these are in the group: all as the group's first rank knows them.  The symmetric (b, b) matrix that remains
    is dealt out in the group; of this rank are the `rows` (r, b) `own` (r,).
    """

    unknowns: Int
    copies: Int
    met: Int
    own: Int
    rows: Float


class FrontLayout(NamedTuple):
    """The order of the n unknowns of a front: first those that are eliminated, e of them.

    Attributes:
        places: (b1,), (b2,) of the unknowns of each half.
        eliminated: e.
        unknowns, copies, met: (n - e,) of those left, as in `Remainder`.
    """

    places: tuple[Int, Int]
    eliminated: int
    unknowns: Int
    copies: Int
    met: Int

    @classmethod
    def of(cls, meeting: Meeting, own: Remainder) -> FrontLayout:
        """Where two groups meet: what no rank of a third has is eliminated.  Collective in the meeting."""
        halves = [meeting.comm.bcast(own[:3], root) for root in (0, meeting.second)]
        unknowns = np.union1d(halves[0][0], halves[1][0])
        numbers = [np.searchsorted(unknowns, half[0]) for half in halves]
        copies, met = np.zeros((2, len(unknowns)), np.int64)
        for at, (_, of_half, met_there) in zip(numbers, halves, strict=True):
            copies[at] = of_half
            met[at] += met_there
        left = met < copies
        e = int((~left).sum())
        place = np.where(left, e + np.cumsum(left), np.cumsum(~left)) - 1
        return cls((place[numbers[0]], place[numbers[1]]), e, unknowns[left], copies[left], met[left])

    @property
    def n(self) -> int:
        """Unknowns of the front."""
        return self.eliminated + len(self.unknowns)

    def remainder(self, own: Int, rows: Float) -> Remainder:
        """What is left, `own` and `rows` being this rank's."""
        return Remainder(self.unknowns, self.copies, self.met, own, rows)


def summed(meeting: Meeting, own: Remainder, layout: FrontLayout, owner: Int) -> Float:
    """(r, n) the rows of this rank of the sum of what both halves have left; `owner` (n,) tells whose each row is.
    Collective in the meeting."""
    comm, second = meeting
    mine = np.flatnonzero(owner == comm.rank)
    A = np.zeros((len(mine), layout.n))
    for half, place in enumerate(layout.places):
        is_here = (comm.rank >= second) == bool(half)
        some, rows = (own.own, own.rows) if is_here else (np.zeros(0, np.int64), np.zeros((0, len(place))))
        some, rows = exchange(comm, owner[place[some]], some, rows)
        # Row by row: all at once would be copied twice.
        for row, values in zip(np.searchsorted(mine, place[some]).tolist(), rows, strict=True):
            A[row, place] += values
    return A
