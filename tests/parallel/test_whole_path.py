"""Whole paths of bonds that break by energy, to complete debonding, against brute force."""

import numpy as np
import pytest
from reference.energy_path import SlowEnergyPath
from support import torn_cells
from support.cases import relative_error
from support.loads import strains
from support.ranks import PIECES

from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED
from feti_homog.interface.laws.energy import ReleasedEnergy, SpringEnergy
from feti_homog.interface.path.path_following import events
from feti_homog.interface.path.path_points import unloaded
from feti_homog.system.parallel.mpi_errors import on_root

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

SPRINGS, TOUGHNESS, SENSITIVITY = (30.0, 12.0), 1e-4, 0.3
FOUR = {
    "geometry": "random",
    "fibres": 4,
    "fibre_fraction": 0.4,
    "min_gap": 0.1,
    "seed": 2,
    "mesh_size": 0.2,
    "matrix": {"young": 1.0, "poisson": 0.35},
    "fibre": {"young": 20.0, "poisson": 0.2},
    "springs": SPRINGS,
    "decomposition": PIECES,
}
STRAIN = np.array([1.0, 0.1, 0.05])


@pytest.mark.one_rank
@pytest.mark.parametrize("growth", ["released", "springs"])
def test_whole_paths_are_those_of_brute_force(comm, built, growth):
    expected = None
    for columns in (700, 24):
        petsc = {"feti_pc_type": "influence", "feti_influence_columns": columns, "feti_ksp_rtol": 1e-10}
        case = built(**FOUR, petsc=petsc)
        if expected is None:
            slow = SlowEnergyPath(case.reference, SPRINGS, TOUGHNESS, SENSITIVITY, growth)
            expected = on_root(comm, slow.proportional, STRAIN)
        points = follow(case.cell, growth)
        found = np.array([case.in_reference_order(p.after.bonds.status) != BONDED for p in points])
        np.testing.assert_array_equal(found, np.cumsum([e.broke for e in expected], axis=0) > 0)
        assert len(points) > 30 and found[-1].mean() > 0.5
        assert relative_error(np.array([p.load_factor for p in points]), [e.load_factor for e in expected]) < 1e-8
        stress = np.array([p.scale * torn_cells.stress(case.cell, p.state.solution) for p in points])
        assert relative_error(stress, np.array([e.stress for e in expected])) < 1e-8
        assert all(p.state.solution.reason > 0 and max(p.state.certificate.values()) < 1e-8 for p in points)
        # With few columns the cell is factored anew on the way.
        assert (case.cell.solver.exact_inverse.factorizations > 1) == (columns < 100)


def test_a_path_goes_on_from_its_middle_as_if_it_had_not_stopped(comm):
    petsc = {"feti_pc_type": "influence", "feti_influence_columns": 40}
    cells = [torn_cells.tear(comm, **FOUR, petsc=petsc) for _ in range(2)]
    whole = follow(cells[0], "released")
    # The second cell has no columns, and another reference cell than the first one has there.
    rest = follow(cells[1], "released", whole[len(whole) // 2].after)
    expected = whole[len(whole) // 2 + 1 :]
    assert [p.broke for p in rest] == [p.broke for p in expected]
    assert relative_error(np.array([p.load_factor for p in rest]), [p.load_factor for p in expected]) < 1e-9
    for found, point in zip(rest, expected, strict=True):
        np.testing.assert_array_equal(found.after.bonds.status, point.after.bonds.status)
    for cell in cells:
        cell.solver.destroy()


def follow(cell, growth, begin=None):
    """Return the points of the path, or of what is left of it."""
    interface, springs = torn_cells.interface(cell, True), SpringEnergy(*SPRINGS, TOUGHNESS, SENSITIVITY)
    law = ReleasedEnergy(**vars(springs), influence=cell.solver.exact_inverse) if growth == "released" else springs
    bonded = np.full(len(interface.nodes.row), BONDED, np.int8)
    return list(
        events(
            CoupledInterfaces(interface),
            law,
            strains(STRAIN[None]),
            begin or unloaded(CoupledInterfaces(interface), torn_cells.bonds(bonded)),
        )
    )
