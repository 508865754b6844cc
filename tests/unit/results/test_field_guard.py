"""Tables of result.h5 with other shapes or types than the layout's are refused in one line."""

import shutil
import tomllib

import h5py
import numpy as np
import pytest
from support.base_case import changed

from feti_homog import Case, read_state, run
from feti_homog.errors import CaseError
from feti_homog.results import field_guard, output_folder

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
        ("[" * 60_000, "nested too deeply"),
    ),
    ("/", "title"): ((np.bytes_(b"x"), r"/title is \|S1 \(\), expected text \(\)"),),
    ("/", "phases"): (("matrix", r"/phases is text \(\), expected text \("),),
    ("/", "width"): (
        (h5py.Empty("f8"), "/width is float64 None"),
        (np.nan, "/width has the number nan"),
        (1e99, "other nodes"),
        (10.0, "a cell of 10 x .*, refine = 0, has other nodes"),
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
    "damage that is none": ("state/0/damage", np.nan, "/state/0/damage has the number nan"),
    "a long normal": ("interface/normal", 2.0, "/interface/normal has the number 2, expected -1.01 to 1.01"),
    "an unknown pair": ("interface/pair", -1, "/interface/pair has the number -1, expected 0 to 1000"),
    "a negative length": ("interface/length", -1.0, "/interface/length has the number -1"),
    "a fibre without a number": ("fibre/number", 0, "/fibre/number has the number 0, expected 1 to 2"),
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


def viewed(file, source, **more):
    """Put a view of the first column of `source`, a file and table, in the place of a view."""
    layout = h5py.VirtualLayout(shape := file["column/state/0/S11"].shape, "f8")
    del file["column/state/0/S11"]
    layout[:] = h5py.VirtualSource(*source, (*shape, 3))[:, 0]
    file.create_virtual_dataset("column/state/0/S11", layout, **more)


OWN, S11 = (".", "/state/0/stress"), "/column/state/0/S11 is no"
EDITS = {
    "a table for a view": (
        f"{S11} view",
        lambda file: (file.pop("column/state/0/S11"), file.create_dataset(S11[:-6], (3,))),
    ),
    "a filled view": (f"{S11} view", lambda file: viewed(file, OWN, fillvalue=1.0)),
    "a view of another file": (f"{S11}t a table", lambda file: viewed(file, ("other.h5", OWN[1]))),
    "raw data of another file": (
        "/x is not a table",
        lambda file: file.create_dataset("x", 3, external=[("y", 0, 24)]),
    ),
    "a table without data": ("/x is not a table", lambda file: file.create_dataset("x", 10**7, chunks=99)),
    "a formula": ("a name has . or is not printable", lambda file: file["state/0"].attrs.create("label", r"$\frac")),
    "two lines": ("a name has . or is not printable", lambda file: file["state/0"].attrs.create("label", "a\nb")),
    "other phases": ("other phases", lambda file: file.attrs.create("phases", ["matrix", "steel"], (2,), TEXT)),
}


@pytest.mark.parametrize("name", EDITS)
def test_other_tables_views_and_labels_are_refused(folder, tmp_path, name):
    line, edit = EDITS[name]
    with h5py.File(shutil.copy(folder / "result.h5", tmp_path), "r+") as file:
        edit(file)
    with pytest.raises(CaseError, match=line):
        read_state(tmp_path)


def test_all_rows_of_a_long_table_are_compared():
    rows = np.zeros(200_000)
    for wrong in (0, 70_000, len(rows) - 1):
        field_guard._require_values("/x", "damage", {}, rows)
        with pytest.raises(CaseError, match="/x has the number 2, expected -1e-06 to 1"):
            field_guard._require_values("/x", "damage", {}, np.where(np.arange(len(rows)) == wrong, 2.0, rows))


def test_deeply_nested_documents_are_refused(tmp_path):
    (tmp_path / "result.json").write_text("[" * 1000 + "]" * 1000)
    with pytest.raises(CaseError, match=r"no run of this program wrote result\.json"):
        output_folder.refuse_files_of_others(tmp_path)
