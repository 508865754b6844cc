"""Cells of one shape and any size: stresses, load factors and energies per area are the same."""

from __future__ import annotations

import numpy as np
import pytest
from support import torn_cells
from support.loads import strains
from support.ranks import PIECES

from feti_homog.analysis.path_events import Work
from feti_homog.interface.contact import BONDED
from feti_homog.interface.loaded_cell import LoadedCell
from feti_homog.interface.path_following import events
from feti_homog.interface.path_points import unloaded
from feti_homog.interface.strength_criterion import StrengthCriterion

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

THREE = {"geometry": "random", "fibres": 3, "min_gap": 0.1, "seed": 4, "mesh_size": 0.25, "radius_spread": 0.3}
TIGHT = {"petsc": {"feti_pc_type": "influence", "feti_ksp_rtol": 1e-11}, "decomposition": PIECES}
WAYPOINTS = np.array([[1.0, 0.1, 0.2], [-0.5, 0.0, 0.1]])


def followed(comm, **size):
    """Load factors, stresses and dissipated energies of a path, and the width of the cell."""
    cell = torn_cells.tear(comm, **THREE, **TIGHT, **size)
    interface = torn_cells.interface(cell, True)
    begin = unloaded(LoadedCell(interface), np.full(len(interface.nodes.row), BONDED, np.int8))
    energies, rows = Work(), []
    for point in events(LoadedCell(interface), StrengthCriterion(20.0, 30.0, "max"), strains(WAYPOINTS), begin):
        energies.arrive(point)
        stress = point.scale * interface.stress(point.state.solution)
        rows.append([point.load_factor, *stress, energies.followed.released])
    return np.array(rows), cell.summary.width


@pytest.mark.parametrize("width", [1e-6, 300.0])
def test_a_path_scales_with_the_cell(comm, width):
    expected, one = followed(comm)
    found, own = followed(comm, width=width)
    assert one == 1.0 and own == width and found.shape == expected.shape and len(found) > 20
    assert found[:, 0] == pytest.approx(expected[:, 0], abs=1e-8)
    assert np.abs(found[:, 1:4] - expected[:, 1:4]).max() < 1e-8 * np.abs(expected[:, 1:4]).max()
    assert np.abs(found[:, 4] - expected[:, 4]).max() < 1e-8 * np.abs(expected[:, 4]).max()
