"""Files of a cell: the size that it or the case gives, links in a circle and folders."""

from pathlib import Path

import pytest
from support import cases
from support.base_case import BASE, MESH_CELL

from feti_homog.case.cases import load
from feti_homog.errors import CaseError

TABLE = "x,y,radius\n1,1,0.5\n"


def case_of(tmp_path, keys, table=TABLE):
    (tmp_path / "t.csv").write_bytes(table.encode())
    path = tmp_path / "case.toml"
    path.write_text(BASE.replace(MESH_CELL[0], f'geometry = "table"\nfile = "t.csv"\n{keys}'))
    return load(path)


def test_the_case_or_the_table_gives_the_size(tmp_path):
    size = "# width = 4, height = 3\n"
    cells = [
        case_of(tmp_path, "width = 4\nheight = 3").cell,
        case_of(tmp_path, "", size + TABLE).cell,
        case_of(tmp_path, "height = 3", "# width = 4\n" + TABLE).cell,
        case_of(tmp_path, "width = 4", size + TABLE).cell,
    ]
    assert [(cell.table.width, cell.table.height) for cell in cells] == [(4.0, 3.0)] * 4
    assert cells[0].file == tmp_path / "t.csv"


@pytest.mark.parametrize(
    ("keys", "table", "line"),
    [
        ("width = 4", TABLE, r"\[cell\] height: missing; t.csv has no line such as # width = 120, height = 80"),
        ("width = 5\nheight = 3", "# width = 4\n" + TABLE, r"\[cell\] width = 5: t.csv says 4; give one"),
        ("width = 4\nheight = 3", TABLE + "1,2\n", r"\[cell\] t.csv: row 3: expected 3 columns"),
    ],
)
def test_faults_of_sizes_and_rows(keys, table, line, tmp_path):
    with pytest.raises(CaseError, match=line) as error:
        case_of(tmp_path, keys, table)
    assert len(error.value.faults) == 1


SIZES = {"": "4", "refine = 1": "2", "refine = 2": "", "mesh_size = 0.2": "", "accuracy = 0.1": ""}


@pytest.mark.parametrize(("keys", "elements"), SIZES.items())
def test_long_elements_by_default_name_the_way_to_choose_them(keys, elements, tmp_path):
    """0.05 of a width of 40 is 2: four mean radii of 0.5."""
    remarks = case_of(tmp_path, f"width = 40\nheight = 30\n{keys}").remarks()
    assert [line for line in remarks if f"default: elements up to {elements} mean fibre radii" in line] == [*remarks]
    assert bool(remarks) == bool(elements) and all("; accuracy = 0.01 chooses" in line for line in remarks)


def test_the_digest_is_that_of_the_table(tmp_path):
    keys = "width = 4\nheight = 3"
    tables = (TABLE, TABLE.replace("\n", "\r\n"), TABLE.replace("0.5", "0.6"))
    digests = [case_of(tmp_path, keys, table).digest() for table in tables]
    assert digests[0] == digests[1] != digests[2]
    assert case_of(tmp_path, keys + '\nwindow = "cut"').digest() != digests[0]


CELLS = {"file": {"geometry": "table", "file": "loop.csv"}, "match": {"geometry": "random", "match": "loop.csv"}}


@pytest.mark.parametrize("key", CELLS)
@pytest.mark.parametrize(
    ("make", "words"),
    [(lambda path: path.symlink_to("loop.csv"), "no such file"), (Path.mkdir, "a folder; expected a file at /")],
    ids=["a link in a circle", "a folder"],
)
def test_what_is_no_file(key, make, words, tmp_path, monkeypatch):
    make(tmp_path / "loop.csv")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CaseError, match=rf'^\[cell\] {key} = "loop.csv": {words}'):
        cases.case_of(CELLS[key])
