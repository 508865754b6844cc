"""Values that `Case.parse` takes besides those of TOML, and its lines about others."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from hypothesis import given, settings
from support.base_case import BASE
from unit.case.documents import documents, with_numpy_values
from unit.case.faulty_bonding import ANGLE, BARE_ARC, PATH, of_type
from unit.case.valid_cases import MESH

from feti_homog import Case
from feti_homog.case.sections import Output
from feti_homog.errors import CaseError
from feti_homog.schema.keys import keys_of


@settings(deadline=None, derandomize=True)
@given(documents())
def test_resolved_and_numpy_values_make_an_equal_case(document):
    case = Case.parse(document)
    assert Case.parse(case.resolved()) == case
    assert Case.parse(json.loads(json.dumps(case.resolved(), allow_nan=False))) == case
    assert Case.parse(tomllib.loads(tomli_w.dumps(case.resolved()))) == case
    assert Case.parse(case.resolved()).resolved() == case.resolved()
    assert Case.parse(case.resolved()).digest() == case.digest()
    assert Case.parse(with_numpy_values(document)) == case


COMPUTED = {"fields": False, "states": 3, "mesh_error": False, "sensitivities": True}
PRESENTED = {
    "pictures": False, "report": True, "stress": "S22", "deformation_scale": 2.0, "length_unit": "mm",
    "stress_unit": "GPa",
}  # fmt: skip


@pytest.mark.parametrize("name", keys_of(Output))
def test_keys_of_output_that_decide_what_is_computed_are_in_the_digest(name):
    """A new key has to be put into one of both tables."""
    path = of_type("path", PATH, "[interface]", "normal_strength = 5.0")
    document = document_of(BASE if name == "sensitivities" else path)
    known = Case.parse(document)
    changed = Case.parse(document | {"output": {name: (COMPUTED | PRESENTED)[name]}})
    assert changed.output != known.output and (changed.digest() != known.digest()) == (name in COMPUTED)
    assert changed.digest(False) == known.digest(False)  # the events of the path are the same


def document_of(content: str) -> dict[str, Any]:
    return tomllib.loads(content)


def test_numpy_values_are_stored_as_pythons():
    document = document_of(of_type("path", PATH, "[interface]", "normal_strength = 5.0"))
    document["cell"] |= {"refine": np.int32(1), "fibre_fraction": np.float32(0.25), "order": np.array(2)}
    document["path"] = {"waypoints": np.array([[0.1, 0.0, 0.0], [0.0, 0.0, 0.1]])}
    document["output"] = {"pictures": np.bool_(False)}
    document["petsc"] = {"feti_ksp_rtol": np.float64(1e-9)}
    case = Case.parse(document)
    assert (type(case.cell.refine), type(case.cell.fibre_fraction), type(case.cell.order)) == (int, float, int)
    assert case.output.pictures is False and type(case.petsc["feti_ksp_rtol"]) is float
    assert case.path is not None and case.path.waypoints == ((0.1, 0.0, 0.0), (0.0, 0.0, 0.1))
    json.dumps(case.resolved())


def test_arrays_and_paths_stand_for_lists_and_texts(tmp_path):
    document = document_of(of_type("angle", ANGLE, BARE_ARC))
    document["angle"] = {"values": np.linspace(0, 90, 4), "strain": np.array([0, 0, 1])}
    document["interface"] = {"debonded": ({"fibre": np.arange(1, 3)}, {"fibre": np.int64(4)})}
    case = Case.parse(document)
    assert case.angle is not None and case.angle.values == (0.0, 30.0, 60.0, 90.0)
    assert [arc.fibre for arc in case.arcs] == [(1, 2), (4,)]
    document = document_of(BASE)
    document["material"]["fibre"] = {"stiffness": np.diag([3.0, 3.0, 1.0])}
    assert Case.parse(document).resolved()["material"]["fibre"]["stiffness"][0] == [3.0, 0.0, 0.0]
    (tmp_path / "cell.msh").touch()
    document = document_of(MESH)
    document["cell"]["file"] = Path("cell.msh")
    assert Case.parse(document, tmp_path).cell.file == tmp_path / "cell.msh"


@pytest.mark.parametrize("values", [3, "cell.toml", None, [BASE], [("cell", {})], np.zeros(3), Path("cell.toml")])
def test_what_is_no_mapping_is_a_type_error(values):
    with pytest.raises(TypeError, match=r"expected the sections of a case as a dictionary, .*; got an? "):
        Case.parse(values)


CIRCLE: list[Any] = []
CIRCLE += [CIRCLE, CIRCLE]
FAULTY: dict[str, tuple[dict[Any, Any], str]] = {
    "number as section": ({3: {}}, "3: expected a string as key, not an int"),
    "number as key": ({"cell": {3: 4}}, "[cell] 3: expected a string as key, not an int"),
    "number as phase": ({"material": {None: {}}}, "[material] None: expected a string as key, not a NoneType"),
    "key of an arc": (
        {"interface": {"debonded": [{1: 2}]}},
        "[interface.debonded] 1: expected a string as key, not an int",
    ),
    "path as section": ({"cell": Path("cell.msh")}, 'cell = "cell.msh": expected a section [cell]'),
    "array as section": ({"cell": np.zeros(2)}, "cell = [0.0, 0.0]: expected a section [cell]"),
    "pairs as section": ({"cell": [("order", 1)]}, 'cell = [["order", 1]]: expected a section [cell]'),
    "none as section": ({"analysis": None}, "analysis = null: expected a section [analysis]"),
    "none as materials": ({"material": None}, "material = null: expected sections [material.matrix], [material.fibre]"),
    "set as list": ({"angle": {"values": {1}}}, '[angle] values = "{1}": expected a rising list'),
    "complex": ({"cell": {"mesh_size": 1j}}, '[cell] mesh_size = "1j": expected a number'),
    "array of wrong shape": ({"path": {"strain": np.zeros((3, 1))}}, "[path] strain = [[0.0], [0.0], [0.0]]: expected"),
    "nan": ({"cell": {"mesh_size": np.nan}}, "[cell] mesh_size = nan: expected a number"),
    "function": ({"cell": {"geometry": len}}, '[cell] geometry = "<built-in function len>": expected one of'),
    "real as integer": ({"cell": {"refine": np.float64(2)}}, "[cell] refine = 2.0: expected an integer"),
    "integer without end": (
        {"cell": {"refine": 1 << 20_000}},
        "cell.refine: expected no integer of more than 10000 bits",
    ),
    "circle": ({"cell": CIRCLE}, "cell: tables and arrays are nested more than 50 deep"),
    "truth as number": ({"cell": {"refine": np.bool_(True)}}, "[cell] refine = true: expected an integer"),
}


@pytest.mark.parametrize("name", FAULTY)
def test_wrong_types_are_faults_in_a_sentence(name):
    values, expected = FAULTY[name]
    with pytest.raises(CaseError) as caught:
        Case.parse(document_of(BASE) | values)
    assert any(fault.startswith(expected) for fault in caught.value.faults), caught.value.faults
    assert all(len(fault.splitlines()) == 1 for fault in caught.value.faults)


def test_names_that_no_file_can_have_are_refused():
    with pytest.raises(CaseError, match="no file has a name with a null character"):
        Case.load("a\0b")
