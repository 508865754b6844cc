"""Read the triangles and the lines of a mesh file of Medit (.mesh), as FreeFEM, Netgen, Gmsh and MMG write it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from feti_homog.mesh.readers.raw_mesh import RawMesh
from feti_homog.mesh.readers.scanner import Numbers, Scanner
from feti_homog.mesh.readers.unstructured_grid import Grid, mesh_of
from feti_homog.schema.wording import toml_value
from feti_homog.system.runtime import input_files

# Sections of cells: VTK's type, number of nodes.
CELLS = {"EDGES": (3, 2), "TRIANGLES": (5, 3), "QUADRILATERALS": (9, 4)}
# Numbers per entry of sections without cells; vectors have as many as coordinates.
OTHERS = {
    **dict.fromkeys(("CORNERS", "RIDGES", "REQUIREDVERTICES", "REQUIREDEDGES", "REQUIREDTRIANGLES"), 1),
    **dict.fromkeys(("NORMALATVERTICES", "TANGENTATVERTICES", "VERTEXONGEOMETRICVERTEX", "EDGEONGEOMETRICEDGE"), 2),
    **{"NORMALATTRIANGLEVERTICES": 3, "VERTEXONGEOMETRICEDGE": 3, "SUBDOMAINFROMMESH": 4, "SUBDOMAIN": 4},
}
VECTORS, VERTICES = ("NORMALS", "TANGENTS"), "VERTICES"
COMMENT = re.compile(rb"#[^\n]*")


def load(path: Path) -> RawMesh:
    """Read the triangles and the lines; nodes and cells have numbers from 1, cells one section after the other.

    Raises:
        OSError: the file cannot be read.
        MeshError: it is damaged, or has other cells.
    """
    file = Scanner(COMMENT.sub(b"", input_files.read(path)))
    dimension = _dimension(file)
    points, cells = np.zeros((0, 3)), list[tuple[int, Numbers]]()
    while (word := file.word()) and word.upper() != "END":
        section, rows = word.upper(), _rows(file, word, dimension)
        if section in CELLS:
            cells.append((CELLS[section][0], rows))
        elif section == VERTICES:
            if len(points):
                file.refuse(f"{word}: they are there twice")
            points = np.pad(rows[:, :-1], ((0, 0), (0, 3 - dimension)))
    none, sizes = np.zeros(0, np.int64), [len(rows) for _, rows in cells]
    types = np.repeat([kind for kind, _ in cells], sizes).astype(np.int64)
    counts = np.repeat([rows.shape[1] - 1 for _, rows in cells], sizes).astype(np.int64)
    nodes = np.concatenate([none, *(rows[:, :-1].ravel() - 1 for _, rows in cells)])
    references = np.concatenate([none, *(rows[:, -1] for _, rows in cells)])
    return mesh_of(Grid(points, types, nodes, counts, {"medit:ref": references}, first=1))


def _dimension(file: Scanner) -> int:
    """Take the head of the file and return the number of coordinates."""
    if file.word() != "MeshVersionFormatted":
        file.refuse("expected MeshVersionFormatted, with which a mesh file of Medit begins")
    file.word()
    if file.word().upper() != "DIMENSION" or (dimension := file.count(file.word())) not in (2, 3):
        file.refuse("expected Dimension 2 or 3")
    return dimension


def _rows(file: Scanner, word: str, dimension: int) -> Numbers:
    """Return the entries of a section, (k, width) numbers; MeshError if they may be cells of other types."""
    section = word.upper()
    if not section.isalnum() or section[0].isdigit():
        file.refuse(f"{toml_value(word)}: expected the name of a section")
    count = file.count(file.word())
    widths = OTHERS | {VERTICES: dimension + 1} | dict.fromkeys(VECTORS, dimension)
    widths |= {name: nodes + 1 for name, (_, nodes) in CELLS.items()}
    if section not in widths and count:
        expected = "only triangles of three nodes, quadrilaterals of four and edges of two can be used"
        file.refuse(f"{count} {word}: {expected}")
    width = widths.get(section, 1)
    return file.take(count * width, "i8" if section in CELLS else "f8").reshape(-1, width)
