"""Read the triangles and the lines of an Abaqus input file (.inp)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.mesh.readers.element_blocks import Block, assembled
from feti_homog.mesh.readers.mesh_checks import RawMesh
from feti_homog.schema.wording import toml_value
from feti_homog.typing import Int

TRIANGLE = re.compile(r"(CPE|CPS|CPEG|DC2D|M3D|S|STRI)(3|6|65)[A-Z]*")
LINE = re.compile(r"(T2D|T3D|B2|B3|DC1D)\w*")
LINE_NODES = (2, 3)
# From which of its sets an element has its phase: those before come first.
BY_SECTION, BY_SET, BY_ELEMENTS = range(3)


@dataclass
class _Content:
    """Nodes, triangles and lines (each with its nodes) of a file, and its sets with their elements."""

    nodes: dict[int, list[float]] = field(default_factory=dict)
    triangles: dict[int, list[int]] = field(default_factory=dict)
    lines: dict[int, list[int]] = field(default_factory=dict)
    sets: dict[tuple[int, str], set[int]] = field(default_factory=dict)
    sections: list[str] = field(default_factory=list)
    parts: int = 0

    def members(self, level: int, name: str) -> set[int]:
        return self.sets.setdefault((level, name), set())


def load(path: Path) -> RawMesh:
    """Read the triangles of three or six nodes, and the lines of two or three, of an input file with one part.

    The phase of a triangle and the curve of a line is its set that a *SOLID SECTION names, else that of an *ELSET, else
    the ELSET of *ELEMENT; names are in lower case unless quoted.

    Raises:
        OSError: the file cannot be read.
        MeshError: it is damaged, or has other elements.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    content = _Content()
    for number, words, rows in _blocks(text):
        try:
            _take(content, words, rows)
        except KeyError as error:
            raise MeshError(f"line {number}, *{words['']}: no {error.args[0]}") from None
        except IndexError:
            raise MeshError(f"line {number}, *{words['']}: a line below it ends too early") from None
        except ValueError as error:
            raise MeshError(f"line {number}, *{words['']}: {error}") from None
    faults = _faults(content)
    if faults:
        raise MeshError(*faults)
    return _raw(content)


def _blocks(text: str) -> Iterator[tuple[int, dict[str, str], list[list[str]]]]:
    """The keyword lines with their number, their words (the keyword under ""), and the data lines that follow."""
    number, words, rows = 0, dict[str, str](), list[list[str]]()
    open_line = ""
    for place, line in enumerate(text.splitlines(), start=1):
        line = line.strip()
        if not line or line.startswith("**"):
            continue
        if line.startswith("*") or open_line.startswith("*"):
            open_line += line
            if open_line.endswith(","):
                continue
            if words:
                yield number, words, rows
            number, words, rows, open_line = place, _words(open_line), [], ""
        elif words:
            rows.append([word.strip() for word in line.split(",") if word.strip()])
    if words:
        yield number, words, rows


def _words(line: str) -> dict[str, str]:
    """Keyword and parameters of a line: *ELEMENT, TYPE=CPE3 has {"": "ELEMENT", "TYPE": "CPE3"}."""
    keyword, *parameters = (word.strip() for word in line[1:].split(","))
    pairs = (word.partition("=") for word in parameters)
    return {"": re.sub(r"\s+", " ", keyword.upper()), **{k.strip().upper(): _name(v) for k, _, v in pairs}}


def _integer(word: str) -> int:
    try:
        return int(word)
    except ValueError:
        raise ValueError(f"{toml_value(word)}: expected a whole number") from None


def _real(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise ValueError(f"{toml_value(word)}: expected a number") from None


def _name(word: str) -> str:
    word = word.strip()
    return word[1:-1] if word[:1] == '"' else word.lower()


def _take(content: _Content, words: dict[str, str], rows: list[list[str]]) -> None:
    """Read one block."""
    match words[""]:
        case "PART":
            content.parts += 1
        case "INCLUDE":
            raise ValueError("other files are not read: expected all in one file")
        case "NODE":
            content.nodes |= {_integer(row[0]): [*map(_real, row[1:4]), 0.0, 0.0][:3] for row in rows}
        case "ELEMENT":
            _take_elements(content, words, rows)
        case "ELSET" if "INSTANCE" not in words:
            _take_set(content, words, rows)
        case "SOLID SECTION" | "SHELL SECTION":
            content.sections.append(words["ELSET"])


def _take_elements(content: _Content, words: dict[str, str], rows: list[list[str]]) -> None:
    kind = words.get("TYPE", "").upper()
    counts = _node_counts(kind)
    elements = {_integer(row[0]): [_integer(word) for word in row[1:]] for row in rows}
    for tag, nodes in elements.items():
        if len(nodes) not in counts:
            raise ValueError(f"element {tag} has {len(nodes)} nodes: expected {' or '.join(map(str, counts))}")
        if tag in content.triangles or tag in content.lines:
            raise ValueError(f"element {tag} is there twice")
    (content.lines if counts == LINE_NODES else content.triangles).update(elements)
    if "ELSET" in words:
        content.members(BY_ELEMENTS, words["ELSET"]).update(elements)


def _node_counts(kind: str) -> tuple[int, ...]:
    """Return the numbers of nodes that an element of this type may have."""
    if LINE.fullmatch(kind):
        return LINE_NODES
    triangle = TRIANGLE.fullmatch(kind)
    if triangle is None:
        raise ValueError(f"elements are {kind or 'of no TYPE'}: only triangles of three or six nodes can be used")
    return (3,) if triangle[2] == "3" else (6,)


def _take_set(content: _Content, words: dict[str, str], rows: list[list[str]]) -> None:
    members = content.members(BY_SET, words["ELSET"])
    for row in rows:
        if "GENERATE" in words:
            numbers = [_integer(word) for word in [*row, "1"]]
            members.update(range(numbers[0], numbers[1] + 1, numbers[2] or 1))
            continue
        for word in row:
            members.update([_integer(word)] if word.isdecimal() else _members(content, _name(word)))


def _members(content: _Content, name: str) -> set[int]:
    """The elements of a set, however it was made."""
    found = [members for (_, own), members in content.sets.items() if own == name]
    if not found:
        raise ValueError(f'there is no element set "{name}"')
    return set().union(*found)


def _faults(content: _Content) -> list[str]:
    """Several parts, no triangles, unknown nodes, sections of unknown sets."""
    faults = []
    if content.parts > 1:
        faults.append(f"{content.parts} parts: expected one")
    if not content.triangles:
        faults.append("no triangles in it")
    elements = content.triangles | content.lines
    lost = ((tag, node) for tag, nodes in elements.items() for node in nodes if node not in content.nodes)
    faults += [f"element {tag}: there is no node {node}" for tag, node in list(lost)[:1]]
    named = {name for _, name in content.sets}
    unknown = (name for name in content.sections if name not in named)
    return faults + [f'a section names the element set "{name}": there is none' for name in unknown]


def _raw(content: _Content) -> RawMesh:
    for name in content.sections:
        content.members(BY_SECTION, name).update(_members(content, name))
    labels: dict[int, tuple[str, ...]] = {}
    for level in (BY_ELEMENTS, BY_SET, BY_SECTION):
        labels |= _labels(content, level)
    groups = list(dict.fromkeys(labels.get(tag, ()) for tag in content.triangles))
    place = {names: k for k, names in enumerate(groups)}
    blocks = []
    for count in sorted({len(nodes) for nodes in content.triangles.values()}):
        own = {tag: nodes for tag, nodes in content.triangles.items() if len(nodes) == count}
        group = np.array([place[labels.get(tag, ())] for tag in own])
        blocks.append(Block(np.fromiter(own, np.int64), np.array(list(own.values()), np.int64), group))
    numbers, points = np.fromiter(content.nodes, np.int64), np.array(list(content.nodes.values()))
    return assembled(numbers, points, blocks, groups, _curves(content, labels), ("element set", "element set"))


def _curves(content: _Content, labels: Mapping[int, tuple[str, ...]]) -> dict[str, Int]:
    """Numbers (d, 2) of the nodes at the ends of the lines in each set that has no triangles."""
    with_triangles = {name for tag in content.triangles for name in labels.get(tag, ())}
    curves: dict[str, list[list[int]]] = {}
    for tag, nodes in content.lines.items():
        for name in labels.get(tag, ()):
            curves.setdefault(name, []).append([nodes[0], nodes[-1]])
    return {name: np.array(ends, np.int64) for name, ends in curves.items() if name not in with_triangles}


def _labels(content: _Content, level: int) -> dict[int, tuple[str, ...]]:
    """The names of the sets of one level that each element is in."""
    found: dict[int, tuple[str, ...]] = {}
    for (own, name), members in content.sets.items():
        for tag in members if own == level else ():
            found[tag] = (*found.get(tag, ()), name)
    return found
