"""Loads divided among ranks; ranges of numbers."""

import numpy as np

from feti_homog.system.parallel.distributed_arrays import balanced, even, ranges


def test_loads_are_balanced():
    """No rank could do better by giving its smallest load away."""
    loads = np.random.default_rng(0).integers(50, 100, 40)
    sums = np.bincount(balanced(loads, 3), loads)
    assert len(sums) == 3 and sums.max() - sums.min() <= loads.max()
    assert balanced(np.array([5, 5, 9]), 2).tolist() == [1, 1, 0]
    assert len(balanced(np.zeros(0, np.int64), 2)) == 0


def test_ranges_are_even_and_follow_each_other():
    for count, parts in ((10, 3), (2, 5), (0, 2), (7, 1)):
        ends = even(count, parts)
        assert len(ends) == parts + 1 and ends[0] == 0 and ends[-1] == count
        assert np.diff(ends).min() >= 0 and np.ptp(np.diff(ends)) <= 1
    assert ranges(np.array([3, 10, 7]), np.array([2, 0, 3])).tolist() == [3, 4, 7, 8, 9]
    assert len(ranges(np.zeros(0, np.int64), np.zeros(0, np.int64))) == 0
