"""The estimates of `check` grow with what a case has to do, and name ranks that it can use."""

from __future__ import annotations

import pytest

from feti_homog.homogenization import cost_model


def estimate(dofs=(100_000,), subdomains=(9,), bodies=9, applications=36):
    return cost_model.estimate(dofs, subdomains, 10_000, bodies, applications)


def test_more_work_takes_more_time_and_memory():
    base = estimate()
    assert estimate(applications=72).seconds > base.seconds and estimate(dofs=(200_000,)).memory > base.memory
    halves = estimate(dofs=(50_000, 50_000), subdomains=(5, 4))
    assert halves.seconds < base.seconds and halves.memory < base.memory and halves.ranks == base.ranks


@pytest.mark.parametrize(("dofs", "bodies", "ranks"), [(1000, 9, 1), (400_000, 31, 8), (10_000_000, 31, 31)])
def test_suggested_ranks_grow_with_the_size_up_to_the_bodies(dofs, bodies, ranks):
    assert estimate(dofs=(dofs,), bodies=bodies).ranks == ranks


def test_words_tell_time_memory_and_better_ranks():
    first, second = cost_model.estimate_lines(cost_model.Estimate(400.0, 3e9, 8), 2)
    assert "on 2 ranks about 7 min, 2.8 GiB" in first and "8 would suit it" in second
