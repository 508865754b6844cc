"""Division of loads among ranks, and ranges of numbers."""

import heapq

import numpy as np

from feti_homog.typing import AnyInt, Int


def balanced(load: AnyInt, n_ranks: int) -> Int:
    """Assign loads (n,) to ranks (n,): in descending order, to the rank with the least load."""
    ranks = np.zeros(len(load), np.int64)
    heap = [(0, rank) for rank in range(n_ranks)]
    for k in np.argsort(-load, kind="stable"):
        total, rank = heap[0]
        ranks[k] = rank
        heapq.heapreplace(heap, (total + int(load[k]), rank))
    return ranks


def even(count: int, parts: int) -> Int:
    """Return the bounds (parts + 1,) of ranges that divide 0 .. count - 1; lengths differ by at most 1."""
    return np.arange(parts + 1) * count // parts


def ranges(start: Int, count: Int) -> Int:
    """Concatenate the ranges start[i] .. start[i] + count[i] - 1 for start, count (n,)."""
    ends = np.cumsum(count)
    shift: Int = np.repeat(start - ends + count, count)
    return shift + np.arange(count.sum(), dtype=np.int64)
