"""Plane stiffness against closed forms, and the components of plane states in problems and laws."""

import numpy as np
import pytest
from support.cases import make_case

from feti_homog import Case
from feti_homog.homogenization import phase_laws
from feti_homog.materials.laws import conductivity, out_of_plane, plane_stiffness, stiffness_of
from feti_homog.materials.material_forms import General, Isotropic, Orthotropic
from feti_homog.materials.voigt import CONDUCTION, PLANE_STATES, plane_state_of

CONSTANTS = {"E1": 140.0, "E2": 10.0, "E3": 12.0, "nu12": 0.3, "nu13": 0.25, "nu23": 0.4, "G12": 5.0}


def test_isotropic_plane_strain_is_lames_law():
    young, poisson = 88.0, 0.299
    lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    shear = young / (2 * (1 + poisson))
    expected = [[lame + 2 * shear, lame, 0], [lame, lame + 2 * shear, 0], [0, 0, shear]]
    np.testing.assert_allclose(plane_stiffness(Isotropic(young, poisson), "strain"), expected, rtol=1e-13)


def test_isotropic_plane_stress_is_hookes_law():
    young, poisson = 88.0, 0.299
    expected = np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]]) * young / (1 - poisson**2)
    np.testing.assert_allclose(plane_stiffness(Isotropic(young, poisson), "stress"), expected, rtol=1e-13)


def test_a_general_stiffness_is_taken_as_it_is():
    rows = ((5.0, 2.0, 0.3), (2.0, 4.0, -0.4), (0.3, -0.4, 1.5))
    for plane in ("strain", "stress"):
        np.testing.assert_array_equal(plane_stiffness(General(rows), plane), rows)


@pytest.mark.parametrize(
    ("material", "words"),
    [
        (Isotropic(1.0, 0.5), "poisson = 0.5"),
        (Orthotropic(**(CONSTANTS | {"nu12": 4.0})), "nu12 = 4.0"),
        (Orthotropic(**(CONSTANTS | {"nu23": 0.95})), "positive definite compliance"),
        (General(((1.0, 2.0, 0.0), (2.0, 1.0, 0.0), (0.0, 0.0, 1.0))), "positive definite"),
        (General(((3.0, 1.0, 0.0), (1.1, 3.0, 0.0), (0.0, 0.0, 1.0))), "symmetric"),
    ],
)
def test_unstable_materials_are_refused(material, words):
    with pytest.raises(ValueError, match=words):
        plane_stiffness(material, "strain")


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_a_general_stiffness_does_not_say_what_is_out_of_the_plane(plane):
    rows = out_of_plane(General(((3.0, 1.0, 0.0), (1.0, 3.0, 0.0), (0.0, 0.0, 1.0))), plane)
    assert [bool(np.isnan(row).all()) for row in rows] == [plane == "strain", plane == "stress"]


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
