"""The JSON Schema of a case file against the reader: what the one takes, the other takes."""

from __future__ import annotations

import json
import re
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from jsonschema import Draft202012Validator
from support.base_case import BASE
from support.jobs import ROOT
from unit.case.documents import changed_documents, documents
from unit.case.faulty_bonding import FAULTY_BONDINGS
from unit.case.faulty_cases import FAULTY_CASES
from unit.case.faulty_cohesive_laws import FAULTY_COHESIVE_LAWS
from unit.case.faulty_envelopes import FAULTY_ENVELOPES
from unit.case.faulty_loads import FAULTY_LOADS
from unit.case.faulty_sizes import FAULTY_SIZES
from unit.case.faulty_table_cells import FAULTY_TABLE_CELLS
from unit.case.valid_cases import VALID_CASES, VALID_SWEEPS

from feti_homog.case.case import parse
from feti_homog.case.json_schema import json_schema
from feti_homog.errors import CaseError

VALIDATOR = Draft202012Validator(json_schema())
FILES = [path for folder in ("drivers", "scripts/cases") for path in sorted((ROOT / folder).glob("*.toml"))]
FAULTY = (
    FAULTY_CASES
    | FAULTY_BONDINGS
    | FAULTY_COHESIVE_LAWS
    | FAULTY_ENVELOPES
    | FAULTY_LOADS
    | FAULTY_SIZES
    | FAULTY_TABLE_CELLS
)

NO_TOML = {"syntax", "syntax_unclosed", "key_twice", "section_twice", "number_too_long"}
BETWEEN_NUMBERS = {
    "toughness_below_the_triangle", "infinite_strength_of_a_softening_law", "table_that_hardens",
    "table_of_falling_openings", "table_of_unlike_lengths", "table_of_another_stiffness",
    "fibres_touch", "fibres_touch_in_square", "random_too_dense", "poisson_half",
    "orthotropic_unstable", "orthotropic_unstable_third", "stiffness_not_symmetric", "stiffness_indefinite",
    "angle_strain_zero", "path_to_zero", "waypoints_begin_at_zero", "waypoints_repeated", "increments_too_few",
    "poisson_half_in_space", "orthotropic_unstable_in_space",
    "transverse_ratio_nearly_one", "transverse_unstable",
    "stiffness_not_symmetric_in_space", "stiffness_indefinite_in_space", "stiffness_couples_shears",
    "interface_size_above_mesh_size", "interface_size_above_the_default_mesh_size",
    "tip_size_above_mesh_size", "tip_size_above_interface_size",
    "load_of_zero",
    "path_to_a_load_of_zero", "waypoint_of_a_load_of_zero", "waypoint_that_names_what_it_is",
    "waypoint_of_the_strain_that_a_load_is", "increments_too_few_for_loads",
    "accuracy_of_linear_elements_that_nearly_lock", "fibre_with_a_coating",
    "nearly_rigid_fibres", "nearly_void_matrix",
}  # fmt: skip
NOT_IN_JSON = {"fraction_is_nan", "strength_is_nan", "path_strain_nan", "load_nan"}
INTEGER_TO_JSON = {"refine_is_real"}
OUTSIDE_THE_FILE = {"no_table", "mesh_not_there"}
BEYOND_A_SCHEMA = NO_TOML | BETWEEN_NUMBERS | NOT_IN_JSON | INTEGER_TO_JSON | OUTSIDE_THE_FILE


def faults(content: str) -> list[str]:
    return [error.message for error in VALIDATOR.iter_errors(tomllib.loads(content))]


def test_it_is_a_schema():
    Draft202012Validator.check_schema(json_schema())
    assert json.loads(json.dumps(json_schema(), allow_nan=False)) == json_schema()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_files_of_the_repository_are_valid(path):
    assert not faults(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", VALID_CASES)
def test_what_the_reader_takes_is_valid(name):
    assert not faults(VALID_CASES[name])


@settings(deadline=None, derandomize=True, max_examples=50)
@given(documents())
def test_generated_cases_are_valid(document):
    assert not list(VALIDATOR.iter_errors(document))


@pytest.mark.parametrize("name", [name for name in FAULTY if name not in BEYOND_A_SCHEMA])
def test_what_the_reader_refuses_is_not_valid(name):
    assert faults(FAULTY[name][0])


@pytest.mark.parametrize("name", sorted(BEYOND_A_SCHEMA - NO_TOML))
def test_what_is_beyond_a_schema_is_known(name):
    assert not faults(FAULTY[name][0])


BEYOND = re.compile(
    "expected less than|expected at most (mesh_size|interface_size|1e.14)|expected a (load|strain) other than|"
    "no such file|would need elements|at least one for each waypoint|positive definite|symmetric matrix|"
    r"no material is stable|x3 must be normal|as of \[interface 1\]|another pair than|magnitudes from|"
    r"\[cell\] has coatings|no fibre has a coating|fibre_list: row|"
    r"expected at least (normal|tangential)_strength|a softening branch|a rising list of numbers above 0|"
    r"expected as many of both|that of openings and tractions|needs a finite one"
)
"""Faults between numbers, and of files."""
OF_A_MIX = re.compile(
    r"\[material\..*\]: (unknown phase|missing section)|: makes .* fibres|a radius of each|sum below 1"
)
"""Faults of its phases, which the file names."""
MIX = {
    "cell": {
        "geometry": "random", "mix": {"glass": 0.2, "carbon": 0.1}, "radii": {"glass": 6.0, "carbon": 3.5},
        "fibres": 30, "voids": 0.02, "void_radius": 0.5,
    },
    "material": {phase: {"young": 3.0, "poisson": 0.3} for phase in ("matrix", "glass", "carbon")},
    "analysis": {"type": "stiffness", "plane": "strain"},
}  # fmt: skip
SOURCES = [MIX, {**MIX, "cell": MIX["cell"] | {"match": "t.csv", "width": 30.0, "fibre_radius": 1.0}}] * 4
SOURCES += [tomllib.loads(text) for text in VALID_CASES.values()] + [
    tomllib.loads(text) for name, (text, _) in FAULTY.items() if name not in NO_TOML | NOT_IN_JSON | INTEGER_TO_JSON
]


SOURCES += [{**each, "interface": [each["interface"]]} for each in SOURCES if "interface" in each]


@settings(deadline=None, max_examples=max(300, settings.default.max_examples))
@given(changed_documents(SOURCES))
def test_documents_are_valid_if_and_only_if_the_reader_takes_them(document):
    """Compare all that a schema can state; `--hypothesis-profile=search` tries 2 000."""
    refused = reader_faults(document)
    is_valid = VALIDATOR.is_valid(document)
    assert is_valid or refused, document
    if is_valid and "mix" in document["cell"]:
        refused = tuple(fault for fault in refused if not OF_A_MIX.search(fault))
    assert not is_valid or all(map(BEYOND.search, refused)), (refused, document)


def reader_faults(document: dict[str, Any]) -> tuple[str, ...]:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "cell.msh").touch()
        try:
            parse(document, Path(folder))
        except CaseError as error:
            return error.faults
    return ()


@pytest.mark.parametrize("suffix", ["msh", "inp", "vtu", "vtk"])
def test_meshes_of_all_formats_are_valid(suffix):
    assert not faults(VALID_CASES["mesh of three phases"].replace("cell.msh", f"cell.{suffix}"))


def test_a_missing_file_is_reported_beside_other_faults():
    content = VALID_CASES["mesh of three phases"].replace('file = "cell.msh"', "order = 3")
    found = reader_faults(tomllib.loads(content))
    assert len(found) == 2 and "[cell] file: missing" in found[1] and "[cell] order = 3" in found[0]


@pytest.mark.parametrize("name", VALID_SWEEPS)
def test_sweeps_are_valid(name):
    assert not faults(VALID_SWEEPS[name])


@pytest.mark.parametrize(
    "table",
    [
        "realisation = 3", "cel.order = [1]", "name = ['a']", "cell.order = 2", "cell.order = []", "mode = 'rows'",
        "cell.fibre_fraction = {from = 0.1, to = 0.3, by = 0.1}", "cell.fibre_fraction = {from = 0.1}",
        "cell.fibre_fraction = {from = 0.1, to = 0.3, count = 1}",
        "cell.fibre_fraction = {from = 0.1, to = 0.3, step = 0.0}", "samples = 0", "'cel.order' = [1]",
    ],
)  # fmt: skip
def test_faulty_sweeps_are_not_valid(table):
    assert faults(f"{BASE}[sweep]\n{table}\n")


def test_what_a_sweep_leaves_out_may_still_be_faulty():
    assert faults(VALID_SWEEPS["tables"].replace("mesh_size = 0.05", "mesh_size = 5"))
