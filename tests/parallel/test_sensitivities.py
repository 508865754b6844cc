"""Derivatives of stiffness and conductivity against differences of whole runs, and Euler's relation."""

import copy

import numpy as np
import pytest
from support.cases import FIBRE, MATRIX

from feti_homog import Case, CaseError, run

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

CARBON = {
    "E_axial": 230.0, "E_transverse": 15.0, "nu_axial": 0.2, "nu_transverse": 0.07, "G_axial": 24.0,
    "expansion_axial": -5e-7, "expansion_transverse": 7e-6,
}  # fmt: skip
BY_SHEAR = {name: value for name, value in CARBON.items() if name != "nu_transverse"} | {"G_transverse": 7.0}
EPOXY = {"young": 3.45, "poisson": 0.35, "expansion": 5.4e-5}
TURNED = {
    "E1": 20.0, "E2": 9.0, "E3": 30.0, "nu12": 0.2, "nu13": 0.1, "nu23": 0.15, "G12": 5.0, "G13": 4.0, "G23": 6.0,
    "angle": 33.0,
}  # fmt: skip
GENERAL = {"stiffness": [[10.0, 2.0, 0.5], [2.0, 8.0, 0.1], [0.5, 0.1, 3.0]]}
ACROSS, TENSOR = {"axial": 10.0, "transverse": 1.0}, [[0.2, 0.05, 0.02], [0.05, 0.3, -0.01], [0.02, -0.01, 0.4]]
SIZING = {"young": 1.2, "poisson": 0.4, "expansion": 8e-5}
ARC = [{"fibre": "all", "centre": 20.0, "angle": 90.0}]
SPRINGS = {"normal_stiffness": 50.0, "tangential_stiffness": 20.0, "contact": False}
COATED = {"geometry": "hexagonal", "fibre_fraction": 0.4, "mesh_size": 0.2, "coating": 0.1}
PLAIN = {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.25}
VOIDS = {"geometry": "random", "fibres": 2, "fibre_fraction": 0.2, "voids": 0.1, "mesh_size": 0.25}
STIFF = ("young", "E_axial", "E_transverse", "E1", "E2", "E3", "G12", "G13", "G23", "G_axial", "G_transverse")


def document(cell, plane, materials, interface=None):
    """Return a small case that asks for sensitivities, solved to rounding."""
    given = {
        "cell": cell,
        "material": materials,
        "analysis": {"type": "conductivity" if plane == "conduction" else "stiffness", "plane": plane},
        "output": {"sensitivities": True, "mesh_error": False},
        "petsc": {"feti_ksp_rtol": 1e-13},
    }
    return given | ({} if interface is None else {"interface": interface})


CASES = {
    "springs, coatings, expansions": document(  # a stiffness does not depend on conductivities
        COATED | {"order": 1}, "generalized",
        {"matrix": EPOXY | {"conductivity": 0.2}, "fibre": CARBON | {"conductivity": ACROSS}, "coating": SIZING},
        SPRINGS,
    ),
    "conduction": document(
        PLAIN | {"order": 2}, "conduction",
        {"matrix": TURNED | {"conductivity": TENSOR}, "fibre": {"conductivity": ACROSS}},
        {"conductance": 0.7, "debonded": ARC},
    ),
    "conduction with coatings": document(
        COATED | {"order": 1}, "conduction",
        {phase: {"conductivity": k} for phase, k in (("matrix", 0.2), ("fibre", ACROSS), ("coating", 0.7))},
        [{"between": ["coating", "matrix"], "conductance": 3.0, "debonded": []},
         {"between": ["fibre", "coating"], "conductance": 0.5, "debonded": []}],
    ),
    "along the fibres alone": document(
        PLAIN | {"order": 2}, "generalized", {"matrix": EPOXY, "fibre": TURNED}, SPRINGS | {"axial_stiffness": 5.0}
    ),
    "debonded": document(
        PLAIN | {"order": 2}, "strain", {"matrix": MATRIX, "fibre": FIBRE}, {"contact": False, "debonded": ARC}
    ),
    "mixed elements": document(
        PLAIN | {"order": 2}, "generalized",
        {"matrix": EPOXY | {"poisson": 0.4}, "fibre": BY_SHEAR}, SPRINGS,
    ),
    "voids": document(VOIDS | {"order": 1}, "stress", {"matrix": GENERAL, "fibre": TURNED}),
}  # fmt: skip


def moved(case, names, values):
    """Return the case with other values of its parameters."""
    changed = copy.deepcopy(case)
    for name, value in zip(names, values, strict=True):
        section, *keys = name.split(".")
        place = changed[section]
        if isinstance(place, list):
            place = place[int(keys.pop(0)) - 1]
        elif section != "interface":
            place = place[keys.pop(0)]
        if keys[0] == "conductivity" and isinstance(place[keys[0]], dict):
            place = place[keys.pop(0)]
        if len(keys) > 1:
            i, j = int(keys[1][1]) - 1, int(keys[1][2]) - 1
            place[keys[0]][i][j] = place[keys[0]][j][i] = float(value)
        else:
            place[keys[0]] = float(value)
    return changed


@pytest.mark.one_rank
@pytest.mark.parametrize("name", CASES)
def test_derivatives_are_those_of_the_answer(comm, name):
    """Along a direction in which every parameter changes, by central differences of three steps, extrapolated."""
    case = CASES[name]
    found = run(Case.parse(case), comm).sensitivities
    at, sign = found.parameter_values, np.resize([1.0, -0.7, 0.5, 0.9, -0.8], len(found.parameters))
    direction = sign * at

    def slope(h):
        ends = [run(Case.parse(moved(case, found.parameters, at + s * h * direction)), comm) for s in (1, -1)]
        return (ends[0].sensitivities.constant_values - ends[1].sensitivities.constant_values) / (2 * h)

    first, second, third = (slope(h) for h in (0.02, 0.01, 0.005))
    once, twice = (4 * second - first) / 3, (4 * third - second) / 3
    expected = (16 * twice - once) / 15
    values = dict(zip(found.constants, found.constant_values, strict=True))
    largest = {key: max(abs(v) for n, v in values.items() if n.startswith(key)) for key in {n[0] for n in values}}
    scale = np.array([max(abs(v), 1e-3 * largest[n[0]]) for n, v in values.items()])
    assert (np.abs(found.derivatives @ direction - expected) < 1e-7 * scale).all()


@pytest.mark.parametrize("name", CASES)
def test_stiffness_is_homogeneous_of_degree_one_in_those_of_all_phases(comm, name):
    found = run(Case.parse(CASES[name]), comm).sensitivities
    stiff = [n.endswith((*STIFF, "_stiffness")) or ".stiffness." in n or "conduct" in n for n in found.parameters]
    moduli = [k for k, n in enumerate(found.constants) if n[0] in "CEGKk"]
    total = found.derivatives[:, stiff] @ found.parameter_values[stiff]
    largest = np.abs(found.constant_values[moduli]).max()
    np.testing.assert_allclose(total[moduli], found.constant_values[moduli], rtol=1e-10, atol=1e-10 * largest)


@pytest.mark.one_rank
@pytest.mark.parametrize(("geometry", "plane", "order"), [("hexagonal", "generalized", 2), ("square", "stress", 1)])
def test_derivatives_by_the_fraction_are_those_of_finer_meshes(comm, geometry, plane, order):
    """Quadratic elements to 1e-3 of the differences of four cells, linear ones as far as their stiffness is right."""

    def found(fraction):
        cell = {"geometry": geometry, "fibre_fraction": fraction, "mesh_size": 0.15, "refine": 1, "order": order}
        return run(Case.parse(document(cell, plane, {"matrix": EPOXY, "fibre": CARBON})), comm).sensitivities

    low, below, above, high = (found(0.5 + change).constant_values for change in (-0.01, -0.005, 0.005, 0.01))
    own = found(0.5)
    expected = (4 * (above - below) / 0.01 - (high - low) / 0.02) / 3
    kinds = [name[0] for name in own.constants]
    scale = np.array([max(abs(expected[k]) for k in range(len(kinds)) if kinds[k] == kind) for kind in kinds])
    error = np.abs(own.derivatives[:, own.parameters.index("cell.fibre_fraction")] - expected) / scale
    assert error.max() < (1e-3 if order == 2 else 3e-2)


WARM = {"matrix": EPOXY, "fibre": CARBON}
TOUCHING = {"contact": True, "debonded": ARC}
LOADS = {
    "secants": document(PLAIN | {"order": 2}, "strain", {"matrix": MATRIX, "fibre": FIBRE}, TOUCHING),
    "secants in space": document(PLAIN | {"order": 1}, "generalized", WARM, SPRINGS | TOUCHING),
    "strains": document(PLAIN | {"order": 1}, "strain", {"matrix": MATRIX, "fibre": FIBRE}, SPRINGS | TOUCHING)
    | {"analysis": {"type": "load", "plane": "strain"}, "load": {"to": {"E11": 0.01, "E22": -0.02, "gamma12": 0.005}}},
    "stresses and a temperature": document(PLAIN | {"order": 1}, "generalized", WARM, TOUCHING)
    | {"analysis": {"type": "load", "plane": "generalized"},
       "load": {"to": {"S11": -0.1, "E22": 0.02, "S33": 0.2, "gamma23": 0.01, "temperature": -50.0}}},
}  # fmt: skip


@pytest.mark.parametrize("name", LOADS)
def test_derivatives_with_contact_are_those_at_fixed_status(comm, name):
    """Against central differences so small that no node opens or closes; faces of every load touch somewhere."""
    case = LOADS[name]
    whole = run(Case.parse(case), comm)
    found = whole.sensitivities
    assert found.at_fixed_status
    if whole.load is not None:
        values = dict(zip(found.constants, found.constant_values, strict=True))
        assert whole.load.closed > 0 and values["stored"] == pytest.approx(whole.load.stored, rel=1e-9)
    at = found.parameter_values
    direction, h = np.resize([1.0, -0.7, 0.5, 0.9, -0.8], len(at)) * at, 1e-4
    ends = [run(Case.parse(moved(case, found.parameters, at + s * h * direction)), comm) for s in (1, -1)]
    expected = (ends[0].sensitivities.constant_values - ends[1].sensitivities.constant_values) / (2 * h)
    kinds = {n[0] for n in found.constants}
    largest = {k: max(abs(v) for n, v in zip(found.constants, found.constant_values, strict=True) if n[0] == k)
               for k in kinds}  # fmt: skip
    scale = np.array([largest[n[0]] for n in found.constants])
    assert (np.abs(found.derivatives @ direction - expected) < 1e-6 * scale).all()


def test_an_envelope_has_none():
    case = copy.deepcopy(CASES["voids"])
    case["analysis"]["type"] = "envelope"
    with pytest.raises(CaseError, match=r"\[output\] sensitivities = true: belongs to .*stiffness"):
        Case.parse(case)
