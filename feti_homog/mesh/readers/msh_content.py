"""Nodes, elements and physical groups of a .msh file of gmsh, versions 2 to 2.2, 4.0 and 4.1."""

from __future__ import annotations

import codecs
import re
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.mesh.readers.scanner import INT, SIZE, Section, chain, end_of
from feti_homog.schema.wording import toml_value
from feti_homog.typing import Float, Int

# gmsh's types of elements that its manual has: name, dimension, order and number of nodes.
KINDS = {
    1: ("Line 2", 1, 1, 2), 2: ("Triangle 3", 2, 1, 3), 3: ("Quadrilateral 4", 2, 1, 4),
    4: ("Tetrahedron 4", 3, 1, 4), 5: ("Hexahedron 8", 3, 1, 8), 6: ("Prism 6", 3, 1, 6),
    7: ("Pyramid 5", 3, 1, 5), 8: ("Line 3", 1, 2, 3), 9: ("Triangle 6", 2, 2, 6),
    10: ("Quadrilateral 9", 2, 2, 9), 11: ("Tetrahedron 10", 3, 2, 10), 12: ("Hexahedron 27", 3, 2, 27),
    13: ("Prism 18", 3, 2, 18), 14: ("Pyramid 14", 3, 2, 14), 15: ("Point", 0, 0, 1),
    16: ("Quadrilateral 8", 2, 2, 8), 17: ("Hexahedron 20", 3, 2, 20), 18: ("Prism 15", 3, 2, 15),
    19: ("Pyramid 13", 3, 2, 13), 20: ("Triangle 9", 2, 3, 9), 21: ("Triangle 10", 2, 3, 10),
    22: ("Triangle 12", 2, 4, 12), 23: ("Triangle 15", 2, 4, 15), 24: ("Triangle 15I", 2, 5, 15),
    25: ("Triangle 21", 2, 5, 21), 26: ("Line 4", 1, 3, 4), 27: ("Line 5", 1, 4, 5),
    28: ("Line 6", 1, 5, 6), 29: ("Tetrahedron 20", 3, 3, 20), 30: ("Tetrahedron 35", 3, 4, 35),
    31: ("Tetrahedron 56", 3, 5, 56), 92: ("Hexahedron 64", 3, 3, 64), 93: ("Hexahedron 125", 3, 4, 125),
}  # fmt: skip
# Numbers of nodes by type, 0 where the type is unknown, and of the parameters of a node by the dimension of its entity.
NODES = np.array([KINDS[kind][3] if kind in KINDS else 0 for kind in range(max(KINDS) + 2)])
PARAMETERS = np.array([0, 1, 2, 0])

HEADER = re.compile(rb"\$(\w+)[ \t\r]*$", re.MULTILINE)
# Blanks, and the end of a section, before the next one.
BETWEEN = re.compile(rb"(\s*\$End\w+)?+\s*+(?=\S)")
NAME = re.compile(rb'^[ \t]*(\d{1,15})[ \t]+(-?\d{1,15})[ \t]+"([^"\n]*)"', re.MULTILINE)
VERSIONS = {2.0: "2", 2.1: "2", 2.2: "2", 4.0: "4.0", 4.1: "4.1"}
# Sections without nodes or elements.
OTHERS = {
    *("Comments", "Periodic", "GhostElements", "Parametrizations", "NodeData", "ElementData", "ElementNodeData"),
    *("InterpolationScheme", "PhysicalNames", "MeshFormat"),
}


@dataclass
class MshContent:
    """Content of a file.

    Attributes:
        nodes: numbers (n,) and positions (n, 3), section by section.
        elements: for each type their numbers (m,), nodes (m, k) and entities (m,), block by block.
        groups: the physical groups of each entity (dimension, number).
        names: the name of each physical group (dimension, number).
    """

    nodes: list[tuple[Int, Float]] = field(default_factory=list)
    elements: dict[int, list[tuple[Int, Int, Int]]] = field(default_factory=lambda: defaultdict(list))
    groups: dict[tuple[int, int], tuple[int, ...]] = field(default_factory=dict)
    names: dict[tuple[int, int], str] = field(default_factory=dict)

    def name(self, dimension: int, group: int) -> str:
        """Return the name of a physical group, or its number."""
        return self.names.get((dimension, group)) or f"number {group}"


def read(content: bytes) -> MshContent:
    """Read the sections that make the mesh; OTHERS are passed over.

    Raises:
        MeshError: the file is damaged, or has other sections or text outside them.
    """
    content = content.removeprefix(codecs.BOM_UTF8)
    start = content[:4096].lstrip()
    if start.startswith(b"$NOD"):
        raise MeshError("format 1 of gmsh: save it in format 2.2 or 4.1")
    if not start.startswith((b"$MeshFormat", b"$Comments", b"$PhysicalNames")):
        raise MeshError("not a gmsh mesh file: it does not begin with $MeshFormat")
    result, seen, place = MshContent(), set[str](), 0
    version, order = "", ""
    while between := BETWEEN.match(content, place):
        name, place = _section(content, between.end())
        if name in READERS:
            if not version or name in seen:
                fault = "it is there twice" if version else "there is no $MeshFormat before"
                raise MeshError(f"${name}: {fault}")
            section = Section(name, content, place, order, "i8" if name == "Elements" else "f8")
            READERS[name](section, version, result)
            place = section.end()
            seen.add(name)
            continue
        if name == "MeshFormat":
            version, order = _format(content, place)
        elif name == "PhysicalNames":
            result.names |= _names(content, place)
        place = end_of(name, content, place)
    return result


def _section(content: bytes, place: int) -> tuple[str, int]:
    """Return the name of the section that begins at a place, and where its first line begins."""
    header = HEADER.match(content, place)
    name = "" if header is None else header[1].decode(errors="replace")
    if header is None or (name not in READERS and name not in OTHERS):
        line, start = content.count(b"\n", 0, place) + 1, content[place : place + 80].partition(b"\n")[0]
        text = toml_value(start.decode(errors="replace").strip())
        raise MeshError(f"line {line}: {text}: expected a section of a mesh, such as $Nodes, or $Comments")
    return name, header.end() + 1


def _format(content: bytes, start: int) -> tuple[str, str]:
    """Version of the file and the byte order, none if it is text."""
    version, *rest = content[start : start + 80].partition(b"\n")[0].decode(errors="replace").split() or [""]
    number = float(version) if re.fullmatch(r"[0-9]\.?[0-9]{0,9}", version) else 0.0
    if number not in VERSIONS:
        raise MeshError(f"format {toml_value(version)} of gmsh: expected 2.2, 4.0 or 4.1")
    if rest not in (["0", "8"], ["1", "8"]):
        raise MeshError(f"$MeshFormat: {toml_value(' '.join(rest))}: expected 0 8 of text and 1 8 of binary files")
    one = content.find(b"\n", start) + 1
    order = {b"\1\0\0\0": "<", b"\0\0\0\1": ">"}.get(content[one : one + 4], "")
    if rest[0] == "1" and not order:
        raise MeshError("$MeshFormat: there is no number one that gives the byte order")
    return VERSIONS[number], order if rest[0] == "1" else ""


def _names(content: bytes, start: int) -> dict[tuple[int, int], str]:
    text = content[start : end_of("PhysicalNames", content, start)]
    entries = NAME.findall(text)
    count = text.split(maxsplit=1)[:1]
    if count != [str(len(entries)).encode()]:
        raise MeshError(f"$PhysicalNames: {len(entries)} names, and not as many as its first line announces")
    names = {(int(dimension), int(number)): name.decode(errors="replace") for dimension, number, name in entries}
    if len(names) < len(entries):
        raise MeshError("$PhysicalNames: one of the numbers has two names")
    return names


def _entities(section: Section, version: str, result: MshContent) -> None:
    """Read the physical groups of entities, partitioned ones too; boxes and boundaries are passed over."""
    is_part = section.name == "PartitionedEntities"
    if is_part:
        section.whole(1, SIZE)
        section.whole(2 * section.count())
    for dimension, count in enumerate(section.whole(4, SIZE).tolist()):
        for _ in range(count):
            number = int(section.whole(1)[0])
            if is_part:
                section.whole(2)
                section.whole(section.count())
            section.reals(3 if dimension == 0 and version == "4.1" else 6)
            groups = section.whole(section.count())
            if dimension:
                section.whole(section.count())
            result.groups[dimension, number] = tuple(np.abs(groups).tolist())


def _nodes(section: Section, version: str, result: MshContent) -> None:
    if version.startswith("2"):
        result.nodes.append(section.records(section.line(), 3))
        return
    blocks = section.count()
    section.whole(3 if version == "4.1" else 1, SIZE)
    for _ in range(blocks):
        one, other, has_parameters = section.whole(3).tolist()
        dimension, count = one if version == "4.1" else other, section.count()
        if not 0 <= dimension <= 3:
            section.refuse(f"there is no entity of dimension {dimension}")
        reals = 3 + (int(PARAMETERS[dimension]) if has_parameters else 0)
        if version == "4.1":
            numbers, rows = section.whole(count, SIZE), section.reals(count * reals).reshape(-1, reals)
        else:
            numbers, rows = section.records(count, reals)
        result.nodes.append((numbers, rows[:, :3]))


def _parametric_nodes(section: Section, version: str, result: MshContent) -> None:
    """Read nodes in version 2 whose parameters, one or two on curves and surfaces, follow their entity."""
    count, values = section.line(), section.rest()
    width = 2 if section.order else 1  # of a real number
    place = np.arange(max(len(values) - 3 * width - 2, 0))
    dimension = values[place + 1 + 3 * width]
    is_known = np.isin(dimension, (0, 1, 2, 3))
    after = place + 3 + width * (3 + PARAMETERS[np.where(is_known, dimension, 0).astype(int)])
    rows = chain(np.where(is_known, after, len(values) + 1))[:count]
    if count == 0 or len(rows) < count or after[rows[-1]] > len(values):
        section.refuse(f"{count} nodes should follow, and do not")
    points = values[rows[:, None] + 1 + np.arange(3 * width)]
    if section.order:
        points = points.astype(f"{section.order}i4").view(f"{section.order}f8").astype(float)
    result.nodes.append((section.checked(values[rows]), points))
    section.skip(int(after[rows[-1]]))


def _elements(section: Section, version: str, result: MshContent) -> None:
    if version.startswith("2"):
        _elements_of_version_2(section, result)
        return
    size = SIZE if version == "4.1" else INT
    blocks, total = section.count(), section.count()
    if version == "4.1":
        section.whole(2, SIZE)
    for _ in range(blocks):
        one, other, kind = section.whole(3).tolist()
        dimension, entity = (one, other) if version == "4.1" else (other, one)
        count = section.count()
        if kind not in KINDS:
            section.refuse(f"elements of type {kind}: only triangles of three or six nodes can be used")
        if dimension != KINDS[kind][1]:
            section.refuse(f"a {KINDS[kind][0]} in an entity of dimension {dimension}")
        width = 1 + KINDS[kind][3]
        rows = section.whole(count * width, size).reshape(-1, width)
        result.elements[kind].append((rows[:, 0], rows[:, 1:], np.full(count, entity)))
    count_read = sum(len(numbers) for blocks_read in result.elements.values() for numbers, *_ in blocks_read)
    if count_read != total:
        section.refuse(f"{total} elements are announced, and {count_read} are there")


def _elements_of_version_2(section: Section, result: MshContent) -> None:
    """Read elements: number, type, tag count, tags, nodes.

    In binary files type, element count and tag count stand before several elements.
    """
    count, values = section.line(), section.rest()
    if count == 0:
        return
    starts = _row_starts(section, values, count)
    if not section.order:
        _add_rows(result, values, starts, values[starts + 1], starts + 3, values[starts + 2])
        section.skip(len(values))
        return
    kind, several, tags = values[starts[:, None] + np.arange(3)].T
    width = 1 + tags + NODES[kind]
    block, first = np.repeat(np.arange(len(starts)), several), np.cumsum(several) - several
    row = starts[block] + 3 + (np.arange(count) - first[block]) * width[block]
    _add_rows(result, values, row, kind[block], row + 1, tags[block])
    section.skip(int(starts[-1] + 3 + several[-1] * width[-1]))


def _row_starts(section: Section, values: Int, count: int) -> Int:
    """Find where element rows begin, or several rows in binary files: a row's beginning gives its end."""
    heads = max(len(values) - 2, 0)
    kind, tags = values[0 if section.order else 1 :][:heads], values[2:]
    several = values[1:][:heads] if section.order else np.ones(heads, np.int64)
    corners = NODES[np.clip(kind, 0, len(NODES) - 1)]
    length = (3 if section.order else 2) + several * (1 + tags + corners)
    is_row = (corners > 0) & (tags >= 0) & (several > 0)
    after = np.where(is_row, np.arange(heads) + length, len(values) + 1)
    starts = chain(after)
    total = np.cumsum(several[starts])
    starts = starts[total - several[starts] < count] if section.order else starts
    last = starts[-1] if len(starts) else 0
    if len(starts) and corners[last] == 0:
        section.refuse(f"elements of type {kind[last]}: only triangles of three or six nodes can be used")
    if len(starts) and after[last] > len(values):
        section.refuse("the file is damaged or broken off in its elements")
    if several[starts].sum() != count:
        section.refuse(f"{count} elements are announced, and {several[starts].sum()} are there")
    return starts


def _add_rows(result: MshContent, values: Int, row: Int, kind: Int, tag: Int, tags: Int) -> None:
    """Add elements with their numbers at `row`, their first tags at `tag` and nodes behind the tags."""
    group, entity = (np.where(tags > k, values[np.minimum(tag + k, len(values) - 1)], 0) for k in (0, 1))
    # Other programs write physical groups alone: each stands for an entity.
    entity = np.where(entity == 0, -np.abs(group), entity)
    physical_groups = defaultdict[tuple[int, int], set[int]](set)
    for code in np.unique(kind).tolist():
        _, dimension, _, corners = KINDS[code]
        members = np.flatnonzero(kind == code)
        nodes = values[(tag + tags)[members, None] + np.arange(corners)]
        result.elements[code].append((values[row[members]], nodes, entity[members]))
        pairs = np.column_stack([entity[members], np.abs(group[members])])
        changes = np.append(True, (pairs[1:] != pairs[:-1]).any(axis=1))
        for number, physical in np.unique(pairs[changes], axis=0).tolist():
            physical_groups[dimension, number] |= {physical} - {0}
    result.groups |= {entity: tuple(sorted(groups)) for entity, groups in physical_groups.items()}


READERS: dict[str, Callable[[Section, str, MshContent], None]] = {
    "Entities": _entities,
    "PartitionedEntities": _entities,
    "Nodes": _nodes,
    "ParametricNodes": _parametric_nodes,
    "Elements": _elements,
}
