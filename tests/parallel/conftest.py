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


@pytest.fixture(scope="module")
def torn():
    """torn(**case): the torn cell of a case, made at the first call of the module and shared by its tests."""
    from mpi4py import MPI
    from support import torn_cells

    cells = {}

    def torn_cell(**case):
        key = repr(sorted(case.items()))
        if key not in cells:
            cells[key] = torn_cells.tear(MPI.COMM_WORLD, **case)
        return cells[key]

    yield torn_cell
    for cell in cells.values():
        cell.solver.destroy()
