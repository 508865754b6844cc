"""Read triangles and lines from a .msh file, versions 2 to 2.2, 4.0 and 4.1, by gmsh in a separate process.

gmsh runs scripts, opens files beside a mesh and ignores unknown text. Therefore, gmsh reads a copy of the mesh sections
in an empty folder, and the number of elements must agree with the original file.
"""

from __future__ import annotations

import codecs
import io
import re
from collections import defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

import numpy as np

from feti_homog.errors import CaseError, MeshError
from feti_homog.mesh.readers.raw_mesh import DEBONDED, Block, RawMesh, assembled, at, first_of
from feti_homog.mesh.tiles.tile_filling import gmsh_session
from feti_homog.schema import wording
from feti_homog.system.runtime import input_files
from feti_homog.typing import Float, Int

# The names in gmsh for lines, and for triangles and quadrilaterals.
LINES = ("Line 2", "Line 3")
TRIANGLES = ("Triangle 3", "Triangle 6", "Quadrilateral 4", "Quadrilateral 9", "Quadrilateral 8")
VERSION = re.compile(rb"2(\.[0-2]?0*)?|4(\.[01]?0*)?")
# Sections passed to gmsh, and other known sections, without nodes or elements.
GIVEN = ("MeshFormat", "Entities", "PartitionedEntities", "Nodes", "ParametricNodes", "Elements")
OTHERS = {"Comments", "Periodic", "GhostElements", "Parametrizations", "NodeData", "ElementData", "ElementNodeData"}
OTHERS |= {"InterpolationScheme"}
SECTION = re.compile(rb"\s*\$(\w+)[ \t\r]*(?=\n)")
NAME = re.compile(rb'^[ \t]*(\d{1,15})[ \t]+(-?\d{1,15})[ \t]+"([^"\n]*)"', re.MULTILINE)
# Memory limit of gmsh: bytes for any file, and bytes for each byte of the file; the larger limit counts.
MOST_BYTES, MOST_RATIO = 2**31, 50

# Numbers (m,), nodes (m, k) and entities (m,) of the elements of one type.
Elements = tuple[Int, Int, Int]


@dataclass(frozen=True)
class MshContent:
    """The nodes, elements and physical groups of a .msh file, or of the mesh in gmsh.

    Attributes:
        tags, points: (n,) and (n, 3) numbers and positions of the nodes.
        elements: elements by the name of the element type in gmsh, entity by entity.
        groups: numbers of the physical groups of each entity (dimension, number).
        names: names of the physical groups (dimension, number) with a name.
    """

    tags: Int
    points: Float
    elements: dict[str, Elements]
    groups: dict[tuple[int, int], tuple[int, ...]]
    names: dict[tuple[int, int], str] = field(default_factory=dict)

    @classmethod
    def of(cls, gmsh: ModuleType) -> MshContent:
        """Copy the current mesh from gmsh."""
        model = gmsh.model
        tags, points, _ = model.mesh.getNodes()
        groups, blocks = {}, defaultdict[str, list[Elements]](list)
        for dimension, entity in model.getEntities():
            physical = np.abs(model.getPhysicalGroupsForEntity(dimension, entity))  # negative for reversed entities
            groups[dimension, entity] = tuple(physical.tolist())
            for kind, numbers, nodes in zip(*model.mesh.getElements(dimension, entity), strict=True):
                rows = nodes.astype(np.int64).reshape(len(numbers), -1)
                name = model.mesh.getElementProperties(kind)[0]
                blocks[name].append((numbers.astype(np.int64), rows, np.full(len(numbers), entity)))
        elements = {kind: tuple(np.concatenate(k) for k in zip(*rows, strict=True)) for kind, rows in blocks.items()}
        names = {group: model.getPhysicalName(*group) for group in model.getPhysicalGroups()}
        return cls(tags.astype(np.int64), points.reshape(-1, 3), elements, groups, names)


def load(path: Path) -> RawMesh:
    """Read a .msh file by gmsh, after a check of format and counts.

    Raises:
        OSError: the file cannot be read.
        MeshError: the file is damaged or in another format, or has elements that are no triangles, quadrilaterals or
            lines.
    """
    data = input_files.read(path)
    sections = _sections(data.removeprefix(codecs.BOM_UTF8))
    version, *form = sections["MeshFormat"].split()[:3] or [b""]
    if not VERSION.fullmatch(version):
        word = wording.toml_value(version.decode(errors="replace"))
        raise MeshError(f"format {word} of gmsh: expected 2.2, 4.0 or 4.1")
    if form not in ([b"0", b"8"], [b"1", b"8"]):
        raise MeshError("$MeshFormat: expected 0 8 behind the version of text and 1 8 of binary files")
    text, has_blocks, is_binary = sections.get("Elements", b""), version[:1] == b"4", form[0] == b"1"
    if "Elements" not in sections:
        count = 0
    elif is_binary and has_blocks:
        order = ">" if b"\n\0\0\0\1" in sections["MeshFormat"] else "<"
        count = int(np.frombuffer(text[1:17].ljust(16, b"\0"), f"{order}u8")[1])
    else:
        head = re.match(rb"\s*(\d{1,15})\s+(\d{1,15})" if has_blocks else rb"\s*(\d{1,15})(?=\s)", text + b"\n")
        if head is None:
            raise MeshError("$Elements: expected the number of elements at its beginning")
        counts = [int(number) for number in head.groups()]
        count, expected = counts[-1], 1 + sum(counts)
        lines = expected if is_binary else sum(not line.isspace() for line in io.BytesIO(text))
        if lines != expected:
            # gmsh would skip lines.
            raise MeshError(f"$Elements: {lines} lines, and its counts announce {expected}, one for each element")
    with TemporaryDirectory() as folder:
        copy = Path(folder, "mesh.msh")
        copies = (b"$%b%b\n$End%b\n" % (k.encode(), sections[k], k.encode()) for k in GIVEN if k in sections)
        copy.write_bytes(b"".join(copies))
        try:
            content = input_files.in_own_process(copy, _read_by_gmsh, memory=max(MOST_BYTES, MOST_RATIO * len(data)))
        except CaseError:
            raise MeshError("the file is damaged: gmsh crashes on it, or needs too much time or memory") from None
    read = sum(len(numbers) for numbers, *_ in content.elements.values())
    if read != count:
        raise MeshError(f"$Elements: {count} elements are announced, and {read} are there, each with its own number")
    physical_names = sections.get("PhysicalNames", b"\n0")
    entries = NAME.findall(physical_names)
    if physical_names.split(maxsplit=1)[:1] != [str(len(entries)).encode()]:
        raise MeshError(f"$PhysicalNames: {len(entries)} names, and not as many as its first line announces")
    names = {(int(d), int(number)): name.decode(errors="replace").strip() for d, number, name in entries}
    if len(names) < len(entries):
        raise MeshError("$PhysicalNames: one of the numbers has two names")
    return raw_mesh(replace(content, names=names))


def _sections(content: bytes) -> dict[str, bytes]:
    """Split a file into its sections: name -> text between the first and last line; skip OTHERS.  Raises MeshError."""
    start = content[:4096].lstrip()
    if start.startswith(b"$NOD"):
        raise MeshError("format 1 of gmsh: save it in format 2.2 or 4.1")
    if not start.startswith((b"$MeshFormat", b"$Comments", b"$PhysicalNames")):
        ansys = ', but like a file of Ansys: with meshio, write with file_format = "gmsh22"'
        cure = ansys if start.startswith(b"(") else ""
        raise MeshError(f"not a gmsh mesh file: it does not begin with $MeshFormat{cure}")
    sections, place, end = dict[str, bytes](), 0, len(content.rstrip())
    while place < end:
        header = SECTION.match(content, place)
        name = "" if header is None else header[1].decode(errors="replace")
        if header is None or name not in {*GIVEN, *OTHERS, "PhysicalNames"}:
            remainder = content[place:end].lstrip()
            line, text = content.count(b"\n", 0, end - len(remainder)) + 1, remainder[:80].partition(b"\n")[0]
            word = wording.toml_value(text.decode(errors="replace").strip())
            raise MeshError(f"line {line}: {word}: expected a section of a mesh, such as $Nodes, or $Comments")
        if name in sections:
            raise MeshError(f"${name}: it is there twice")
        stop = content.find(b"\n$End%b" % header[1], header.end())
        if stop < 0:
            raise MeshError(f"${name}: there is no $End{name}: the file is damaged or broken off")
        if name not in OTHERS:
            sections[name] = content[header.end() : stop]
        place = stop + len(f"\n$End{name}")
    if "MeshFormat" not in sections:
        raise MeshError("there is no $MeshFormat")
    return sections


def _read_by_gmsh(path: Path) -> MshContent:
    # Wrong extreme numbers in the head of a section do no harm; "Error loading" repeats the previous message.
    passed = ("Info", "Progress", "Warning: Min/Max", "Error: Error loading")
    with gmsh_session() as gmsh:
        gmsh.option.setNumber("Mesh.PartitionCreateTopology", 0)  # 1 would add elements between partitions
        for only_groups in (False, True):
            gmsh.clear()
            gmsh.option.setNumber("Mesh.SwitchElementTags", only_groups)
            gmsh.logger.start()
            try:
                gmsh.merge(str(path))
                refusals = []
            except Exception:  # gmsh raises only Exception
                refusals = ["Error: the file is damaged"]
            if faults := [line for line in gmsh.logger.get() if not line.startswith(passed)] + refusals:
                raise MeshError(f"gmsh cannot read it: {faults[0].partition(': ')[2]}")
            gmsh.logger.stop()
            content = MshContent.of(gmsh)
            if all(entity or not dimension for dimension, entity in content.groups):
                break
    if not only_groups:
        return content
    # Some other programs write only physical groups: a group then stands for an entity.
    return replace(content, groups={key: (key[1],) if key[1] else () for key in content.groups})


def raw_mesh(content: MshContent) -> RawMesh:
    """Convert the content of a file into triangles and curves.

    Raises:
        MeshError: numbers repeat; nodes or triangles are missing; DEBONDED has no lines; unusable element types occur.
    """
    elements, none, faults = content.elements, np.zeros((0, 2), np.int64), list[str]()
    tags = np.concatenate([none[:, 0], *(numbers for numbers, *_ in elements.values())])
    for name, ordered in (("node", np.sort(content.tags)), ("element", np.sort(tags))):
        twice = np.unique(ordered[1:][ordered[1:] == ordered[:-1]])
        if len(twice):
            faults.append(f"{name} {first_of(map(str, twice), len(twice))}: the number is there twice")
    if not all(np.isin(nodes, content.tags).all() for _, nodes, _ in elements.values()):
        faults.append("the file is damaged: gmsh crashes on it, or reads elements without their nodes")
    kinds = elements.keys() - {"Point", *LINES}
    if not faults and not kinds:
        faults.append("no triangles in it: mesh the surfaces and put them in physical surfaces before saving")
    for kind in [] if faults else [kind for kind in elements if kind in kinds - {*TRIANGLES}]:
        numbers, nodes, _ = elements[kind]
        centre = content.points[np.isin(content.tags, nodes[0])].mean(axis=0)
        first = f"element {numbers[0]} at {at(centre)}, the first of {len(numbers)}, is a {kind}"
        usable = "only triangles of three or six nodes, quadrilaterals of four, eight or nine and lines of two or three"
        advice = "mesh the surfaces only, with Mesh.ElementOrder = 1 or 2"
        faults.append(f"{first}: {usable} can be used ({advice})")
    if faults:
        raise MeshError(*faults)
    lines = [elements[kind] for kind in LINES if kind in elements]
    named = {name for (dimension, _), name in content.names.items() if dimension == 1}
    curves = dict.fromkeys(named & {DEBONDED}, none)  # refused below if it has no lines
    members = {(group, number) for (d, number), some in content.groups.items() if d == 1 for group in some}
    for group, number in sorted(members):
        name = content.names.get((1, group)) or f"number {group}"
        ends = [nodes[entity == number, :2] for _, nodes, entity in lines]
        curves[name] = np.concatenate([curves.get(name, none), *ends])
    if not len(curves.get(DEBONDED, (0,))):
        raise MeshError(f'no lines in the physical curve "{DEBONDED}"')
    blocks, groups = list[Block](), list[tuple[int, ...]]()
    for numbers, nodes, entity in (elements[kind] for kind in TRIANGLES if kind in elements):
        entities = np.unique(entity)
        blocks.append(Block(numbers, nodes, len(groups) + np.searchsorted(entities, entity)))
        groups += [content.groups.get((2, number), ()) for number in entities.tolist()]
    aliases = [tuple(map("number {}".format, group)) for group in groups]
    names = [tuple(content.names.get((2, number)) or f"number {number}" for number in group) for group in groups]
    return assembled(content.tags, content.points, blocks, names, curves, aliases=aliases)
