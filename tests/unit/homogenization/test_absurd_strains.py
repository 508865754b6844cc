"""Checks are measured by the load: a strain that came out absurd is no scale, and has a remark."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from support.layered_meshes import layers
from support.loaded_twins import document

from feti_homog import Case, run
from feti_homog.homogenization.averaging import Homogenization
from feti_homog.interface.loads import Load, LoadScales

STIFFNESS = np.diag([4.0, 4.0, 1.0])


@pytest.fixture
def scales():
    """Provide scales of a plane problem of one phase without interfaces."""
    subdomain = SimpleNamespace(areas=[1.0], laws=[STIFFNESS], L=STIFFNESS, submesh=SimpleNamespace(body=0))
    nodes = SimpleNamespace(row=np.zeros(0, int), bodies=np.zeros((0, 2), int), length=np.zeros(0))
    solver = SimpleNamespace(
        comm=MPI.COMM_SELF,
        problem=SimpleNamespace(strains=3, stresses=3),
        subdomains=[subdomain],
        jump_operator=SimpleNamespace(nodes=nodes, components=2),
        intact_compliance=np.zeros(0),
    )
    return LoadScales(solver, np.ones(2))


def test_loads_ask_for_strains_of_the_bonded_cell(scales):
    load = Load(np.array([-0.01, 0.002, -0.008]), np.array([True, False, True]))
    np.testing.assert_allclose(scales.asked(load), [0.0025, 0.002, 0.008])


@pytest.mark.parametrize(("strain", "acting", "excess"), [(0.1, 0.1, 10.0), (1e7, 10.0, 1e9)])
def test_a_strain_that_came_out_is_a_scale_from_that_of_the_load_up_to_a_multiple(scales, strain, acting, excess):
    asked = np.array([0.0025, 0.0, 0.01])
    np.testing.assert_allclose(scales.acting(np.array([0.001, 0.0, -strain]), asked), [0.0025, 0.0, acting])
    assert scales.excess(np.array([0.001, 0.0, -strain]), asked) == pytest.approx(excess)


def test_a_stress_that_is_missed_is_measured_by_the_load_whatever_the_strain(scales):
    load = Load(np.array([-0.01, 0.0, 0.008]), np.ones(3, bool))
    solution = SimpleNamespace(strain=np.array([-0.0025, 0.0, 1e7]))
    state = SimpleNamespace(load=load, solution=solution, asked=scales.asked(load))
    homogenization = SimpleNamespace(interface=SimpleNamespace(scales=scales))
    off = Homogenization._unmet_stress(homogenization, state, np.array([-0.01, 0.0, 0.0075]))
    assert off == pytest.approx(0.0005 / 0.008)


@pytest.mark.parametrize(("stiffness", "remarks"), [(1.0, 0), (1e-4, 1)])
def test_a_cell_that_hardly_carries_its_stress_has_a_remark(tmp_path, stiffness, remarks):
    """A layer on springs, of which the soft ones let it move ten thousand times as far as bonds would."""
    interface = {"normal_stiffness": stiffness, "tangential_stiffness": stiffness}
    phases = ({"young": 1.0, "poisson": 0.3}, {"young": 5.0, "poisson": 0.2})
    layers("MFFM", 0).write(tmp_path / "cell.msh")
    cell = {"geometry": "mesh", "file": "cell.msh"}
    case = document(cell, phases, "strain", interface, load={"to": {"S11": 0.01}})
    found = run(Case.parse(case, tmp_path)).remarks
    assert sum("hardly anything carries" in line for line in found) == remarks
