"""When a Krylov method is taken to stall."""

import numpy as np

from feti_homog.feti.krylov import Stall


def stalls_at(norms) -> int | None:
    """Return the first iteration for four iterations before which no norm has halved."""
    stall = Stall(4)
    return next((iteration for iteration, norm in enumerate(norms) if stall.is_reached(iteration, norm)), None)


def test_norms_stall_if_they_do_not_halve_in_time():
    assert stalls_at(0.8 ** np.arange(100)) is None
    assert stalls_at([1.0, 3.0, 5.0, 0.4, 2.0, 9.0, 0.1]) is None
    assert stalls_at([1.0, 0.1, 0.09, 0.08, 0.07, 0.06]) == 5
    assert stalls_at(np.ones(9)) == 4
    stall = Stall(4)
    assert [stall.is_reached(iteration, 1.0) for iteration in range(5)][-1]
    stall.reset()
    assert not any(stall.is_reached(iteration, 1.0) for iteration in range(4))
