"""The table of a study of scatter: every number in its column, and results with their units."""

import re

import pytest
from support.sweep_tables import path_document

from feti_homog.report.text import constant_tables
from feti_homog.report.text.study_tables import scatter_text
from feti_homog.studies import uncertainty


def test_stresses_have_their_unit_and_strains_none():
    scatter = {
        "value": 30.0,
        "std_inputs": 3.0,
        "mesh_error": None,
        "std": 3.0,
        "shares": [1.0],
        "derivative_errors": None,
        "bends": [0.0],
    }
    document = {
        "stress_unit": "MPa", "cells": 1, "parameters": [{"name": "material.matrix.young", "by": "differences"}],
        "results": [scatter | {"name": name} for name in ("onset_S11", "peak_E11", "E_axial")],
    }  # fmt: skip
    text = scatter_text(document)
    rows = [line.split("  ")[1] for line in text.splitlines() if " 30 " in line]
    assert rows == ["onset_S11 (MPa)", "peak_E11", "E_axial (MPa)"] and "Negative shares" not in text
    assert "Not linear" not in text
    del document["stress_unit"]  # as files of earlier versions
    assert "onset_S11  " in scatter_text(document)


def test_every_number_stands_under_its_head():
    """Deviations by inputs 3 and between cells 4, together 5, of two results; a third has no scatter."""
    names = ("material.matrix.young", "interface.normal_stiffness")
    rows = [
        {"name": "C11", "value": 30.0, "std_inputs": 3.0, "std_cells": 4.0, "std": 5.0, "mesh_error": 0.25},
        {"name": "nu12", "value": 0.5, "std_inputs": 0.03, "std_cells": 0.04, "std": 0.05, "mesh_error": None},
        {"name": "C12", "value": 9.0, "std_inputs": 0.0, "std_cells": 0.0, "std": 0.0, "mesh_error": None},
    ]
    shares = [[1.25, -0.25], [0.36, 0.64], [0.0, 0.0]]
    document = {
        "stress_unit": "GPa", "cells": 3,
        "parameters": [{"name": names[0], "by": "derivatives"}, {"name": names[1], "by": "differences"}],
        "results": [
            row | {"shares": own, "derivatives": [1.0, -2.0], "derivative_errors": errors, "bends": [0.0, 0.76]}
            for row, own, errors in zip(rows, shares, ([0.4, 1.1], [0.6, 0.9], [9.0, 9.0]), strict=True)
        ],
    }  # fmt: skip
    lines = scatter_text(document).splitlines()
    head = re.split(r"\s{2,}", lines[2].strip())
    assert head == ["value", "+- inputs", "+- cells", "+- both", "+- mesh", "matrix.young", names[1]]
    cells = [re.split(r"\s{2,}", line.strip())[1:] for line in lines[3:5]]
    assert [[float(cell) for cell in row if cell != "-"] for row in cells] == [
        [30.0, 3.0, 4.0, 5.0, 0.25, 125.0, -25.0],
        [0.5, 0.03, 0.04, 0.05, 36.0, 64.0],
    ]
    assert cells[1][4] == "-" and lines[5] == f"By differences of runs: {names[1]}"
    words = "Standard error over the cells above half of the slope by"
    assert lines[6] == "Negative shares: correlated numbers act against each other"
    assert lines[7].startswith("+- mesh: for stiffnesses, constants, conductivities alone")
    bent = f"Not linear within one standard deviation of {names[1]}: C11, nu12"
    assert lines[8:] == [f"{words} {names[0]}: nu12", bent, f"{words} {names[1]}: C11"]
    document["results"][1]["mesh_error"] = 0.01
    assert "+- mesh: for" not in scatter_text(document)


@pytest.mark.parametrize("leading", [0, 1])
def test_a_path_has_its_onset_and_peak_in_the_leading_component(leading):
    """The others are largest at other points, or differ from zero by the mesh alone."""
    document = path_document(4, 0.0)
    strain = [0.0, 0.0, 0.0]
    for number, point in enumerate(document["path"]):
        strain[leading] = 0.01 * (number + 1)
        point |= {"strain": [*strain], "stress": [3.0, 2.0, 1e-5]}
    document["case"]["path"]["strain"] = strain
    component = f"{leading + 1}{leading + 1}"
    names = [f"{mark}_{kind}{component}" for mark in ("onset", "peak") for kind in "ES"]
    assert {datum.name for datum in uncertainty._data([document] * 2)} == {"onset_load_factor", *names}


SECANTS = [f"C{i}{j}" for i in range(1, 7) for j in range(i, 7)]


def test_all_secants_in_space_are_listed():
    scatter = {
        "value": 3.0,
        "std_inputs": 0.3,
        "mesh_error": None,
        "std": 0.3,
        "shares": [1.0],
        "derivative_errors": None,
        "bends": [0.0],
    }
    results = [scatter | {"name": name} for name in SECANTS]
    parameters = [{"name": "material.fibre.E_axial", "by": "derivatives"}]
    text = scatter_text({"cells": 1, "parameters": parameters, "results": results})
    assert [name for name in SECANTS if f"  {name} " in text] == SECANTS


def test_derivatives_of_secants_and_of_expansions_in_any_unit_are_printed():
    """The diagonal entries come first; a small derivative with a large elasticity is no noise, a zero stays a zero."""
    small = {
        "parameters": ["material.matrix.young", "material.fibre.young"], "parameter_values": [3e9, 7e10],
        "constants": ["expansion_1"], "constant_values": [5e-5], "derivatives": [[1.9e-16, 1e-30]],
    }  # fmt: skip
    _, slopes = constant_tables.sensitivities({"sensitivities": small})
    assert "1.9e-16" in slopes.html and ">0<" in slopes.html
    _, slopes = constant_tables.sensitivities({"sensitivities": small | {"parameter_values": [0.0, 7e10]}})
    assert "1.9e-16" in slopes.html  # also where the parameter is zero
    secants = small | {"constants": SECANTS, "constant_values": [1.0] * 21, "derivatives": [[1.0, 1.0]] * 21}
    heads = constant_tables.sensitivities({"sensitivities": secants})[0].lines[1].split()
    assert heads == ["C11", "C22", "C33", "C44", "C55", "C66", "C12", "C13", "C14"]


def test_a_strain_that_symmetry_makes_zero_has_no_elasticity():
    found = {
        "parameters": ["material.matrix.young"], "parameter_values": [3e9], "at_fixed_status": False,
        "constants": ["E11", "gamma12"], "constant_values": [2e-4, 7e-16], "derivatives": [[1e-13], [3e-22]],
    }  # fmt: skip
    load = {"strain": [2e-4, 0.0, 7e-16], "stress": [0.0, 30.0, 0.0]}
    elasticities, _ = constant_tables.sensitivities({"sensitivities": found, "load": load})
    assert elasticities.rows[0][1:] == [pytest.approx(1.5), "-"]
