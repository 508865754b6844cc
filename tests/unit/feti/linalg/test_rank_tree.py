"""The groups in which ranks meet."""

from __future__ import annotations

import numpy as np
import pytest

from feti_homog.feti.linalg.rank_tree import nested_groups


def on_a_grid(wide, high):
    """What each rank shares: a number for every side between ranks on a torus of so many."""
    shared = [[] for _ in range(wide * high)]
    for x in range(wide):
        for y in range(high):
            for number, (i, j) in enumerate(((x + 1, y), (x, y + 1))):
                for rank in {x + wide * y, i % wide + wide * (j % high)}:
                    shared[rank].append(2 * (x + wide * y) + number)
    return [np.array(sorted(set(numbers))) for numbers in shared]


@pytest.mark.parametrize("ranks", [1, 2, 3, 5, 8, 24])
@pytest.mark.parametrize("share", ["grid", "nothing", "all"])
def test_every_rank_meets_ever_larger_groups(ranks, share):
    """Halves have met before, the first rank of each stands for it, and at last all have met."""
    every = {"grid": on_a_grid(ranks, 1), "nothing": [np.zeros(0, int)] * ranks, "all": [np.arange(4)] * ranks}[share]
    groups = nested_groups(every)
    for rank in range(ranks):
        own = [group for group in groups if rank in group[0]]
        sizes = [len(members) for members, _ in own]
        assert sizes == sorted(set(sizes)) and (not sizes or sizes[-1] == ranks)
        for before, (members, second) in zip([[rank], *(m for m, _ in own)], own, strict=False):
            assert before in (members[:second], members[second:])
            assert 0 < second < len(members)


def test_neighbours_meet_first():
    """On a torus of 8 x 8 the two last halves share no more than two straight cuts, and halves are even."""
    members, second = nested_groups(on_a_grid(8, 8))[-1]
    assert len(members) == 64
    shared = on_a_grid(8, 8)
    first, last = (set(np.concatenate([shared[r] for r in half])) for half in (members[:second], members[second:]))
    assert len(first & last) <= 20
    assert 28 <= second <= 36
