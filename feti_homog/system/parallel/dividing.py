"""Loads divided among ranks, and ranges of numbers one after the other."""

import heapq

import numpy as np

from feti_homog.typing import AnyInt, Int


def balanced(load: AnyInt, n_ranks: int) -> Int:
    """(n,) rank of each of these loads (n,): the largest goes first, each to the least loaded rank."""
    ranks = np.zeros(len(load), np.int64)
    heap = [(0, rank) for rank in range(n_ranks)]
    for k in np.argsort(-load, kind="stable"):
        total, rank = heap[0]
        ranks[k] = rank
        heapq.heapreplace(heap, (total + int(load[k]), rank))
    return ranks


def even(count: int, parts: int) -> Int:
    """(parts + 1,) where ranges of the numbers 0 .. count - 1 begin, and the last ends.

    Their lengths differ by one at most.
    """
    return np.arange(parts + 1) * count // parts


def ranges(start: Int, count: Int) -> Int:
    """start[0] .. start[0] + count[0] - 1, start[1] .. and so on."""
    ends = np.cumsum(count)
    shift: Int = np.repeat(start - ends + count, count)
    return shift + np.arange(count.sum(), dtype=np.int64)
