"""Influence columns are found in batches, which shrink where their columns go unused."""

from __future__ import annotations

import numpy as np
import pytest
from support import torn_cells

from feti_homog.interface.contact.states import BONDED, OPEN

pytestmark = pytest.mark.parallel


def test_batches_shrink_where_columns_go_unused(comm):
    """Bonds far from each other are wanted in turn, and none beside them."""
    cell = torn_cells.tear(comm, geometry="square", petsc={"feti_pc_type": "influence"})
    solver, influence = cell.solver, cell.solver.exact_inverse
    influence.most_followed, influence.batch = 24, 16
    rows, first = influence.neighbours.rows, influence.neighbours.first
    status = np.full(len(solver.jump_operator.nodes.row), BONDED, np.int8)
    status[: 1 if first == 0 else 0] = OPEN
    solver.set_state(torn_cells.interface(cell, True).active(status), solver.intact_compliance)
    influence.multipliers(solver.d, np.eye(3))
    before = len(influence._with_near(rows[1:2], lambda near: near))
    for number in (7 * np.arange(1, len(rows))) % len(rows):
        influence.inverse_blocks(rows[[max(number, 1)], None] + np.arange(2))
    assert influence._share == 0.125 and 1 < len(influence._with_near(rows[1:2], lambda near: near)) < before >= 16
    # Rows that have left are found alone.
    assert len(influence._with_near(rows[:1], lambda near: near)) == 1
    influence._adapt_batch(np.array([True, True, False]))
    assert influence._share == 0.25


def test_columns_have_room_for_those_of_all_rows_at_most(comm):
    """Any number of changes may be asked for, so that the first reference cell is the only one."""
    petsc = {"feti_pc_type": "influence", "feti_influence_columns": 10**9}
    cell = torn_cells.tear(comm, geometry="square", petsc=petsc)
    influence = cell.solver.exact_inverse
    assert np.abs(influence.multipliers(cell.solver.d, np.eye(3))).max(initial=0.0) < np.inf
    assert influence.most_followed == len(influence.stiffness)
