"""Read legacy VTK files (.vtk), text or binary, up to version 5.1, and Medit mesh files (.mesh).

FreeFEM, Netgen, Gmsh and MMG write Medit files.
"""

from __future__ import annotations

import codecs
import re
from collections import deque
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import NoReturn
from urllib.parse import unquote

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from feti_homog.errors import MeshError
from feti_homog.mesh.readers.raw_mesh import RawMesh
from feti_homog.mesh.readers.unstructured_grid import Grid, NotANumber, Numbers, mesh_of, numbers
from feti_homog.mesh.readers.vtu_file import TYPES as XML_TYPES
from feti_homog.schema import wording
from feti_homog.system.runtime import input_files
from feti_homog.typing import Int

TYPES = {"char": "i1", "short": "i2", "int": "i4", "long": "i8"}
TYPES |= {f"unsigned_{name}": f"u{kind[1]}" for name, kind in TYPES.items()}
TYPES |= {f"vtktype{name.lower()}": kind for name, kind in XML_TYPES.items() if "Int" in name}
TYPES |= {"signed_char": "i1", "vtkidtype": "i4", "float": "f4", "double": "f8"}
# Number of values per cell or point, by section; the header of SCALARS may give another number.
WIDTHS = {"SCALARS": 1, "VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6, "GLOBAL_IDS": 1, "PEDIGREE_IDS": 1}
# Cell sections of Medit: VTK cell type, number of nodes.
CELLS = {"EDGES": (3, 2), "TRIANGLES": (5, 3), "QUADRILATERALS": (9, 4)}
# Number of values per entry of a section: for cells, the nodes and a reference; for vectors, the dimension.
ENTRIES = {
    **dict.fromkeys(("CORNERS", "RIDGES", "REQUIREDVERTICES", "REQUIREDEDGES", "REQUIREDTRIANGLES"), 1),
    **dict.fromkeys(("NORMALATVERTICES", "TANGENTATVERTICES", "VERTEXONGEOMETRICVERTEX", "EDGEONGEOMETRICEDGE"), 2),
    **{"NORMALATTRIANGLEVERTICES": 3, "VERTEXONGEOMETRICEDGE": 3, "SUBDOMAINFROMMESH": 4, "SUBDOMAIN": 4},
    **{name: nodes + 1 for name, (_, nodes) in CELLS.items()},
}
WORD = re.compile(rb"\S+")
VECTORS, VERTICES = ("NORMALS", "TANGENTS"), "VERTICES"


def load(path: Path) -> RawMesh:
    """Read triangles and lines from a VTK file, which numbers nodes and cells from 0.

    Raises:
        OSError: the file cannot be read.
        MeshError: the file is damaged, or has unusable cells or no phases.
    """
    file = Scanner(input_files.read(path))
    if file.line()[:4] != ["#", "vtk", "DataFile", "Version"]:
        file.refuse("expected # vtk DataFile Version, with which a file of VTK begins")
    file.place = file.content.find(b"\n", file.place) + 1 or len(file.content)  # the title, which may be empty
    form = " ".join(file.line()).upper()
    if form not in ("ASCII", "BINARY"):
        file.refuse(f"{wording.toml_value(form)}: expected ASCII or BINARY")
    file.is_binary = form == "BINARY"
    points, none, sections = np.zeros((0, 3)), np.zeros(0, np.int64), set[str]()
    types, nodes, counts, cell_data, arrays, length = none, none, none, dict[str, Numbers](), dict[str, Numbers](), 0
    while words := file.line():
        section, words = words[0].upper(), [*words[1:], "", "", "", ""]
        if section in sections & {"DATASET", "POINTS", "CELLS", "CELL_TYPES"}:
            file.refuse(f"{section}: it is there twice")
        sections.add(section)
        match section:
            case "DATASET":
                if words[0].upper() != "UNSTRUCTURED_GRID":
                    file.refuse(f"DATASET {words[0]}: expected UNSTRUCTURED_GRID")
            case "POINTS":
                points = file.take(3 * file.count(words[0]), words[1]).reshape(-1, 3).astype(float)
            case "CELLS":
                nodes, counts = _cells(file, *map(file.count, words[:2]))
            case "CELL_TYPES":
                types = file.take(file.count(words[0]), "int").astype(np.int64)
            case "CELL_DATA" | "POINT_DATA":
                arrays, length = cell_data if section == "CELL_DATA" else {}, file.count(words[0])
            case _:
                for name, values, width in _arrays(file, section, words, length):
                    arrays[unquote(name)] = values if width == 1 else values.reshape(-1, max(width, 1))
    return mesh_of(Grid(points, types, nodes, counts, cell_data))


def _cells(file: Scanner, count: int, size: int) -> tuple[Int, Int]:
    """Read nodes and node counts of all cells; `count` and `size` are the numbers behind CELLS.  Raises MeshError."""
    if file.follows("OFFSETS"):
        offsets = file.take(count, "".join(file.line()[1:2])).astype(np.int64)
        if not file.follows("CONNECTIVITY"):
            file.refuse("CELLS: expected CONNECTIVITY behind OFFSETS")
        return file.take(size, "".join(file.line()[1:2])).astype(np.int64), np.diff(offsets)
    rows = file.take(size, "int").astype(np.int64)
    # Before version 5, a row has a node count and nodes: follow the links from row to row, from entry 0.
    onward = np.clip(np.arange(size) + 1 + rows, 0, size)
    graph = csr_array((np.ones(size), onward, np.append(np.arange(size + 1), size)), shape=(size + 1, size + 1))
    starts = breadth_first_order(graph, 0, return_predecessors=False)
    starts = starts[starts < size]
    return np.delete(rows, starts), rows[starts]


def _arrays(file: Scanner, section: str, words: list[str], length: int) -> Iterator[tuple[str, Numbers, int]]:
    """Yield name, values and width of the arrays in a section for `length` points or cells.  Raises MeshError."""
    byte = "unsigned_char" if file.is_binary else "float"
    if section == "FIELD":
        for _ in range(min(file.count(words[1]), len(file.content))):
            name, width, tuples, kind = (*file.line(), "", "", "", "")[:4]
            yield name, file.take(file.count(width) * file.count(tuples), kind), int(width)
    elif section == "LOOKUP_TABLE":
        file.take(4 * file.count(words[1]), byte)
    elif section == "COLOR_SCALARS":
        colours = file.take(length * file.count(words[1]), byte)  # as text from 0 to 1
        yield words[0], colours if file.is_binary else np.rint(255 * colours).astype(np.int64), int(words[1])
    elif section == "TEXTURE_COORDINATES":
        file.take(length * file.count(words[1]), words[2])
    elif section in WIDTHS:
        number = file.count(words[2]) if section == "SCALARS" and words[2] else WIDTHS[section]
        if section == "SCALARS" and file.follows("LOOKUP_TABLE"):
            file.line()
        yield words[0], file.take(length * number, words[1]), number
    else:
        expected = "expected DATASET, POINTS, CELLS, CELL_TYPES, CELL_DATA, POINT_DATA or numbers of these"
        file.refuse(f"{wording.toml_value(section)}: {expected}")


def load_medit(path: Path) -> RawMesh:
    """Read triangles and lines, numbered from 1, from a Medit file; skip other known sections.

    Raises:
        OSError: the file cannot be read.
        MeshError: the file is damaged, or has unusable cells.
    """
    file = Scanner(re.sub(rb"#[^\n]*", b"", input_files.read(path)))
    if file.word() != "MeshVersionFormatted":
        file.refuse("expected MeshVersionFormatted, with which a mesh file of Medit begins")
    file.word()
    if file.word().upper() != "DIMENSION" or (dimension := file.count(file.word())) not in (2, 3):
        file.refuse("expected Dimension 2 or 3")
    widths = ENTRIES | {VERTICES: dimension + 1} | dict.fromkeys(VECTORS, dimension)
    none = np.zeros(0, np.int64)
    points, cells = np.zeros((0, 3)), [(none, none, none, none)]
    while (word := file.word()) and word.upper() != "END":
        section = word.upper()
        if not section.isalnum() or section[0].isdigit():
            file.refuse(f"{wording.toml_value(word)}: expected the name of a section")
        count, width = file.count(file.word()), widths.get(section, 1)
        if section not in widths and count:
            expected = "only triangles of three nodes, quadrilaterals of four and edges of two can be used"
            file.refuse(f"{count} {word}: {expected}")
        rows = file.take(count * width, "long" if section in CELLS else "double").reshape(-1, width)
        if section in CELLS:
            types, counts = np.full(count, CELLS[section][0]), np.full(count, width - 1)
            cells.append((types, rows[:, :-1].ravel() - 1, counts, rows[:, -1]))
        elif section == VERTICES:
            if len(points):
                file.refuse(f"{word}: they are there twice")
            points = np.pad(rows[:, :-1], ((0, 0), (0, 3 - dimension)))
    types, nodes, counts, references = (np.concatenate(parts) for parts in zip(*cells, strict=True))
    return mesh_of(Grid(points, types, nodes, counts, {"medit:ref": references}, first=1))


class Scanner:
    """A reader of the lines, words and arrays in a VTK or Medit file; binary arrays are big-endian."""

    def __init__(self, content: bytes) -> None:
        self.content, self.place, self.is_binary = content.removeprefix(codecs.BOM_UTF8), 0, False

    def line(self) -> list[str]:
        """Read the words of the next line, past blank lines and METADATA blocks; [] at the file end."""
        words = list[str]()
        while not words and self.place < len(self.content):
            start, self.place = self.place, self.content.find(b"\n", self.place) + 1 or len(self.content)
            words = self.content[start : self.place].decode(errors="replace").split()
            if words and words[0].upper() == "METADATA":
                words, stop = [], self.content.find(b"\n\n", self.place - 1)
                self.place = len(self.content) if stop < 0 else stop + 2
        return words

    def word(self) -> str:
        """Read the next word; "" at the file end."""
        match = WORD.search(self.content, self.place)
        self.place = len(self.content) if match is None else match.end()
        return "" if match is None else match[0].decode(errors="replace")

    def follows(self, word: str) -> bool:
        """Return whether the next word is `word`, regardless of case; the word stays unread."""
        match = WORD.search(self.content, self.place)
        return match is not None and match[0].upper() == word.encode()

    def count(self, word: str) -> int:
        """Convert a word into a count; MeshError unless it is a whole number of at most 15 digits."""
        if not re.fullmatch("[0-9]{1,15}", word):
            self.refuse(f"{wording.toml_value(word)}: expected a number of values")
        return int(word)

    def take(self, count: int, name: str) -> Numbers:
        """Read the next `count` values of the VTK type `name`; MeshError for missing or wrong values."""
        if name.lower() not in TYPES:
            self.refuse(f"{wording.toml_value(name)}: expected a type of numbers, such as int or double")
        kind = TYPES[name.lower()]
        kind_of_text = "f8" if kind[0] == "f" else "i8"
        size = int(kind[1]) if self.is_binary else 1
        if count * size > len(self.content) - self.place:
            self.refuse(f"{count} values should follow, and {len(self.content) - self.place} bytes do")
        start = self.place
        if self.is_binary:
            self.place += count * size
            return np.frombuffer(self.content, f">{kind}", count, start).astype(kind)
        last = deque(islice(WORD.finditer(self.content, start), count), maxlen=1)
        self.place = last[0].end() if last else start
        try:
            values = numbers(self.content[start : self.place], kind_of_text)
        except NotANumber as error:
            self.place = start + error.place
            self.refuse(str(error))
        if len(values) < count:
            self.refuse(f"{count} values should follow, and {len(values)} do")
        return values

    def refuse(self, fault: str) -> NoReturn:
        """Raise MeshError; in text files, the message begins with the number of the current line."""
        line = self.content[: self.place].rstrip().count(b"\n") + 1
        raise MeshError(fault if self.is_binary else f"line {line}: {fault}")
