"""Plane states: their components are those of the problems that are solved, and of the laws of phases."""

import numpy as np
import pytest
from support.cases import make_case

from feti_homog.homogenization import phase_laws
from feti_homog.materials.laws import out_of_plane, stiffness_of
from feti_homog.materials.material_forms import Isotropic
from feti_homog.materials.voigt import PLANE_STATES, plane_state_of


@pytest.mark.parametrize("state", PLANE_STATES.values(), ids=PLANE_STATES)
def test_strains_are_the_loads_of_the_problems(state):
    case = make_case(plane=state.name, matrix={"young": 3.0, "poisson": 0.3, "expansion": 1e-5},
                     fibre={"young": 70.0, "poisson": 0.2, "expansion": 1e-6})  # fmt: skip
    loads = [name for problem in phase_laws.problems(case) for name in problem.loads]
    assert sorted(loads) == sorted([*state.strains, *["temperature"] * state.is_spatial])
    assert len(phase_laws.problems(case)) == 1 + state.is_spatial
    assert plane_state_of({"case": case.resolved()}) is state


@pytest.mark.parametrize("state", PLANE_STATES.values(), ids=PLANE_STATES)
def test_stiffnesses_have_the_components_of_the_state(state):
    material = Isotropic(young=3.0, poisson=0.3)
    stiffness = stiffness_of(material, state.name)
    assert stiffness.shape == (len(state.components),) * 2
    tension = np.zeros(len(stiffness))
    tension[: state.normals] = 1.0
    trace = 3.0 / (1 - 0.3) if state.is_sheet else 3.0 / ((1 + 0.3) * (1 - 2 * 0.3))
    expected = trace if state.is_sheet else trace * (1.0 + 0.3 * (state.normals - 2))
    assert stiffness[0] @ tension == pytest.approx(expected)


@pytest.mark.parametrize(("name", "S33"), [("stress", 0.0), ("strain", 0.3)])
def test_sheets_have_no_stress_across_them(name, S33):
    assert PLANE_STATES[name].is_sheet == (S33 == 0.0)
    assert out_of_plane(Isotropic(young=3.0, poisson=0.3), name)[0][0] == pytest.approx(S33)
