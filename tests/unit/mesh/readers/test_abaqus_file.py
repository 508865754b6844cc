"""Input files of Abaqus: what they may have, and their faults."""

import meshio
import numpy as np
import pytest
from support.abaqus import write_inp
from unit.mesh.faulty_meshes import RIGHT_SIDE, grid

from feti_homog.errors import MeshError
from feti_homog.mesh.readers import abaqus_file, abaqus_keywords
from feti_homog.mesh.readers.msh_reader import read

SQUARE = """*NODE
1, 0, 0
2, 1, 0
3, 1, 1
4, 0, 1
*ELEMENT, TYPE=CPS3, ELSET=matrix
1, 1, 2, 3
2, 1, 3, 4
"""


def test_sets_of_element_lines_and_of_sections_are_phases_too(tmp_path):
    expected = read(write_inp(tmp_path / "one.inp", grid()))
    path = write_inp(tmp_path / "two.inp", grid(), sets=False)
    assert np.array_equal(read(path).phase, expected.phase)
    tags = sorted(tag for tag, e in grid().elements.items() if e[1] == 2)
    pairs = [f"{tag}, {tag + 1}, 1" for tag in tags[::2]]
    text = path.read_text().replace("elset=fibre", "elset=one").replace("elset=matrix", "elset=other")
    sets = ["*ELSET, ELSET=fibre, GENERATE", *pairs, "*ELSET, ELSET=matrix", "other", "*ELSET, ELSET=left", "1, 2"]
    sections = [f"*SOLID SECTION, ELSET={name}, MATERIAL=steel\n1.," for name in ("fibre", "matrix")]
    path.write_text(text.replace("*END PART\n", "\n".join([*sets, *sections, "*END PART", ""])))
    assert np.array_equal(read(path).phase, expected.phase)


def test_quadrilaterals_written_by_meshio_are_read(tmp_path):
    """Under the name of an axisymmetric element, with sets of numbers."""
    points = [[float(i), float(j)] for j in range(3) for i in range(3)]
    quads = np.array([[k, k + 1, k + 4, k + 3] for k in (0, 1, 3, 4)])
    sets = {"matrix": [np.array([0, 2])], "fibre": [np.array([1, 3])]}
    meshio.write(tmp_path / "m.inp", meshio.Mesh(points, [("quad", quads)], cell_sets=sets))
    assert "CAX4P" in (tmp_path / "m.inp").read_text()
    mesh = read(tmp_path / "m.inp")
    assert len(mesh.triangles) == 8 and len(np.unique(mesh.phase)) == 2


def test_lines_are_debonded_or_of_a_phase_by_their_set(tmp_path):
    path = write_inp(tmp_path / "one.inp", grid().with_curve(RIGHT_SIDE), sets=False)
    assert len(read(path).debonded_edges) == len(RIGHT_SIDE)
    path = write_inp(tmp_path / "one.inp", grid().with_curve(RIGHT_SIDE, "matrix"))
    assert read(path).remarks == ()


@pytest.mark.parametrize(("kind", "nodes"), [("B22", "1, 5, 3"), ("B33H", "1, 3, 5"), ("B33", "1, 3")])
def test_lines_of_three_nodes_end_where_abaqus_and_meshio_say(kind, nodes, tmp_path):
    path = tmp_path / "lines.inp"
    path.write_text(SQUARE + f"*NODE\n5, 0.5, 0.5\n*ELEMENT, TYPE={kind}, ELSET=debonded\n7, {nodes}\n")
    assert abaqus_file.load(path).curves["debonded"].tolist() == [[1, 3]]


def test_nodes_of_the_assembly_are_not_those_of_the_part(tmp_path):
    """A reference point has a number that a node of the part has too."""
    expected = read(write_inp(tmp_path / "one.inp", grid()))
    points = "*ASSEMBLY, NAME=a\n*INSTANCE, NAME=b, PART=cell\n*END INSTANCE\n*NODE\n1, 0.3, 0.3\n*END ASSEMBLY\n"
    (tmp_path / "two.inp").write_text((tmp_path / "one.inp").read_text() + points)
    assert np.array_equal(read(tmp_path / "two.inp").points, expected.points)


KEYWORDS = (
    "*ELEM, TYPE=CPS3, ELSET=matrix",
    "* E l e m e n t, ELS=matrix, TYP=CPS3",
    "*element,\ntype=CPS3,\nelset=matrix",
)


@pytest.mark.parametrize("line", KEYWORDS)
def test_abbreviations_blanks_and_open_lines_are_read(line, tmp_path):
    """Keywords and parameters need as many letters as tell them from others; blanks do not matter."""
    (tmp_path / "a.inp").write_text(SQUARE)
    expected = abaqus_file.load(tmp_path / "a.inp")
    (tmp_path / "b.inp").write_text(
        SQUARE.replace("*ELEMENT, TYPE=CPS3, ELSET=matrix", line).replace("*NODE", "*Nod e")
    )
    result = abaqus_file.load(tmp_path / "b.inp")
    assert np.array_equal(result.triangles, expected.triangles) and result.groups == (("matrix",),)


def test_no_keyword_without_elements_is_the_beginning_of_one_with_them():
    """Otherwise a misspelt one would be passed over."""
    names = [name.replace(" ", "") for name in (*abaqus_keywords.READ, *abaqus_keywords.REFUSED)]
    assert [name for name in names if name.startswith(abaqus_keywords.OTHERS)] == []
    for name in abaqus_keywords.READ:
        assert abaqus_keywords.resolved(name.lower()) == name
        with pytest.raises(ValueError, match="unknown keyword"):
            abaqus_keywords.resolved(f"{name}S")


@pytest.mark.parametrize("old", ["E+00", "D+00", "d0"])
def test_a_byte_order_mark_and_exponents_of_fortran_are_read(old, tmp_path):
    text = SQUARE.replace(", 1\n", f", 1.0{old}\n").encode()
    (tmp_path / "a.inp").write_bytes(b"\xef\xbb\xbf" + text)
    assert np.ptp(abaqus_file.load(tmp_path / "a.inp").points, axis=0).tolist() == [1, 1, 0]


@pytest.mark.parametrize("section", ["*SOLID SECTION", "*Membrane Section", "*SHELLSECTION"])
def test_materials_of_sections_are_phases_if_their_sets_are_not(section, tmp_path):
    expected = read(write_inp(tmp_path / "one.inp", grid()))
    text = (tmp_path / "one.inp").read_text().replace("=MATRIX", "=SET-M").replace("=FIBRE", "=SET-F")
    sections = "".join(f"{section}, ELSET=SET-{name[0]}, MAT={name}\n1.\n" for name in ("FIBRE", "MATRIX"))
    (tmp_path / "two.inp").write_text(text.replace("*END PART\n", f"{sections}*END PART\n"))
    assert np.array_equal(read(tmp_path / "two.inp").phase, expected.phase)
    by_sets = read(tmp_path / "two.inp", phases={"matrix": ("set-m",), "fibre": ("set-f",)})
    assert np.array_equal(by_sets.phase, expected.phase)


FAULTS = [
    ("no triangles in it", "*HEADING\nempty\n"),
    ("line 6, *ELEMENT: element 1 has 3 nodes: expected 8", SQUARE.replace("CPS3", "CPE8R")),
    ("elements are of no TYPE", SQUARE.replace("TYPE=CPS3, ", "")),
    ("element 1 has 2 nodes: expected 3", SQUARE.replace("1, 1, 2, 3", "1, 1, 2")),
    ('line 1, *NODE: "one": expected a number', SQUARE.replace("3, 1, 1", "3, one, 1")),
    ("1111...: expected a number", SQUARE.replace("3, 1, 1", f"3, {'1' * 1000}x, 1")),
    ('"3.5": expected a whole number', SQUARE.replace("3, 1, 1", "3.5, 1, 1")),
    ('line 1, *NODE: "": expected a whole number', SQUARE.replace("3, 1, 1", ", ,")),
    *((f"line 9, *{keyword}: it makes or moves nodes", SQUARE + f"*{keyword}\n1, 0, 0\n")
      for keyword in ("SYSTEM", "NGEN", "NFILL", "NCOPY", "ELGEN", "ELCOPY", "IMPERFECTION")),
    ("line 1, *NODE: its parameter SYSTEM is not read: expected Cartesian coordinates",
     SQUARE.replace("*NODE", "*NODE, SYSTEM=C")),
    *((f'line 9, *{keyword.split(",")[0]}: its parameter "INPUT" is not read', SQUARE + f"*{keyword}, INPUT=b.inp\n")
      for keyword in ("NODE", "ELEMENT, TYPE=CPS3", "ELSET, ELSET=fibre")),
    ("line 9, *EL: may be several keywords: write it out, or delete it if it makes no nodes or elements",
     SQUARE + "*EL, TYPE=CPS3\n"),
    ("line 9, *ELEMENTS: unknown keyword: write it out, or delete it if it makes no nodes or elements",
     SQUARE + "*ELEMENTS, TYPE=CPS3, ELSET=fibre\n3, 1, 2, 3\n"),
    ("line 9, *: unknown keyword", SQUARE + "*\n3, 1, 2, 3\n"),
    ('line 9, *ELSET: its parameter "IN" is not read', SQUARE + "*ELSET, ELSET=fibre, IN\n1, 2\n"),
    ("line 1: data without a keyword: expected *NODE, *ELEMENT", "1, 0, 0\n" + SQUARE),
    *((f"line 9, *ELEMENT: elements are {kind}: only triangles of three or six nodes and quadrilaterals of four",
       SQUARE + f"*ELEMENT, TYPE={kind}, ELSET=fibre\n3, 1, 2, 3, 4\n")
      for kind in ("C3D4", "C3D8", "CAX8", "CAX3", "SC6R", "MASS", "AC2D3", "U1")),
    *((f"line 9, *ELEMENT: elements are {kind}: delete cohesive elements and merge the nodes of their faces; [interf",
       SQUARE + f"*ELEMENT, TYPE={kind}, ELSET=bond\n3, 1, 2, 3, 4\n") for kind in ("COH2D4", "COHAX4", "COH2D4P")),
    ('*NODE: "0.2_5": expected a number', SQUARE.replace("3, 1, 1", "3, 0.2_5, 1")),
    ('*ELEMENT: "٣": expected a whole number', SQUARE.replace("2, 1, 3, 4", "2, 1, ٣, 4")),
    ('"99999999999999999999": expected a whole number of at most 15 digits',
     SQUARE.replace("2, 1, 3, 4", f"{'9' * 20}, 1, 3, 4")),
    ("line 1, *NODE: node 3 has no coordinates", SQUARE.replace("3, 1, 1", "3,")),
    ('line 1, *NODE: "": expected a number', SQUARE.replace("3, 1, 1", "3, , 1")),
    ("line 9, *NODE: node 3 is there twice", SQUARE + "*NODE\n3, 0, 0\n"),
    ("element 1 is there twice", SQUARE.replace("2, 1, 3, 4", "1, 1, 3, 4")),
    ("line 10, *INSTANCE: a second instance: expected one, in", SQUARE + "*INSTANCE\n*INSTANCE\n"),
    ("line 10, *ELEMENT: elements of the assembly are not read: expected all in the part",
     SQUARE + "*ASSEMBLY, NAME=a\n*ELEMENT, TYPE=T2D2, ELSET=debonded\n7, 1, 2\n*END ASSEMBLY\n"),
    ("line 9, *INSTANCE: its rotation is not read: rotate the part",
     SQUARE + "*INSTANCE, NAME=b\n0, 0, 0\n0, 0, 0, 0, 0, 1, 90\n"),
    *((f"line 9, *ELSET: {row}: expected the first element, the last and a step of at least 1",
       f"{SQUARE}*ELSET, ELSET=fibre, GENERATE\n{row}\n")
      for row in ("30, 1, 1", "1, 2, 0", "1, 2, -1", "1", "1, 2, 1, 1")),
    ("line 9, *ELSET: its sets have more members than a file of this length can have elements",
     SQUARE + "*ELSET, ELSET=fibre, GENERATE\n1, 1000000000000, 1\n"),
    ("line 9, *ELSET: its sets have more members", SQUARE + "*ELSET, ELSET=fibre, GENERATE\n" + "1, 10000\n" * 101),
    ("line 11, *ELSET: its sets have more members",
     SQUARE + "*ELSET, ELSET=b, GENERATE\n1, 10000\n*ELSET, ELSET=fibre\n" + "b\n" * 101),
    ("line 9, *ELEMENT: element 7 has 1 nodes: expected 2 or 3",
     SQUARE + "*ELEMENT, TYPE=T3D2, ELSET=debonded\n7, 1\n"),
    ('lines in the element set "debonded" that are no edges of triangles: that between nodes 1 and 5',
     SQUARE.replace("4, 0, 1\n", "4, 0, 1\n5, 2, 2\n") + "*ELEMENT, TYPE=B21, ELSET=debonded\n7, 1, 5\n"),
    ("element 2 is there twice", SQUARE + "*ELEMENT, TYPE=CPS3\n2, 1, 3, 4\n"),
    ("element 2: there is no node 9", SQUARE.replace("2, 1, 3, 4", "2, 1, 3, 9")),
    ('there is no element set "other"', SQUARE + "*ELSET, ELSET=fibre\nother\n"),
    ('element set "steel": there is none', SQUARE + "*SOLID SECTION, ELSET=steel\n"),
    ("line 9, *ELSET: no ELSET", SQUARE + "*ELSET\n1\n"),
    ("line 2, *PART: a second part: expected one", "*PART, NAME=a\n*PART, NAME=b\n" + SQUARE),
    ("other files are not read", "*INCLUDE, INPUT=b.inp\n" + SQUARE),
    ("no element sets: expected one for each phase, such as *ELEMENT, TYPE=CPS3, ELSET=matrix",
     SQUARE.replace(", ELSET=matrix", "")),
    ("element 1 at (0.666666667, 0.333333333): not in any element set",
     SQUARE.replace(", ELSET=matrix", "") + "*ELSET, ELSET=matrix\n2,\n"),
    ("element 2 at (0.333333333, 0.666666667) is in 2 element sets: fibre, matrix",
     SQUARE + "*ELSET, ELSET=fibre\n1, 2\n*ELSET, ELSET=matrix\n2,\n"),
    ('element set is named "matrix"', SQUARE.replace("matrix", "m:")),
]  # fmt: skip


@pytest.mark.parametrize(("message", "content"), FAULTS, ids=[words for words, _ in FAULTS])
def test_faulty_mesh_is_refused(message, content, tmp_path):
    (tmp_path / "a.inp").write_text(content)
    with pytest.raises(MeshError) as caught:
        read(tmp_path / "a.inp")
    assert any(message in fault for fault in caught.value.faults), caught.value
    assert all("a.inp" in fault and "\n" not in fault for fault in caught.value.faults)
