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

TEXT = h5py.string_dtype()
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
    ("/", "width"): (
        (h5py.Empty("f8"), "/width is float64 None"),
        (np.nan, "/width has the number nan"),
        (1e99, "other nodes"),
    ),
    ("/", "refine"): (
        (1.0, r"/refine is float64 \(\), expected int64 \(\)"),
        (-1, "/refine has the number -1, expected 0 to 30"),
        (29, "refine = 29, has other nodes"),
    ),
    ("/", "origin"): ((np.zeros(3), r"/origin is float64 \(3,\), expected float64 \(2,\)"), (None, "cannot read")),
    ("state/0", "strain"): (("E11", r"/state/0/strain is text \(\), expected float64 \(3,\)"),),
    ("state/0", "label"): ((1, r"/state/0/label is int64 \(\), expected text \(\)"),),
}


# The last number of a table, or a whole row of it.
NUMBERS = {
    "a node beyond the last": ("mesh/triangles", 10**9, r"/mesh/triangles has the number 1e\+09, expected 0 to \d+"),
    "a negative node": ("interface/fibre_node", -1, r"/interface/fibre_node has the number -1, expected 0 to"),
    "a flat element": ("mesh/triangles", [0, 0, 0], "1 elements have no area"),
    "a turned element": ("mesh/triangles", slice(None, None, -1), "1 elements have no area"),
    "a body without elements": ("fibre/body", 17, "a fibre has no elements"),
    "an endless body": ("mesh/body", 2**31 - 1, r"/mesh/body has the number 2.14748e\+09"),
    "a negative subdomain": ("mesh/subdomain", -2, "/mesh/subdomain has the number -2"),
    "an endless rank": ("mesh/rank", 2**31 - 1, "/mesh/rank has the number"),
    "an unknown phase": ("mesh/phase", 2, "/mesh/phase has the number 2, expected 0 to 1"),
    "a node nowhere": ("mesh/points", np.nan, "/mesh/points has the number nan"),
    "a large node": ("mesh/points", 1e308, r"/mesh/points has the number 1e\+308, expected -1e\+100 to 1e\+100"),
    "an interface node elsewhere": ("interface/points", 0.123, "interface nodes are not in the mesh"),
    "an unknown fibre": ("interface/fibre_number", 3, "/interface/fibre_number has the number 3, expected 0 to 2"),
    "a negative radius": ("fibre/radius", -1.0, "/fibre/radius has the number -1"),
    "an endless stress": ("state/0/stress", np.inf, "/state/0/stress has the number inf"),
    "an unknown status": ("state/0/status", 3, "/state/0/status has the number 3, expected 0 to 2"),
    "damage beyond 1": ("state/0/damage", 1.5, "/state/0/damage has the number 1.5"),
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


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_out_of_range_are_refused(folder, tmp_path, name):
    table, value, line = NUMBERS[name]
    with h5py.File(shutil.copy(folder / "result.h5", tmp_path), "r+") as file:
        values = file[table][()]
        if isinstance(value, int | float):
            values.ravel()[-1] = value
        else:
            values[-1] = values[-1][value] if isinstance(value, slice) else value
        file[table][...] = values
    with pytest.raises(CaseError, match=line) as error:
        read_state(tmp_path)
    assert len(error.value.faults) == 1


def test_other_states_are_not_read(folder, tmp_path):
    with h5py.File(shutil.copy(folder / "result.h5", tmp_path), "r+") as file:
        file["state/1/stress"][0, 0] = np.nan
    assert read_state(tmp_path, 0).label == "E11"
    with pytest.raises(CaseError, match="/state/1/stress has the number nan"):
        read_state(tmp_path, 1)


def test_tables_in_the_place_of_views_and_other_labels_are_refused(folder, tmp_path):
    edits = {
        "/column/state/0/S11 is no view": lambda file: file["column/state/0"].create_dataset("S11", (3,)),
        "a name is not printable": lambda file: file["state/0"].attrs.create("label", r"$\frac"),
        "its case has other phases": lambda file: file.attrs.create("phases", ["matrix", "steel"], (2,), TEXT),
    }
    for line, edit in edits.items():
        with h5py.File(shutil.copy(folder / "result.h5", tmp_path), "r+") as file:
            if "column" in line:
                del file["column/state/0/S11"]
            edit(file)
        with pytest.raises(CaseError, match=line):
            read_state(tmp_path)


def test_deeply_nested_documents_are_refused(tmp_path):
    text = f'{{"checksum": "", "a": {"[" * 960}{"]" * 960}}}'
    with pytest.raises(ValueError, match=r"nested too deeply|checksum is wrong"):
        result_json.loads(text)
    (tmp_path / "result.json").write_text("[" * 1000 + "]" * 1000)
    with pytest.raises(CaseError, match=r"no run of this program wrote result\.json"):
        output_folder.refuse_files_of_others(tmp_path)
