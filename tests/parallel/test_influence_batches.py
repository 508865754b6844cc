"""Influence columns are found in batches."""

import numpy as np
import pytest
from support import torn_cells

from feti_homog.interface.contact.states import BONDED, OPEN

pytestmark = pytest.mark.parallel


def test_columns_come_in_batches_with_those_of_active_rows_near_them(comm):
    cell = torn_cells.tear(comm, geometry="square", petsc={"feti_pc_type": "influence"})
    influence, first = cell.solver.exact_inverse, cell.solver.exact_inverse.neighbours.first
    influence.batch, rows = 6, influence.neighbours.rows
    status = np.full(len(cell.solver.jump_operator.nodes.row), BONDED, np.int8)
    status[: 1 if first == 0 else 0] = OPEN
    active = torn_cells.interface(cell, True).active(status)
    cell.solver.set_state(active, cell.solver.intact_compliance)
    asked, columns = [], influence.reference.columns
    influence.reference.columns = lambda rows: asked.append(rows) or columns(rows)
    far = len(rows) // 2
    near = set(rows[influence.neighbours.adjacency[[far]].indices])
    influence.inverse_blocks(rows[[far], None] + np.arange(2))
    assert len(asked) == 1 and 6 <= len(asked[0]) < 14 and near < set(asked[0])
    # Rows that have left are found alone.
    assert influence._with_near(rows[:1], influence._unchanged).tolist() == [rows[0]]


def test_columns_have_room_for_those_of_all_rows_at_most(comm):
    """Any number of changes may be asked for, so that the first reference cell is the only one."""
    petsc = {"feti_pc_type": "influence", "feti_influence_columns": 10**9}
    cell = torn_cells.tear(comm, geometry="square", petsc=petsc)
    influence = cell.solver.exact_inverse
    assert np.abs(influence.multipliers(cell.solver.d, np.eye(3))).max(initial=0.0) < np.inf
    assert influence.most_followed == len(influence.stiffness)
