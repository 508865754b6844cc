"""Read the triangles and the lines of an Abaqus input file (.inp)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.mesh.readers.abaqus_keywords import REFUSED, KeywordBlock, blocks, name_of
from feti_homog.mesh.readers.raw_mesh import Block, RawMesh, assembled
from feti_homog.schema.wording import toml_value
from feti_homog.system.runtime import input_files
from feti_homog.typing import Int

TRIANGLE = re.compile(r"(CPE|CPS|CPEG|DC2D|M3D|S|STRI|R3D)(3|6|65)[A-Z]*")
# Quadrilaterals are cut in two, and rigid triangles have the shape of others.
QUAD = re.compile(r"(CPE|CPS|CPEG|DC2D|M3D|S|R3D)([489])[A-Z]*5?")
LINE = re.compile(r"(T2D|T3D|B2|B3|DC1D)\w*")
LINE_NODES = (2, 3)
# Members that sets may have together, in any file; in one with more characters as many as these.
MOST_MEMBERS = 10**6
# From which of its sets an element has its phase: those before come first.
BY_SECTION, BY_SET, BY_ELEMENTS = range(3)


@dataclass
class _Content:
    """Nodes, triangles and lines (each with its nodes) of a file, and its sets with their elements.

    Attributes:
        left: how many members sets may still get from ranges and from other sets.
        seen: PART and INSTANCE, if there is one.
        is_assembly: whether what follows belongs to the assembly, and not to a part or an instance of it.
    """

    left: int
    nodes: dict[int, list[float]] = field(default_factory=dict)
    triangles: dict[int, list[int]] = field(default_factory=dict)
    lines: dict[int, list[int]] = field(default_factory=dict)
    sets: dict[tuple[int, str], set[int]] = field(default_factory=dict)
    materials: dict[str, str] = field(default_factory=dict)
    seen: set[str] = field(default_factory=set)
    is_assembly: bool = False

    def members(self, level: int, name: str) -> set[int]:
        return self.sets.setdefault((level, name), set())

    def spend(self, members: int) -> None:
        """Count members that a set gets; a fault if they are more than a file of this length has elements."""
        self.left -= members
        if self.left < 0:
            raise ValueError("its sets have more members than a file of this length can have elements")


def load(path: Path) -> RawMesh:
    """Read the triangles of three or six nodes, and the lines of two or three, of an input file with one part.

    The phase of a triangle and the curve of a line is its set that a *SOLID SECTION names, else that of an *ELSET, else
    the ELSET of *ELEMENT; names are in lower case unless quoted.

    Raises:
        OSError: the file cannot be read.
        MeshError: it is damaged, or has other elements.
    """
    text = input_files.read(path).decode("utf-8-sig", "replace")
    content = _Content(left=max(MOST_MEMBERS, len(text)))
    for block in blocks(text):
        try:
            _take(content, block)
        except ValueError as error:
            raise MeshError(f"line {block.number}, *{block.word}: {error}") from None
    faults = _faults(content)
    if faults:
        raise MeshError(*faults)
    return _raw(content)


def _take(content: _Content, block: KeywordBlock) -> None:
    """Read one block."""
    if block.keyword in REFUSED:
        raise ValueError("it makes or moves nodes or elements, and is not read: write them out")
    match block.keyword:
        case "PART" | "INSTANCE" | "END INSTANCE" | "ASSEMBLY" | "END ASSEMBLY":
            _enter(content, block)
        case "INCLUDE":
            raise ValueError("other files are not read: expected all in one file")
        case "NODE" if not content.is_assembly:
            _take_nodes(content, block)
        case "ELEMENT" if content.is_assembly:
            raise ValueError("elements of the assembly are not read: expected all in the part")
        case "ELEMENT":
            _take_elements(content, block)
        case "ELSET" if "INSTANCE" not in block.parameters:
            _take_set(content, block)
        case "SOLID SECTION" | "SHELL SECTION" | "MEMBRANE SECTION":
            name = block.parameter("ELSET")
            content.materials[name] = block.parameters.get("MATERIAL", name)


def _enter(content: _Content, block: KeywordBlock) -> None:
    """Begin or end a part, an instance or the assembly."""
    if block.keyword in content.seen:
        expected = "expected one, in which matrix and fibres share the nodes of their interfaces: merge the instances"
        raise ValueError(f"a second {block.keyword.lower()}: {expected}")
    content.seen |= {block.keyword} & {"PART", "INSTANCE"}
    content.is_assembly = block.keyword in ("ASSEMBLY", "END INSTANCE")
    if block.keyword == "INSTANCE" and len(block.rows) > 1:
        raise ValueError("its rotation is not read: rotate the part")


def _take_nodes(content: _Content, block: KeywordBlock) -> None:
    if block.parameters.get("SYSTEM", "r") != "r":
        raise ValueError("its parameter SYSTEM is not read: expected Cartesian coordinates")
    for tag, *place in block.rows:
        number = _integer(tag)
        if not place:
            raise ValueError(f"node {number} has no coordinates")
        if number in content.nodes:
            raise ValueError(f"node {number} is there twice")
        content.nodes[number] = [*map(_real, place[:3]), 0.0, 0.0][:3]


def _take_elements(content: _Content, block: KeywordBlock) -> None:
    kind = block.parameters.get("TYPE", "").upper()
    counts = _node_counts(kind)
    found = content.lines if counts == LINE_NODES else content.triangles
    for row in block.rows:
        tag, *nodes = map(_integer, row)
        if len(nodes) not in counts:
            raise ValueError(f"element {tag} has {len(nodes)} nodes: expected {' or '.join(map(str, counts))}")
        if tag in content.triangles or tag in content.lines:
            raise ValueError(f"element {tag} is there twice")
        found[tag] = nodes
        if "ELSET" in block.parameters:
            content.members(BY_ELEMENTS, block.parameters["ELSET"]).add(tag)


def _node_counts(kind: str) -> tuple[int, ...]:
    """Return the numbers of nodes that an element of this type may have."""
    if LINE.fullmatch(kind):
        return LINE_NODES
    if quad := QUAD.fullmatch(kind):
        return (int(quad[2]),)
    triangle = TRIANGLE.fullmatch(kind)
    if triangle is None:
        expected = "only triangles of three or six nodes and quadrilaterals of four, eight or nine can be used"
        raise ValueError(f"elements are {kind or 'of no TYPE'}: {expected}")
    return (3,) if triangle[2] == "3" else (6,)


def _take_set(content: _Content, block: KeywordBlock) -> None:
    members = content.members(BY_SET, block.parameter("ELSET"))
    for row in block.rows:
        parts = ({_integer(word)} if word.isdecimal() else _members(content, name_of(word)) for word in row if word)
        for own in [_range(row)] if "GENERATE" in block.parameters else parts:
            content.spend(len(own))
            members.update(own)


def _range(row: list[str]) -> range:
    """Numbers from the first to the last, in steps of the third or of one."""
    first, last, step = [*map(_integer, row), 1][:3] if len(row) in (2, 3) else (0, 0, 0)
    if step < 1 or last < first:
        raise ValueError(f"{', '.join(row)}: expected the first element, the last and a step of at least 1")
    return range(first, last + 1, step)


def _members(content: _Content, name: str) -> set[int]:
    """Return the elements of a set, however it was made."""
    levels = (BY_SECTION, BY_SET, BY_ELEMENTS)
    found = [content.sets[level, name] for level in levels if (level, name) in content.sets]
    if not found:
        raise ValueError(f'there is no element set "{name}"')
    return set().union(*found)


def _faults(content: _Content) -> list[str]:
    """No triangles, unknown nodes, sections of unknown sets."""
    faults = [] if content.triangles else ["no triangles in it"]
    elements = content.triangles | content.lines
    lost = ((tag, node) for tag, nodes in elements.items() for node in nodes if node not in content.nodes)
    faults += [f"element {tag}: there is no node {node}" for tag, node in list(lost)[:1]]
    named = {name for _, name in content.sets}
    unknown = (name for name in content.materials if name not in named)
    return faults + [f'a section names the element set "{name}": there is none' for name in unknown]


def _raw(content: _Content) -> RawMesh:
    made_of = [(material, _members(content, name)) for name, material in content.materials.items()]
    # Sets that sections name have the phases, unless only the materials of the sections have their names.
    by_material = "matrix" in content.materials.values() and "matrix" not in content.materials
    for name, (material, members) in zip(content.materials, made_of, strict=True):
        content.members(BY_SECTION, material if by_material else name).update(members)
    labels = _labels(content)
    all_sets = [(name, members) for (_, name), members in content.sets.items()]
    others = _names_of(made_of + all_sets)
    names_of = {tag: (labels.get(tag, ()), others.get(tag, ())) for tag in content.triangles}
    place = {names: k for k, names in enumerate(dict.fromkeys(names_of.values()))}
    groups, aliases = zip(*place, strict=True)
    by_count: dict[int, list[int]] = {}
    for tag, nodes in content.triangles.items():
        by_count.setdefault(len(nodes), []).append(tag)
    parts = []
    for _, tags in sorted(by_count.items()):
        group = np.array([place[names_of[tag]] for tag in tags])
        parts.append(Block(np.array(tags), np.array([content.triangles[tag] for tag in tags]), group))
    numbers, points = np.fromiter(content.nodes, np.int64), np.array(list(content.nodes.values()))
    containers = "element set", "element set"
    return assembled(numbers, points, parts, groups, _curves(content, labels), containers, aliases)


def _curves(content: _Content, labels: Mapping[int, tuple[str, ...]]) -> dict[str, Int]:
    """Numbers (d, 2) of the nodes at the ends of the lines in each set that has no triangles."""
    with_triangles = {name for tag in content.triangles for name in labels.get(tag, ())}
    curves: dict[str, list[list[int]]] = {}
    for tag, nodes in content.lines.items():
        for name in labels.get(tag, ()):
            curves.setdefault(name, []).append([nodes[0], nodes[-1]])
    return {name: np.array(ends, np.int64) for name, ends in curves.items() if name not in with_triangles}


def _labels(content: _Content) -> dict[int, tuple[str, ...]]:
    """Return the names of the sets from which each element has its phase."""
    found: dict[int, tuple[str, ...]] = {}
    for level in (BY_ELEMENTS, BY_SET, BY_SECTION):
        found |= _names_of((name, members) for (own, name), members in content.sets.items() if own == level)
    return found


def _names_of(sets: Iterable[tuple[str, set[int]]]) -> dict[int, tuple[str, ...]]:
    """Return the names, each once, of the sets that each element is in."""
    found: dict[int, dict[str, None]] = {}
    for name, members in sets:
        for tag in members:
            found.setdefault(tag, {})[name] = None
    return {tag: tuple(names) for tag, names in found.items()}


def _integer(word: str) -> int:
    """Return the whole number that a word is; ValueError if it is none."""
    if not re.fullmatch(r"[+-]?[0-9]{1,15}", word):
        raise ValueError(f"{toml_value(word)}: expected a whole number of at most 15 digits")
    return int(word)


def _real(word: str) -> float:
    """Return the number that a word is; ValueError if it is none."""
    try:
        if "_" not in word and word.isascii():
            return float(word.upper().replace("D", "E"))  # 1.0D+00 is Fortran's
    except ValueError:
        pass
    raise ValueError(f"{toml_value(word)}: expected a number")
