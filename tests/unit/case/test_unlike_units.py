"""Warnings and remarks on numbers that are probably in other units."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from support.base_case import AXIAL, TRANSVERSE, changed, fibre
from support.cases import make_case

from feti_homog.case.cases import parse


def test_strengths_above_a_stiffness_are_warned_of():
    """E / (1 - nu^2) of plane stress is 3.2: a matrix in GPa, strengths in MPa; a fibre may be stronger than that."""
    asked = {
        "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.3},
        "material": {"matrix": {"young": 3.0, "poisson": 0.25}, "fibre": {"young": 7e4, "poisson": 0.2}},
        "analysis": {"type": "path", "plane": "stress"},
        "path": {"waypoints": [{"E11": 0.01}]},
        "interface": {"normal_strength": 60.0, "tangential_strength": 3.1},
    }
    asked["material"]["matrix"]["strength"] = asked["material"]["fibre"]["strength"] = {"principal": 3.3}
    end = "above 3.2, the stiffness of a phase: are both in one unit?"
    expected = (f"[interface] normal_strength = 60: {end}", f"[material.matrix.strength] principal = 3.3: {end}")
    assert parse(asked, Path()).warnings() == expected
    for phase in asked["material"].values():
        phase["conductivity"] = 1.0
    conduction = {name: asked[name] for name in ("cell", "material")} | {"analysis": {"type": "conductivity"}}
    assert parse(conduction, Path()).warnings() == ()


@pytest.mark.parametrize(
    ("matrix", "young", "is_alike"),
    [(3500.0, 231.0, False), (3.5, 231e3, False), (3.5, 231.0, True), (3.5, 3.5, True), (3.5, 3500.0, True)],
)
def test_moduli_in_unlike_units_are_remarked(matrix, young, is_alike):
    remarks = parse(tomllib.loads(changed(("88.0", str(matrix)), ("200.0", str(young))))).remarks()
    line = f"[material.fibre] modulus {young:g}, [material.matrix] {matrix:g}: are both in one unit?"
    assert remarks == (() if is_alike else (line,))
    assert parse(tomllib.loads(fibre(TRANSVERSE + AXIAL))).remarks() == ()  # only across the fibres it is softer


@pytest.mark.parametrize("name", ["E_transverse", "G_axial"])
def test_moduli_of_one_phase_in_unlike_units_are_remarked(name):
    fibre = {"E_axial": 230e3, "E_transverse": 15e3, "nu_axial": 0.2, "nu_transverse": 0.3, "G_axial": 15e3}
    asked = make_case(matrix={"young": 3500.0, "poisson": 0.35}, fibre=fibre | {name: 15.0}, plane="generalized")
    line = f"[material.fibre] E_axial 230000, {name} 15: are both in one unit?"
    assert [remark for remark in asked.remarks() if "unit" in remark] == [line]


@pytest.mark.parametrize(
    ("keys", "named"),
    [
        ({"expansion": 60.0}, ["expansion = 60.0"]),
        ({"expansion": [1e-6, -0.5, 1e-6], "stiffness": np.eye(3).tolist()}, ["expansion = [1e-06, -0.5, 1e-06]"]),
        ({"expansion_axial": -0.4, "expansion_transverse": 1e-5}, ["expansion_axial = -0.4"]),
        ({"expansion": 1e-3}, []),
    ],
)
def test_expansions_that_lack_their_power_of_ten_are_remarked(keys, named):
    moduli = {"young": 3.0, "poisson": 0.25}
    if "expansion_axial" in keys:
        moduli = {"E_axial": 9.0, "E_transverse": 3.0, "G_axial": 2.0, "nu_axial": 0.3, "nu_transverse": 0.3}
    asked = make_case(matrix={"young": 3.0, "poisson": 0.25}, fibre=keys if "stiffness" in keys else moduli | keys)
    remarks = [line for line in asked.remarks() if "expansion" in line]
    assert remarks == [f"[material.fibre] {name}: is it in units of 1e-6?" for name in named]
