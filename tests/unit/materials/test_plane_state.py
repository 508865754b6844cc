"""Plane states: their components are those of the problems that are solved, and of the laws of phases."""

import numpy as np
import pytest
from support.cases import make_case

from feti_homog import Case
from feti_homog.homogenization import phase_laws
from feti_homog.materials.laws import conductivity, out_of_plane, stiffness_of
from feti_homog.materials.material_forms import Isotropic, Orthotropic
from feti_homog.materials.voigt import CONDUCTION, PLANE_STATES, plane_state_of

MECHANICAL = {name: state for name, state in PLANE_STATES.items() if not state.is_scalar}


@pytest.mark.parametrize("state", MECHANICAL.values(), ids=MECHANICAL)
def test_strains_are_the_loads_of_the_problems(state):
    case = make_case(plane=state.name, matrix={"young": 3.0, "poisson": 0.3, "expansion": 1e-5},
                     fibre={"young": 70.0, "poisson": 0.2, "expansion": 1e-6})  # fmt: skip
    loads = [name for problem in phase_laws.problems(case) for name in problem.loads]
    assert sorted(loads) == sorted([*state.strains, *["temperature"] * state.is_spatial])
    assert len(phase_laws.problems(case)) == 1 + state.is_spatial
    assert plane_state_of({"case": case.resolved()}) is state


@pytest.mark.parametrize("state", MECHANICAL.values(), ids=MECHANICAL)
def test_stiffnesses_have_the_components_of_the_state(state):
    material = Isotropic(young=3.0, poisson=0.3)
    stiffness = stiffness_of(material, state.name)
    assert stiffness.shape == (len(state.components),) * 2
    tension = np.zeros(len(stiffness))
    tension[: state.normals] = 1.0
    trace = 3.0 / (1 - 0.3) if state.is_sheet else 3.0 / ((1 + 0.3) * (1 - 2 * 0.3))
    expected = trace if state.is_sheet else trace * (1.0 + 0.3 * (state.normals - 2))
    assert stiffness[0] @ tension == pytest.approx(expected)


def test_conduction_has_the_gradient_of_one_unknown():
    document = {
        "cell": {"geometry": "square", "fibre_fraction": 0.4},
        "material": {"matrix": {"conductivity": 0.2}, "fibre": {"conductivity": {"axial": 10.0, "transverse": 1.0}}},
        "analysis": {"type": "conductivity"},
    }
    case = Case.parse(document)
    (problem,) = phase_laws.problems(case)
    assert (problem.components, problem.strains, len(problem.loads)) == (1, 2, 3)
    assert plane_state_of({"case": case.resolved()}) is CONDUCTION and Case.parse(case.resolved()) == case
    assert phase_laws.law(case, "matrix", problem).tolist() == (0.2 * np.eye(3)).tolist()
    assert phase_laws.law(case, "fibre", problem).tolist() == np.diag([1.0, 1.0, 10.0]).tolist()


def test_an_orthotropic_phase_conducts_best_along_its_axis():
    """The flux k' = diag(3, 1, 2) along axis 1, at 30 degrees from x1, is three times the gradient."""
    tensor = ((3.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 2.0))
    k = conductivity(Orthotropic(E1=2.0, E2=1.0, nu12=0.2, G12=0.5, angle=30.0, conductivity=tensor))
    axis = np.array([np.sqrt(3) / 2, 0.5, 0.0])
    assert k @ axis == pytest.approx(3.0 * axis) and np.linalg.eigvalsh(k) == pytest.approx([1.0, 2.0, 3.0])


@pytest.mark.parametrize(("name", "S33"), [("stress", 0.0), ("strain", 0.3)])
def test_sheets_have_no_stress_across_them(name, S33):
    assert PLANE_STATES[name].is_sheet == (S33 == 0.0)
    assert out_of_plane(Isotropic(young=3.0, poisson=0.3), name)[0][0] == pytest.approx(S33)
