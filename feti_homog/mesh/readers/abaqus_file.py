"""Read the triangles and the lines of an Abaqus input file (.inp)."""

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.mesh.readers.abaqus_keywords import REFUSED, KeywordBlock, blocks, name_of
from feti_homog.mesh.readers.raw_mesh import Block, RawMesh, assembled
from feti_homog.schema import wording
from feti_homog.system.runtime import input_files

# Patterns of element types, and the allowed numbers of nodes: lines; quadrilaterals, which the reader cuts in two;
# triangles, also rigid elements.
SIZES: dict[str, tuple[int, ...]] = {
    r"(T2D|T3D|B2|B3|DC1D)\w*": (2, 3),
    **{rf"(CPE|CPS|CPEG|DC2D|M3D|S|R3D){size}[A-Z]*5?": (size,) for size in (4, 8, 9)},
    "CAX4P": (4,),  # the name that meshio gives quadrilaterals
    r"(CPE|CPS|CPEG|DC2D|M3D|S|STRI|R3D)3[A-Z]*": (3,),
    r"(CPE|CPS|CPEG|DC2D|M3D|S|STRI|R3D)65?[A-Z]*": (6,),
}
# Real numbers; Fortran writes 1.0D+00.
REAL = r"(?i)[+-]?(([0-9]+(\.[0-9]*)?|\.[0-9]+)([ed][+-]?[0-9]+)?|nan|inf|infinity)"
# Whole numbers; meshio writes 12.0 into sets.
WHOLE = r"[0-9]{1,15}(\.0*)?"
# Limit for the members of all sets together; in long files, the limit is the number of characters.
MOST_MEMBERS = 10**6
# The kinds of sets that name the phase of an element, in the order of precedence.
BY_SECTION, BY_SET, BY_ELEMENTS = range(3)


def load(path: Path) -> RawMesh:
    """Read triangles, quadrilaterals and lines from an input file with one part.

    Element sets name the phases of triangles and the curves of lines: the set of a section (*SOLID SECTION, ...), else
    the *ELSET, else the ELSET of *ELEMENT. The material names the phase if a material, but no set of a section, is
    named matrix. Names become lower case unless quoted. Elements have first or second order.

    Raises:
        OSError: the file cannot be read.
        MeshError: the file is damaged, or has unusable elements.
    """
    text = input_files.read(path).decode("utf-8-sig", "replace")
    content = _Content(budget=max(MOST_MEMBERS, len(text)))
    for block in blocks(text):
        try:
            content.take(block)
        except ValueError as error:
            raise MeshError(f"line {block.number}, *{block.word}: {error}") from None
    return content.raw_mesh()


@dataclass
class _Content:
    """The nodes, elements and sets in the blocks of a file so far; `take` adds a block.

    Attributes:
        budget: number of members that sets may still get.
        nodes: coordinates by node number.
        triangles, lines: nodes by element number; triangles include quadrilaterals.
        sets: elements by kind and name of the set.
        materials: materials of the sections by set name; the set name itself for sections without a material.
        seen: PART and INSTANCE, if the file has them.
        is_assembly: whether the next block belongs to the assembly itself, and not to a part or an instance.
    """

    budget: int
    nodes: dict[int, list[float]] = field(default_factory=dict)
    triangles: dict[int, list[int]] = field(default_factory=dict)
    lines: dict[int, list[int]] = field(default_factory=dict)
    sets: dict[tuple[int, str], set[int]] = field(default_factory=dict)
    materials: dict[str, str] = field(default_factory=dict)
    seen: set[str] = field(default_factory=set)
    is_assembly: bool = False

    def take(self, block: KeywordBlock) -> None:
        """Add the nodes, elements, sets or sections of a block, or skip it; ValueError for refused or faulty blocks."""
        if block.keyword in REFUSED:
            raise ValueError(REFUSED[block.keyword])
        match block.keyword:
            case "PART" | "INSTANCE" | "END INSTANCE" | "ASSEMBLY" | "END ASSEMBLY" as keyword:
                if keyword in self.seen:
                    expected = "one, in which matrix and fibres share the nodes of their interfaces: merge instances"
                    raise ValueError(f"a second {keyword.lower()}: expected {expected} (Abaqus/CAE: Merge/Cut, Mesh)")
                self.seen |= {keyword} & {"PART", "INSTANCE"}
                self.is_assembly = keyword in ("ASSEMBLY", "END INSTANCE")
                if keyword == "INSTANCE" and len(block.rows) > 1:
                    raise ValueError("its rotation is not read: rotate the part")
            case "NODE" if not self.is_assembly:
                if block.parameters.get("SYSTEM", "r") != "r":
                    raise ValueError("its parameter SYSTEM is not read: expected Cartesian coordinates")
                for tag, *place in block.rows:
                    number, words = _integer(tag), [_checked(word, REAL, "a number") for word in place[:3]]
                    if not place or number in self.nodes:
                        raise ValueError(f"node {number} {'is there twice' if place else 'has no coordinates'}")
                    self.nodes[number] = [*(float(word.upper().replace("D", "E")) for word in words), 0.0, 0.0][:3]
            case "ELEMENT":
                self._take_elements(block)
            # meshio copies gmsh's sets gmsh:..., which have no numbers of elements.
            case "ELSET" if "INSTANCE" not in block.parameters and not block.parameter("ELSET").startswith("gmsh:"):
                self._take_set(block)
            case "SOLID SECTION" | "SHELL SECTION" | "MEMBRANE SECTION":
                name = block.parameter("ELSET")
                self.materials[name] = block.parameters.get("MATERIAL", name)

    def _take_elements(self, block: KeywordBlock) -> None:
        """Add the elements of a block; ValueError for unusable types, wrong node counts and repeated numbers."""
        if self.is_assembly:
            raise ValueError("elements of the assembly are not read: expected all in the part")
        kind = block.parameters.get("TYPE", "").upper()
        counts = next((sizes for pattern, sizes in SIZES.items() if re.fullmatch(pattern, kind)), ())
        if not counts:
            expected = "only triangles of three or six nodes and quadrilaterals of four, eight or nine can be used"
            if kind.startswith("COH"):
                expected = "delete cohesive elements and merge the nodes of their faces; [interface] has the law"
            raise ValueError(f"elements are {kind or 'of no TYPE'}: {expected}")
        elements = self.lines if len(counts) > 1 else self.triangles
        for row in block.rows:
            tag, *nodes = map(_integer, row)
            if len(nodes) not in counts:
                raise ValueError(f"element {tag} has {len(nodes)} nodes: expected {' or '.join(map(str, counts))}")
            if tag in self.triangles or tag in self.lines:
                raise ValueError(f"element {tag} is there twice")
            elements[tag] = nodes if not kind.startswith("B33") else [nodes[0], *nodes[2:], nodes[1]]  # meshio's order
            if "ELSET" in block.parameters:
                self.sets.setdefault((BY_ELEMENTS, block.parameters["ELSET"]), set()).add(tag)

    def _take_set(self, block: KeywordBlock) -> None:
        """Add elements, other sets or ranges (GENERATE) to a set; ValueError for faulty blocks or over `budget`."""
        members = self.sets.setdefault((BY_SET, block.parameter("ELSET")), set())
        for row in block.rows:
            parts: Iterable[Collection[int]] = (
                {_integer(word)} if re.fullmatch(WHOLE, word) else self.members(name_of(word)) for word in row if word
            )
            if "GENERATE" in block.parameters:
                first, last, step = [*map(_integer, row), 1][:3] if len(row) in (2, 3) else (0, 0, 0)
                if step < 1 or last < first:
                    raise ValueError(f"{', '.join(row)}: expected the first element, the last and a step of at least 1")
                parts = [range(first, last + 1, step)]
            for part in parts:
                self.budget -= len(part)
                if self.budget < 0:
                    raise ValueError("its sets have more members than a file of this length can have elements")
                members.update(part)

    def members(self, name: str) -> set[int]:
        """Return the elements of a set, from sections, *ELSET and *ELEMENT; ValueError for an unknown set."""
        levels = [self.sets[level, name] for level in (BY_SECTION, BY_SET, BY_ELEMENTS) if (level, name) in self.sets]
        if not levels:
            raise ValueError(f'there is no element set "{name}"')
        return set().union(*levels)

    def raw_mesh(self) -> RawMesh:
        """Return the mesh: triangles grouped by set names, and curves from sets of lines.

        Raises MeshError if triangles, nodes of elements, or sets of sections are missing.
        """
        faults = [] if self.triangles else ["no triangles in it"]
        if self.triangles and not self.sets:
            faults = ["no element sets: expected one for each phase, such as *ELEMENT, TYPE=CPS3, ELSET=matrix"]
        elements = self.triangles | self.lines
        lost = ((tag, node) for tag, nodes in elements.items() for node in nodes if node not in self.nodes)
        faults += [f"element {tag}: there is no node {node}" for tag, node in islice(lost, 1)]
        set_names = {name for _, name in self.sets}
        unknown = [name for name in self.materials if name not in set_names]
        faults += [f'a section names the element set "{name}": there is none' for name in unknown]
        if faults:
            raise MeshError(*faults)
        made_of = [(material, self.members(name)) for name, material in self.materials.items()]
        # Phases are the names of the sets of sections, or of the materials if only a material is named matrix.
        by_material = "matrix" in self.materials.values() and "matrix" not in self.materials
        for name, (material, members) in zip(self.materials, made_of, strict=True):
            self.sets.setdefault((BY_SECTION, material if by_material else name), set()).update(members)
        labels: dict[int, tuple[str, ...]] = {}
        for level in (BY_ELEMENTS, BY_SET, BY_SECTION):
            labels |= _names_of((name, members) for (priority, name), members in self.sets.items() if priority == level)
        names = _names_of(made_of + [(name, members) for (_, name), members in self.sets.items()])
        names_of = {tag: (labels.get(tag, ()), names.get(tag, ())) for tag in self.triangles}
        place = {pair: k for k, pair in enumerate(dict.fromkeys(names_of.values()))}
        parts = []
        for count in sorted(set(map(len, self.triangles.values()))):
            triangles = {tag: nodes for tag, nodes in self.triangles.items() if len(nodes) == count}
            group = np.array([place[names_of[tag]] for tag in triangles])
            parts.append(Block(np.array([*triangles]), np.array([*triangles.values()]), group))
        groups, aliases = zip(*place, strict=True)
        numbers, points = np.fromiter(self.nodes, np.int64), np.array(list(self.nodes.values()))
        # Sets of lines without triangles are curves.
        with_triangles = {name for tag in self.triangles for name in labels.get(tag, ())}
        ends: dict[str, list[list[int]]] = {}
        for tag, nodes in self.lines.items():
            for name in labels.get(tag, ()):
                if name not in with_triangles:
                    ends.setdefault(name, []).append([nodes[0], nodes[-1]])
        curves = {name: np.array(pairs, np.int64) for name, pairs in ends.items()}
        return assembled(numbers, points, parts, groups, curves, ("element set", "element set"), aliases)


def _names_of(sets: Iterable[tuple[str, set[int]]]) -> dict[int, tuple[str, ...]]:
    """Map each element to the names of its sets, in the order of `sets`, without repetition."""
    names: dict[int, dict[str, None]] = {}
    for name, members in sets:
        for tag in members:
            names.setdefault(tag, {})[name] = None
    return {tag: tuple(unique) for tag, unique in names.items()}


def _integer(word: str) -> int:
    """Convert a word such as 12 or 12.0 into a whole number; ValueError for any other word."""
    return int(_checked(word, f"[+-]?{WHOLE}", "a whole number of at most 15 digits").partition(".")[0])


def _checked(word: str, pattern: str, expected: str) -> str:
    """Return a word if it matches a pattern; else raise ValueError, with the `expected` kind of word."""
    if not re.fullmatch(pattern, word):
        raise ValueError(f"{wording.toml_value(word)}: expected {expected}")
    return word
