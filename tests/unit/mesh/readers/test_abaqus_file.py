"""Input files of Abaqus: what they may have, and their faults."""

from collections.abc import Callable
from pathlib import Path

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


def test_debonded_lines_may_be_the_set_of_an_element_line(tmp_path):
    path = write_inp(tmp_path / "one.inp", grid().with_curve(RIGHT_SIDE), sets=False)
    assert len(read(path).debonded_edges) == len(RIGHT_SIDE)


def test_lines_in_a_set_of_a_phase_are_not_remarked(tmp_path):
    path = write_inp(tmp_path / "one.inp", grid().with_curve(RIGHT_SIDE, "matrix"))
    assert read(path).remarks == ()


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


def _text(content: str) -> Callable[[Path], Path]:
    def write(path: Path) -> Path:
        path.write_text(content)
        return path

    return write


FAULTS = {
    "missing": (lambda path: path, "cannot be read"),
    "no triangles": (_text("*HEADING\nempty\n"), "no triangles in it"),
    "quadrilaterals": (
        _text(SQUARE.replace("CPS3", "CPE8R")),
        "line 6, *ELEMENT: element 1 has 3 nodes: expected 8",
    ),
    "no type": (_text(SQUARE.replace("TYPE=CPS3, ", "")), "elements are of no TYPE"),
    "short element": (_text(SQUARE.replace("1, 1, 2, 3", "1, 1, 2")), "element 1 has 2 nodes: expected 3"),
    "words": (_text(SQUARE.replace("3, 1, 1", "3, one, 1")), 'line 1, *NODE: "one": expected a number'),
    "a long word": (_text(SQUARE.replace("3, 1, 1", f"3, {'1' * 1000}x, 1")), "1111...: expected a number"),
    "number of a node": (_text(SQUARE.replace("3, 1, 1", "3.5, 1, 1")), '"3.5": expected a whole number'),
    "no numbers": (_text(SQUARE.replace("3, 1, 1", ", ,")), 'line 1, *NODE: "": expected a whole number'),
    **{
        f"{keyword}": (
            _text(SQUARE + f"*{keyword}\n1, 0, 0\n"),
            f"line 9, *{keyword}: it makes or moves nodes",
        )
        for keyword in ("SYSTEM", "NGEN", "NFILL", "NCOPY", "ELGEN", "ELCOPY", "IMPERFECTION")
    },
    "polar nodes": (
        _text(SQUARE.replace("*NODE", "*NODE, SYSTEM=C")),
        "line 1, *NODE: its parameter SYSTEM is not read: expected Cartesian coordinates",
    ),
    **{
        f"{keyword} elsewhere": (
            _text(SQUARE + f"*{keyword}, INPUT=b.inp\n"),
            f'line 9, *{keyword.split(",")[0]}: its parameter "INPUT" is not read',
        )
        for keyword in ("NODE", "ELEMENT, TYPE=CPS3", "ELSET, ELSET=fibre")
    },
    "an abbreviation of several": (
        _text(SQUARE + "*EL, TYPE=CPS3\n"),
        "line 9, *EL: may be several keywords: write it out, or delete it if it makes no nodes or elements",
    ),
    "an unknown keyword": (
        _text(SQUARE + "*ELEMENTS, TYPE=CPS3, ELSET=fibre\n3, 1, 2, 3\n"),
        "line 9, *ELEMENTS: unknown keyword: write it out, or delete it if it makes no nodes or elements",
    ),
    "nothing": (_text(SQUARE + "*\n3, 1, 2, 3\n"), "line 9, *: unknown keyword"),
    "an abbreviation of a parameter of several": (
        _text(SQUARE + "*ELSET, ELSET=fibre, IN\n1, 2\n"),
        'line 9, *ELSET: its parameter "IN" is not read',
    ),
    "data before a keyword": (_text("1, 0, 0\n" + SQUARE), "line 1: data without a keyword: expected *NODE, *ELEMENT"),
    **{
        f"elements of type {kind}": (
            _text(SQUARE + f"*ELEMENT, TYPE={kind}, ELSET=fibre\n3, 1, 2, 3, 4\n"),
            f"line 9, *ELEMENT: elements are {kind}: only triangles of three or six nodes and quadrilaterals of four",
        )
        for kind in ("C3D4", "C3D8", "CAX8", "CAX3", "SC6R", "COH2D4", "MASS", "AC2D3", "U1")
    },
    "underscore": (_text(SQUARE.replace("3, 1, 1", "3, 0.2_5, 1")), '*NODE: "0.2_5": expected a number'),
    "digits of another script": (
        _text(SQUARE.replace("2, 1, 3, 4", "2, 1, ٣, 4")),
        '*ELEMENT: "٣": expected a whole number',
    ),
    "twenty digits": (
        _text(SQUARE.replace("2, 1, 3, 4", f"{'9' * 20}, 1, 3, 4")),
        '"99999999999999999999": expected a whole number of at most 15 digits',
    ),
    "no coordinates": (_text(SQUARE.replace("3, 1, 1", "3,")), "line 1, *NODE: node 3 has no coordinates"),
    "empty coordinate": (_text(SQUARE.replace("3, 1, 1", "3, , 1")), 'line 1, *NODE: "": expected a number'),
    "node twice": (_text(SQUARE + "*NODE\n3, 0, 0\n"), "line 9, *NODE: node 3 is there twice"),
    "twice in a block": (_text(SQUARE.replace("2, 1, 3, 4", "1, 1, 3, 4")), "element 1 is there twice"),
    "two instances": (
        _text(SQUARE + "*INSTANCE\n*INSTANCE\n"),
        "line 10, *INSTANCE: a second instance: expected one, in",
    ),
    "elements of the assembly": (
        _text(SQUARE + "*ASSEMBLY, NAME=a\n*ELEMENT, TYPE=T2D2, ELSET=debonded\n7, 1, 2\n*END ASSEMBLY\n"),
        "line 10, *ELEMENT: elements of the assembly are not read: expected all in the part",
    ),
    "rotated": (
        _text(SQUARE + "*INSTANCE, NAME=b\n0, 0, 0\n0, 0, 0, 0, 0, 1, 90\n"),
        "line 9, *INSTANCE: its rotation is not read: rotate the part",
    ),
    **{
        f"range {row}": (
            _text(f"{SQUARE}*ELSET, ELSET=fibre, GENERATE\n{row}\n"),
            f"line 9, *ELSET: {row}: expected the first element, the last and a step of at least 1",
        )
        for row in ("30, 1, 1", "1, 2, 0", "1, 2, -1", "1", "1, 2, 1, 1")
    },
    "huge range": (
        _text(SQUARE + "*ELSET, ELSET=fibre, GENERATE\n1, 1000000000000, 1\n"),
        "line 9, *ELSET: its sets have more members than a file of this length can have elements",
    ),
    "many ranges": (
        _text(SQUARE + "*ELSET, ELSET=fibre, GENERATE\n" + "1, 10000\n" * 101),
        "line 9, *ELSET: its sets have more members",
    ),
    "many names": (
        _text(SQUARE + "*ELSET, ELSET=b, GENERATE\n1, 10000\n*ELSET, ELSET=fibre\n" + "b\n" * 101),
        "line 11, *ELSET: its sets have more members",
    ),
    "short line": (
        _text(SQUARE + "*ELEMENT, TYPE=T3D2, ELSET=debonded\n7, 1\n"),
        "line 9, *ELEMENT: element 7 has 1 nodes: expected 2 or 3",
    ),
    "stray line": (
        _text(SQUARE.replace("4, 0, 1\n", "4, 0, 1\n5, 2, 2\n") + "*ELEMENT, TYPE=B21, ELSET=debonded\n7, 1, 5\n"),
        'lines in the element set "debonded" that are no edges of triangles: that between nodes 1 and 5',
    ),
    "twice": (_text(SQUARE + "*ELEMENT, TYPE=CPS3\n2, 1, 3, 4\n"), "element 2 is there twice"),
    "unknown node": (_text(SQUARE.replace("2, 1, 3, 4", "2, 1, 3, 9")), "element 2: there is no node 9"),
    "unknown set": (_text(SQUARE + "*ELSET, ELSET=fibre\nother\n"), 'there is no element set "other"'),
    "unknown section": (_text(SQUARE + "*SOLID SECTION, ELSET=steel\n"), 'element set "steel": there is none'),
    "nameless set": (_text(SQUARE + "*ELSET\n1\n"), "line 9, *ELSET: no ELSET"),
    "two parts": (
        _text("*PART, NAME=a\n*PART, NAME=b\n" + SQUARE),
        "line 2, *PART: a second part: expected one",
    ),
    "other files": (_text("*INCLUDE, INPUT=b.inp\n" + SQUARE), "other files are not read"),
    "no set": (
        _text(SQUARE.replace(", ELSET=matrix", "")),
        "element 1 at (0.666666667, 0.333333333), element 2 at (0.333333333, 0.666666667): not in any element set",
    ),
    "two sets": (
        _text(SQUARE + "*ELSET, ELSET=fibre\n1, 2\n*ELSET, ELSET=matrix\n2,\n"),
        "element 2 at (0.333333333, 0.666666667) is in 2 element sets: fibre, matrix",
    ),
    "other name": (_text(SQUARE.replace("matrix", "m:")), 'element set is named "matrix"'),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faulty_mesh_is_refused(name, tmp_path):
    write, message = FAULTS[name]
    with pytest.raises(MeshError) as caught:
        read(write(tmp_path / "a.inp"))
    assert any(message in fault for fault in caught.value.faults), caught.value
    assert all("a.inp" in fault and "\n" not in fault for fault in caught.value.faults)
