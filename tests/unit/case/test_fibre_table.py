"""Reading tables of fibres: their dialects, and a line for each fault."""

import numpy as np
import pytest
from unit.case.faulty_fibre_tables import FAULTY_TABLES, HEAD

from feti_homog.errors import MOST_FAULTS, CaseError
from feti_homog.microstructure.fibre_table import read_table, table_of

PLAIN = """# width = 12, height = 8.5
# left = -1
x,y,radius,phase
1.5,2,0.5,glass
4,-5.25,0.75,
"""
DIALECTS = {
    "plain": PLAIN,
    "windows": "\ufeff" + PLAIN.replace("\n", "\r\n"),
    "semicolons": PLAIN.replace(",", ";"),
    "decimal commas": PLAIN.replace(",", ";").replace(".", ","),
    "tabs": PLAIN.replace(",", "\t"),
    "order and case": "#width=12\n# height: 8.5\n#left=-1\nRadius, PHASE ,Y,x\n0.5,glass,2,1.5\n0.75,,-5.25,4\n",
    "quotes and comments": PLAIN.replace("glass", '"glass" # E').replace("x,y", '"x", "y"').replace("4,", "\n 4 ,"),
}


def fibres(path, text):
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_table(path)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_dialects_say_the_same(dialect, tmp_path):
    table = fibres(tmp_path / "t.csv", DIALECTS[dialect])
    assert np.array_equal(table.centres, [[1.5, 2.0], [4.0, -5.25]]) and np.array_equal(table.radius, [0.5, 0.75])
    assert table.phase == ("glass", "fibre")
    assert (table.width, table.height, table.left, table.bottom) == (12.0, 8.5, -1.0, None)
    assert not table.given & {"coating", "a", "b", "angle"} and not table.coating.any()


def test_optional_columns_and_the_rows_of_fibres(tmp_path):
    text = "x,y,radius,coating,a,b,angle\n# first\n1,2,3,0.1,,,\n\n1,2,,,4,5,\n"
    table = fibres(tmp_path / "t.csv", text)
    assert table.row.tolist() == [3, 5] and table.coating.tolist() == [0.1, 0.0]
    assert np.array_equal(table.columns["radius"], [3, np.nan], equal_nan=True)
    assert np.array_equal(table.columns["a"], [np.nan, 4], equal_nan=True)
    assert table.columns["angle"].tolist() == [0, 0]


@pytest.mark.parametrize("name", FAULTY_TABLES)
def test_each_fault_is_one_line_with_its_row(name, tmp_path):
    text, line = FAULTY_TABLES[name]
    with pytest.raises(CaseError) as error:
        fibres(tmp_path / "t.csv", text)
    assert len(error.value.faults) == 1 and error.value.faults[0].startswith(line)


def test_all_faults_are_reported_and_many_are_counted(tmp_path):
    with pytest.raises(CaseError) as error:
        fibres(tmp_path / "t.csv", HEAD + "1,here,-3\n" * 100)
    assert len(error.value.faults) == MOST_FAULTS + 1
    assert error.value.faults[1] == "t.csv: row 2: radius = -3.0: expected a number above 0"
    assert error.value.faults[-1] == "and 180 more faults"


def test_a_file_that_is_not_there_is_reported(tmp_path):
    with pytest.raises(CaseError, match=r"none.csv: cannot be read: No such file"):
        read_table(tmp_path / "none.csv")


def test_a_list_is_read_as_a_table():
    table = table_of([{"x": 1, "y": 2.5, "radius": 3, "phase": "glass"}, {"x": 4, "y": 5, "radius": 6}], "list")
    assert table.row.tolist() == [1, 2] and table.phase == ("glass", "fibre") and table.width is None
    assert table.centres.tolist() == [[1, 2.5], [4, 5]]


def test_faults_of_a_list_count_its_rows():
    good = {"x": 1, "y": 2, "radius": 3}
    with pytest.raises(CaseError) as error:
        table_of([good | {"y": True}, {"x": 1, "y": 2, "radus": 3}, good | {"radius": "3"}], "list")
    assert error.value.faults == (
        "list: row 2: radus = 3: unknown key; did you mean radius?",
        "list: row 1: y = true: expected a number",
        "list: row 2: radius: no value; expected a number",
        'list: row 3: radius = "3": expected a number above 0',
    )
