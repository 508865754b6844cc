"""Tables of fibres: dialects, tables of other programs, and a line for each fault."""

import numpy as np
import pytest
from support.cases import case_of
from unit.case.faulty_fibre_tables import FAULTY_TABLES, HEAD

from feti_homog.errors import MOST_FAULTS, CaseError, MeshError
from feti_homog.mesh.arrange import arrange
from feti_homog.microstructure.fibre_table import read_table, table_of

SIZE = "# width = 8, height = 6\n"
TABLES = {
    "ImageJ": " ,Area,X,Y,Major,Minor,Angle\n1,3.141593,2,2,2,2,0\n2,4.523893,5,4,2.4,2.4,90\n",
    "ImageJ, areas": " \tLabel\tArea\tXM\tYM\tCirc.\n1\ta.tif\t3.14159265\t2\t2\t1\n2\ta.tif\t4.52389342\t5\t4\t1\n",
    "pandas": ",id,x,y,diameter\n0,17,2.0,2.0,2.0\n1,18,5.0,4.0,2.4\n",
    "R": '"","x","y","r"\n"1",2,2,1\n"2",5,4,1.2\n',
    "German Excel": "Nr;X [µm];Y [µm];Durchmesser;D (µm)\n1;2,0;2,0;-;2,0\n2;5,0;4,0;-;2,4\n",
    "units after a stroke": "x / um\ty / um\td / um\n2\t2\t2\n5\t4\t2.4\n",
    "NumPy": "# x y radius\n x y radius \n2.0e+00 2.0e+00 1.0e+00\n5.0e+00 4.0e+00 1.2e+00\n",
    "MATLAB": "  x_c    y_c   diam\n   2      2      2\n   5      4    2.4\n",
    "regionprops": "label,centroid_x,centroid_y,area,eccentricity\n1,2,2,3.14159265,0\n2,5,4,4.52389342,0\n",
    "microscope": "Type,Center_X (um),Center_Y (um),Radius (um),Time\nfibre,2,2,1,12:00\nfibre,5,4,1.2,12:01\n",
    "capitals": "X,Y,R,ID\n2,2,1,F1\n5,4,1.2,F2\n",
    "Excel for others": "sep=;\nx;y;d\n2,0;2,0;2,0\n5,0;4,0;2,4\n;;\n",
    "units below": "x,y,diameter\num,um,um\n2,2,2\n5,4,2.4\n",
    "units by strokes": "fiber_id,center_x_um,center_y_um,fiber_diameter_um\n1,2,2,2\n2,5,4,2.4\n",
    "MATLAB's regionprops": "Centroid_1,Centroid_2,EquivDiameter\n2,2,2\n5,4,2.4\n",
    "scikit-image": "label,centroid-0,centroid-1,equivalent_diameter_area\n1,2,2,2\n2,4,5,2.4\n",
    "QuPath": "Image\tClass\tCentroid X µm\tCentroid Y µm\tArea µm^2\na\tfibre\t2\t2\t3.14159265\n"
    "b\tfibre\t5\t4\t4.52389342\n",
    "rows and columns": "Row px,Col px,Diameter px\n2,2,2\n4,5,2.4\n",
    "blanks in names": "X,Y,Equivalent Diameter [um]\n2,2,2\n5,4,2.4\n",
    "own": "x,y,radius,phase\n2,2,1,fibre\n5,4,1.2,\n",
}
WHOLLY_READ = (
    "own", "NumPy", "MATLAB", "units after a stroke", "Excel for others", "units below", "blanks in names",
)  # fmt: skip
MIRRORED = ("ImageJ", "scikit-image", "MATLAB's regionprops", "rows and columns")


def case(path, text, **cell):
    path.write_text(text)
    return case_of({"geometry": "table", "file": str(path)} | cell)


def is_expected(table):
    np.testing.assert_allclose(table.centres, [[2, 2], [5, 4]])
    np.testing.assert_allclose(table.radius, [1.0, 1.2], rtol=1e-6)
    assert table.phase == ("fibre", "fibre")


@pytest.mark.parametrize("writer", TABLES)
def test_a_strangers_table_is_read_as_it_is(tmp_path, writer):
    read = case(tmp_path / "t.csv", SIZE + TABLES[writer])
    is_expected(read.cell.table)
    assert len(arrange(read.cell).radii) == 2
    assert bool(read.remarks()) == (writer not in WHOLLY_READ)
    assert any("mirrors the picture" in remark for remark in read.remarks()) == (writer in MIRRORED)


@pytest.mark.parametrize("name", ["t.txt", "t.dat", "t.csv", "t.TSV"])
@pytest.mark.parametrize("mark", [" ", ",", ";\t"])
def test_a_table_without_names_is_read_by_those_of_the_case(tmp_path, name, mark):
    text = SIZE + "\n".join(mark[:1].join(row) for row in (["7", "2", "2", "2"], ["8", "5", "4", "2.4"]))
    is_expected(case(tmp_path / name, text, columns=["number", "x", "y", "d"]).cell.table)
    with pytest.raises(CaseError, match=r"expected names of columns, such as x, y, radius, here or in \[cell\]"):
        case(tmp_path / name, text)


@pytest.mark.parametrize("names", ["Var1,Var2,Var3", "Durchmesser,Rechtswert,Hochwert", "d,x,y\num,um,um"])
def test_names_of_the_case_take_the_place_of_those_of_the_table(tmp_path, names):
    text = f"{SIZE}{names}\n2,2,2\n2.4,5,4\n"
    is_expected(case(tmp_path / "t.csv", text, columns=["d", "x", "y"]).cell.table)
    with pytest.raises(CaseError, match=r'row 2: x = "here": expected a number'):
        case(tmp_path / "t.csv", f"{SIZE}2,here,2\n2.4,5,4\n", columns=["d", "x", "y"])


def test_excels_units_need_no_utf_8(tmp_path):
    (tmp_path / "t.csv").write_bytes((SIZE + "x;y;Radius (µm)\r\n2,0;2,0;1,0\r\n5;4;1,2\r\n").encode("cp1252"))
    is_expected(read_table(tmp_path / "t.csv"))


def test_both_letters_of_micro_are_one_unit(tmp_path):
    (tmp_path / "t.csv").write_text("# width = 7\u03bcm, height = 6 um\nx (\u00b5m),y (um),r (UM)\n2,2,1\n")
    table = read_table(tmp_path / "t.csv")
    assert (table.width, table.height) == (7.0, 6.0)


@pytest.mark.parametrize("coding", ["utf-16", "utf-8-sig"])
@pytest.mark.parametrize("writer", ["German Excel", "QuPath"])
def test_marks_of_the_coding_are_no_part_of_a_table(tmp_path, writer, coding):
    (tmp_path / "T.CSV").write_bytes((SIZE + TABLES[writer]).encode(coding))
    is_expected(read_table(tmp_path / "T.CSV"))
    (tmp_path / "T.CSV").write_bytes("\ufeffx,y".encode("utf-16-be")[:-1])  # half a character
    with pytest.raises(CaseError, match=r"T\.CSV: expected text in UTF-8"):
        read_table(tmp_path / "T.CSV")


@pytest.mark.parametrize("names", ["X,Y,Major,Minor,Angle", "X,Y,MajorAxisLength,MinorAxisLength,Orientation"])
def test_angles_of_imagej_are_those_of_pictures_whose_y_points_down(tmp_path, names):
    (tmp_path / "t.csv").write_text(f"{names}\n2,2,2,1,30\n")
    columns = read_table(tmp_path / "t.csv").columns
    assert [columns[name][0] for name in ("a", "b", "angle")] == [1.0, 0.5, -30.0]


@pytest.mark.parametrize("angle", [20.0, -65.0])
def test_ellipses_of_scikit_image_are_those_that_it_saw(tmp_path, angle):
    """An ellipse with its axis at this angle from the columns to the rows, measured by `regionprops_table`."""
    measure = pytest.importorskip("skimage.measure")
    row, column = np.mgrid[:200, :200] - 100.0
    along = column * np.cos(np.radians(angle)) + row * np.sin(np.radians(angle))
    across = row * np.cos(np.radians(angle)) - column * np.sin(np.radians(angle))
    picture = ((along / 60) ** 2 + (across / 25) ** 2 <= 1.0).astype(int)
    names = ("centroid", "axis_major_length", "axis_minor_length", "orientation")
    table = measure.regionprops_table(picture, properties=names)
    rows = zip(*table.values(), strict=True)
    (tmp_path / "t.csv").write_text("\n".join([",".join(table), *(",".join(map(str, row)) for row in rows)]))
    columns = read_table(tmp_path / "t.csv").columns
    assert [columns[name][0] for name in ("a", "b")] == pytest.approx([60.0, 25.0], rel=0.01)
    assert (columns["angle"][0] - angle + 90.0) % 180.0 - 90.0 == pytest.approx(0.0, abs=0.5)


def test_what_is_not_read_is_remarked(tmp_path):
    read = case(tmp_path / "t.csv", SIZE + TABLES["pandas"])
    assert read.remarks() == ('[cell] t.csv: not read: "", "id"',)
    with pytest.raises(CaseError, match='column radius: missing; not read: "size"'):
        case(tmp_path / "t.csv", SIZE + "x,y,size\n2,2,1\n")


def test_a_cut_window_leaves_out_centres_outside(tmp_path):
    text = "# width = 8, height = 6, left = 0, bottom = 0\nx,y,r\n2,2,1\n-0.5,3,1\n5,4,1.2\n4,7,1\n"
    read = case(tmp_path / "t.csv", text, window="cut")
    is_expected(read.cell.table)
    assert read.remarks() == ('[cell] window = "cut": leaves out 2 rows with centres outside: 4, 6',)


TOUCHING = "x,y,r\n2,2,1\n3.995,2,1\n6,4,0.5\n"


def test_small_overlaps_are_repaired_where_that_is_asked_for(tmp_path):
    """Radii of 1 overlap by 0.005."""
    with pytest.raises(MeshError, match=r'rows 3 and 4: overlap by 0\.005; repair = "overlaps" makes them smaller'):
        arrange(case(tmp_path / "t.csv", SIZE + TOUCHING).cell)
    found = arrange(case(tmp_path / "t.csv", SIZE + TOUCHING, repair="overlaps").cell)
    radii = found.radii * 8
    assert radii[2] == pytest.approx(0.5) and (radii[:2] > 0.997).all() and radii[:2].sum() < 1.995
    assert found.remarks == ('[cell] repair = "overlaps": rows 3, 4 are smaller by up to 0.26 %',)


def test_overlaps_that_no_repair_is_for_are_refused(tmp_path):
    text = SIZE + TOUCHING.replace("3.995", "3.95")
    with pytest.raises(MeshError, match=r"rows 3 and 4: overlap by 0\.05$"):
        arrange(case(tmp_path / "t.csv", text, repair="overlaps").cell)
    with pytest.raises(CaseError, match='expected "none" or "overlaps" for geometry = "table"'):
        case(tmp_path / "t.csv", SIZE + TOUCHING, repair="snap")


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
