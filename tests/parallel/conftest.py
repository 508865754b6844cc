"""Fixtures of the tests under mpirun."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="module")
def narrow():
    """The narrow cell at the default threshold."""
    from support.coarse_space_cells import Narrow

    from feti_homog.feti.thresholds import DEFAULTS

    cell = Narrow(DEFAULTS.soft_mode)
    yield cell
    cell.solver.destroy()
