"""Tables of result.h5 with other shapes or types than the layout's are refused in one line."""

import shutil
import tomllib

import h5py
import numpy as np
import pytest
from support.base_case import changed

from feti_homog import Case, read_state, run
from feti_homog.errors import CaseError
from feti_homog.results import field_guard, output_folder, result_json

TABLES = {
    "mesh/points": (np.array(0.0), r"/mesh/points is float64 \(\), expected float64 \(0, 2\)"),
    "mesh/phase": (np.zeros(3), r"/mesh/phase is float64 \(3,\), expected int32 \("),
    "state/0/stress": (np.zeros((3, 3)), r"/state/0/stress is float64 \(3, 3\), expected float64 \("),
    "fibre/radius": (np.zeros(1, "f2"), r"/fibre/radius is float16 \(1,\), expected float64 \(2,\)"),
}


ATTRIBUTES = {
    ("/", "case"): (
        (np.zeros(3), r"/case is float64 \(3,\), expected text \(\)"),
        ("[]", "no table of keys"),
        ("{}", r"the case in it is damaged: \[cell\]: missing"),
        ("[" * 2000, "nested too deeply"),
    ),
    ("/", "title"): ((np.bytes_(b"x"), r"/title is \|S1 \(\), expected text \(\)"),),
    ("/", "phases"): (("matrix", r"/phases is text \(\), expected text \("),),
    ("/", "width"): ((h5py.Empty("f8"), "/width is float64 None"), (np.nan, "a cell of nan x"), (1e300, "other nodes")),
    ("/", "refine"): ((1.0, r"/refine is float64 \(\), expected int64 \(\)"), (-1, "refine = -1, has other nodes")),
    ("/", "origin"): ((np.zeros(3), r"/origin is float64 \(3,\), expected float64 \(2,\)"), (None, "cannot read")),
    ("state/0", "strain"): (("E11", r"/state/0/strain is text \(\), expected float64 \(3,\)"),),
    ("state/0", "label"): ((1, r"/state/0/label is int64 \(\), expected text \(\)"),),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Provide the folder of a small stiffness with fields."""
    path = tmp_path_factory.mktemp("guarded") / "out"
    case = changed(("mesh_size = 0.05", "mesh_size = 0.3"), end="[output]\npictures = false\n")
    run(Case.parse(tomllib.loads(case)), out=path)
    return path


@pytest.mark.parametrize("name", TABLES)
def test_other_shapes_and_types_are_refused(folder, tmp_path, name):
    table, line = TABLES[name]
    field_guard.require_own(folder / "result.h5")
    with h5py.File(shutil.copy(folder / "result.h5", tmp_path), "r+") as file:
        del file[name]
        file[name] = table
    with pytest.raises(CaseError, match=line):
        read_state(tmp_path)


@pytest.mark.parametrize(("group", "name"), ATTRIBUTES)
def test_attributes_of_other_shapes_and_types_are_refused(folder, tmp_path, group, name):
    for value, line in ATTRIBUTES[group, name]:
        with h5py.File(shutil.copy(folder / "result.h5", tmp_path), "r+") as file:
            del file[group].attrs[name]
            if value is not None:
                file[group].attrs[name] = value
        with pytest.raises(CaseError, match=line) as error:
            read_state(tmp_path)
        assert len(error.value.faults) == 1


def test_deeply_nested_documents_are_refused(tmp_path):
    text = f'{{"checksum": "", "a": {"[" * 960}{"]" * 960}}}'
    with pytest.raises(ValueError, match=r"nested too deeply|checksum is wrong"):
        result_json.loads(text)
    (tmp_path / "result.json").write_text("[" * 1000 + "]" * 1000)
    with pytest.raises(CaseError, match=r"no run of this program wrote result\.json"):
        output_folder.refuse_files_of_others(tmp_path)
