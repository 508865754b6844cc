"""Meshes of other programs."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

from support.abaqus import write_inp
from support.base_case import MESH_CELL, changed
from support.other_formats import written
from support.vtk_files import write_vtu
from unit.mesh.faulty_meshes import grid
from unit.mesh.readers.test_damaged_files import HEADER, SCRIPT, SCRIPTS
from unit.mesh.readers.test_strangers_meshes import by_gmsh

from hostile.attempts import Attempt, Content


def edited(write: Callable[[Path], object], *edits: tuple[bytes, bytes]) -> Callable[[Path], None]:
    """Write a mesh with some of its bytes exchanged, the first time that they occur."""

    def make(path: Path) -> None:
        write(path)
        content = path.read_bytes()
        for old, new in edits:
            assert old in content, (path.name, old)
            content = content.replace(old, new, 1)
        path.write_bytes(content)

    return make


def inp(*edits: tuple[str, str]) -> Callable[[Path], None]:
    return edited(lambda path: write_inp(path, grid()), *((old.encode(), new.encode()) for old, new in edits))


def msh(*edits: tuple[str, str]) -> Callable[[Path], None]:
    return edited(grid().write, *((old.encode(), new.encode()) for old, new in edits))


def vtu(*edits: tuple[str, str]) -> Callable[[Path], None]:
    text = ((old.encode(), new.encode()) for old, new in edits)
    return edited(lambda path: written(grid(), path, binary=False), *text)


def vtk(*edits: tuple[str, str]) -> Callable[[Path], None]:
    text = ((old.encode(), new.encode()) for old, new in edits)
    return edited(lambda path: written(grid(), path, binary=False), *text)


def medit(*edits: tuple[str, str]) -> Callable[[Path], None]:
    return edited(lambda path: by_gmsh(path, grid()), *((old.encode(), new.encode()) for old, new in edits))


def chained_sets(path: Path) -> None:
    """Write 30 000 sets, each of the one before."""
    write_inp(path, grid())
    sets = "".join(f"*ELSET, ELSET=s{k}\n{f's{k - 1}' if k else 'matrix'}\n" for k in range(30_000))
    path.write_text(path.read_text().replace("*END PART\n", f"{sets}*END PART\n"))


NODE = ("*NODE, NSET=all", "*NODE, NSET=all, {}")
MESHES: dict[str, tuple[Content, str]] = {
    "a pipe.msh": (os.mkfifo, "a pipe or device"),
    "endless.msh": (lambda path: path.symlink_to("/dev/zero"), "a pipe or device"),
    "endless.vtu": (lambda path: path.symlink_to("/dev/zero"), "a pipe or device"),
    "endless.inp": (lambda path: path.symlink_to("/dev/zero"), "a pipe or device"),
    "sparse.msh": (lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_RDWR), 20 << 30), "more than 1024 MiB"),
    "empty.msh": ("", ""),
    "empty.inp": ("", ""),
    "empty.vtu": ("", ""),
    "empty.vtk": ("", ""),
    "another.step": ("", ""),
    "many nodes.msh": (HEADER + "$Nodes\n1000000000000\n$EndNodes\n", ""),
    "many elements.msh": (msh(("$Elements\n32", "$Elements\n99999999999999999999")), ""),
    "lost elements.msh": (msh(("$Elements", "$elements"), ("$EndElements", "$Endelements")), '"$elements"'),
    "elements behind the end.msh": (msh(("$EndElements\n", "$EndElements\n33 2 2 1 1 1 2 7\n")), "33 2 2 1 1 1 2 7"),
    "many sections.msh": (HEADER + "$Comments\n$EndComments\n" * 200_000 + "$Node\n$EndNode\n", "line 400004"),
    "a hole.msh": (lambda path: grid().without(11).write(path), "voids = true"),
    "a long word.msh": (msh(("2 0.25 0.0 0.0", f"2 {'1' * 200_000}x 0 0")), "gmsh cannot read it"),
    "unknown node.msh": (msh(("1 2 2 1 1 1 2 7", "1 2 2 1 1 1 2 777")), "777"),
    "not a number.msh": (msh(("2 0.25 0.0 0.0", "2 nan 0.0 0.0")), ""),
    "colours.msh": (msh(('"fibre"', '"\x1b[31m"')), r"\x1b[31m"),
    "phase without a number.msh": (msh(('"fibre"', '"fibre:"')), "fibre:"),
    "phase 0.msh": (msh(('"fibre"', '"fibre:0"')), "fibre:0"),
    "phase of many digits.msh": (msh(('"fibre"', '"fibre:99999999999999999999"')), "fibre:9999"),
    "misspelt elements.inp": (inp(("*Element, type=CPE3, elset=surface2", "*Elements, type=CPE3")), "*Elements"),
    "letters of elements.inp": (inp(("*Element, type=CPE3, elset=surface2", "*El, type=CPE3")), "several keywords"),
    "two parts.inp": (inp(("*END PART", "*END PART\n*PART, NAME=fibre\n*END PART")), "a second part"),
    "data first.inp": (inp(("*HEADING", "1, 0, 0\n*HEADING")), "line 1"),
    "solids.inp": (inp(("type=CPE3", "type=C3D4")), "C3D4"),
    "chained sets.inp": (chained_sets, "element sets"),
    "system.inp": (inp(("*NODE, NSET=all", "*SYSTEM\n0,0,0,1,0,0\n*NODE, NSET=all")), "*SYSTEM"),
    "cylindrical.inp": (inp((NODE[0], NODE[1].format("SYSTEM=C"))), "SYSTEM"),
    "input of nodes.inp": (inp((NODE[0], NODE[1].format("INPUT=/etc/passwd"))), "INPUT"),
    "input of elements.inp": (inp(("type=CPE3", "type=CPE3, INPUT=/etc/passwd")), "INPUT"),
    "input of sets.inp": (inp(("*ELSET, ELSET=MATRIX", "*ELSET, ELSET=MATRIX, INPUT=/etc/passwd")), "INPUT"),
    "include.inp": (inp(("*PART", "*INCLUDE, INPUT=/etc/passwd\n*PART")), "*INCLUDE"),
    "long set.inp": (inp(("*END PART", "*ELSET, ELSET=a, GENERATE\n1, 1000000000000, 1\n*END PART")), "sets"),
    "set that runs back.inp": (inp(("*END PART", "*ELSET, ELSET=a, GENERATE\n30, 1, 1\n*END PART")), ""),
    "underscores.inp": (inp(("2, 0.25, 0.0", "2, 0.2_5, 0.0")), "0.2_5"),
    "twenty digits.inp": (inp(("2, 0.25, 0.0", "99999999999999999999, 0.25, 0.0")), "9999"),
    "node without coordinates.inp": (inp(("2, 0.25, 0.0", "2")), ""),
    "colours.inp": (inp(("ELSET=FIBRE", 'ELSET="\x1b[31m"')), ""),
    "node beyond the last.vtu": (vtu(("\n0\n1\n6\n0\n6\n5\n", "\n0\n1\n666666\n0\n6\n5\n")), ""),
    "lost part.vtu": (vtu(("<CellData>", "<Polys></Polys><CellData>")), "<Polys>"),
    "appended tags.vtu": ("<VTKFile>" + "<AppendedData" * 100_000, "not XML"),
    "offset of appended data.vtu": (
        edited(lambda path: write_vtu(path, "Appended raw"), (b'offset="0"', b'offset="999999999999"')),
        "offset",
    ),
    "length of raw data.vtu": (
        edited(lambda path: write_vtu(path, "Appended raw", "None"), (b"_\x00\x01\x00\x00", b"_\xff\xff\xff\xff")),
        "broken",
    ),
    "blocks of raw data.vtu": (
        edited(lambda path: write_vtu(path, "Appended raw"), (b"_\x01\x00\x00\x00", b"_\xff\xff\xff\xff")),
        "broken off",
    ),
    "a polygon of many nodes.vtu": (vtu(("\n96\n", "\n1000000000\n")), "damaged"),
    "triangle strips.vtu": (vtu(("\n5\n5\n", "\n6\n5\n")), "triangle strips"),
    "lost cells.vtk": (vtk(("CELL_DATA", "POLYGONS 1 4\n3 0 1 2\nCELL_DATA")), "POLYGONS"),
    "capitals.mesh": ("A" * 1_000_000, "MeshVersionFormatted"),
    "declared vertices.mesh": (medit(("Vertices\n 25", "Vertices\n 100000000000000")), "should follow"),
    "solids.mesh": (medit(("End", "Tetrahedra\n1\n1 2 3 4 1\nEnd")), "Tetrahedra"),
    "second order.mesh": (medit(("Triangles", "TrianglesP2")), "TrianglesP2"),
    "bomb.vtu": (
        '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "'
        + "b" * 999
        + '"><!ENTITY c "'
        + "&b;" * 999
        + '">]><VTKFile>&c;</VTKFile>',
        "",
    ),
    "entity.vtu": ('<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><VTKFile>&b;</VTKFile>', ""),
    "open tags.vtu": ("<VTKFile>" * 100_000, ""),
    "damaged.vtu": ("<VTKFile><a></b></VTKFile>", "line 1"),
    "declared points.vtu": (vtu(('NumberOfPoints="25"', 'NumberOfPoints="1000000000000"')), ""),
    "declared points.vtk": (vtk(("POINTS 25", "POINTS 1000000000000")), ""),
    "declared cells.vtk": (vtk(("CELLS 33", "CELLS 1000000000000")), ""),
}


def attempts() -> Iterator[Attempt]:
    for name, (content, expected) in MESHES.items():
        case = changed((MESH_CELL[0], f'geometry = "mesh"\nfile = "{name}"'))
        yield Attempt("meshes", name, ("check", "@/c.toml"), expected, {"c.toml": case, name: content})
    for name, content in SCRIPTS.items():
        case = changed((MESH_CELL[0], 'geometry = "mesh"\nfile = "a.msh"'))
        files = {"c.toml": case, "a.msh": content, "other.msh": SCRIPT}
        yield Attempt("scripts", name, ("check", "@/c.toml"), "a.msh: ", files)
    beside = {f"a.{end}": SCRIPT for end in ("msh.opt", "opt", "geo", "msh.pos", "pos", "geo.opt", "msh.geo")}
    files = {"c.toml": case, "a.msh": grid().write, **beside}
    yield Attempt("scripts", "files beside a mesh", ("check", "@/c.toml"), "the case is valid", files, codes=(0,))
