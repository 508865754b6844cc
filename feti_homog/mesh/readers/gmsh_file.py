"""The triangles of a .msh file, as gmsh reads it."""

from __future__ import annotations

from mmap import ACCESS_READ, mmap
from pathlib import Path
from struct import unpack
from types import ModuleType

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.mesh.readers import mesh_checks
from feti_homog.mesh.readers.element_blocks import Block, assembled
from feti_homog.mesh.readers.mesh_checks import RawMesh
from feti_homog.mesh.tiles.filling import LINE, TRIANGLE, gmsh_session
from feti_homog.typing import Int

# How a mesh file of gmsh begins; other text would be run as a script.
HEADERS = ("$MeshFormat", "$Comments", "$PhysicalNames", "$NOD")
# What to do about other elements, by order and dimension.
REMEDY = {
    (1, 2): "do not recombine",
    (2, 2): "do not recombine",
    (3, 2): "mesh with Mesh.ElementOrder = 1 or 2",
    (1, 3): "mesh the surfaces only",
    (2, 3): "mesh the surfaces only",
    (3, 3): "mesh the surfaces only",
}
# gmsh's types of elements of second order; how many nodes a triangle of each type has.
LINE_2, TRIANGLE_2 = 8, 9
NODES_OF_TRIANGLES = {TRIANGLE: 3, TRIANGLE_2: 6}
COUNTS_BYTES = 100  # at the beginning of the section of elements, in which their number is


def load(path: Path) -> RawMesh:
    """The triangles of a file; only their kind has been checked.

    Raises:
        MeshError: if gmsh cannot read it, or if it has other elements.
    """
    try:
        with path.open("rb") as file:
            start = file.read(4096).lstrip().decode("latin-1")
    except OSError as error:
        raise MeshError(f"{path}: cannot be read: {error.strerror}") from None
    if not start.startswith(HEADERS):
        raise MeshError(f"{path.name}: not a gmsh mesh file: it does not begin with {HEADERS[0]}")
    with gmsh_session() as gmsh:
        try:
            gmsh.open(str(path))
        except Exception as error:  # gmsh raises nothing more specific
            raise MeshError(f"{path.name}: gmsh cannot read it: {str(error).strip() or 'it is damaged'}") from None
        faults = _other_kinds(gmsh) or _dropped(gmsh, path)
        if faults:
            raise MeshError(*(f"{path.name}: {fault}" for fault in faults))
        return triangles_of_model(gmsh)


def _dropped(gmsh: ModuleType, path: Path) -> list[str]:
    """That the file has elements which gmsh leaves out without a word, for their numbers were there before."""
    listed = _listed_elements(path)
    read = sum(len(tags) for tags in gmsh.model.mesh.getElements()[1])
    if listed is None or listed == read:
        return []
    return [f"it declares {listed} elements, and {read} can be read: others are missing, or have numbers twice"]


def _listed_elements(path: Path) -> int | None:
    """How many elements a file says that it has; None if it does not say so where its format has it."""
    with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as content:
        is_binary = content[: content.find(b"$EndMeshFormat")].split()[2:3] == [b"1"]
        place = content.find(b"$Elements")
        start = content.find(b"\n", place) + 1
        return None if place < 0 else _first_count(content[start : start + COUNTS_BYTES], is_binary)


def _first_count(content: bytes, is_binary: bool) -> int | None:
    """The number of elements in the line, or in the four binary numbers, that begin their section."""
    line = content.partition(b"\n")[0].split()
    if len(line) in (1, 2, 4) and all(word.isdigit() for word in line):  # of formats 2, 4.0 and 4.1
        return int(line[min(len(line), 2) - 1])
    return int(unpack("4Q", content[:32])[1]) if is_binary and len(content) >= 32 else None


def _other_kinds(gmsh: ModuleType) -> list[str]:
    """Elements that are not triangles of three or six nodes, and the lack of these."""
    faults = []
    kinds = [kind for dimension in (2, 3) for kind in gmsh.model.mesh.getElementTypes(dimension)]
    for kind in kinds:
        if kind not in NODES_OF_TRIANGLES:
            tags, nodes = gmsh.model.mesh.getElementsByType(kind)
            name, dimension, order, *_ = gmsh.model.mesh.getElementProperties(kind)
            points = [gmsh.model.mesh.getNode(node)[0] for node in nodes[: len(nodes) // len(tags)]]
            first = f"element {tags[0]} at {mesh_checks.at(np.mean(points, axis=0))}"
            faults.append(
                f"{first}, the first of {len(tags)}, is a {name}: only triangles of three or six nodes can be used "
                f"({REMEDY[min(order, 3), dimension]})"
            )
    if not kinds:
        faults.append("no triangles in it: mesh the surfaces and put them in physical surfaces before saving")
    return faults


def triangles_of_model(gmsh: ModuleType) -> RawMesh:
    """The triangles of gmsh's current model, with the nodes that they use."""
    blocks, groups = list[Block](), list[tuple[str, ...]]()
    for _, entity in gmsh.model.getEntities(2):
        for kind, count in NODES_OF_TRIANGLES.items():
            tags, nodes = gmsh.model.mesh.getElementsByType(kind, entity)
            if len(tags):
                own = nodes.reshape(-1, count).astype(np.int64)
                blocks.append(Block(tags.astype(np.int64), own, np.full(len(tags), len(groups))))
                physical = gmsh.model.getPhysicalGroupsForEntity(2, entity)
                groups.append(tuple(gmsh.model.getPhysicalName(2, tag) or f"number {tag}" for tag in physical))
    node_tags, coordinates, _ = gmsh.model.mesh.getNodes()
    return assembled(node_tags.astype(np.int64), coordinates.reshape(-1, 3), blocks, groups, _curves(gmsh))


def _curves(gmsh: ModuleType) -> dict[str, Int]:
    """Node tags (d, 2) of the ends of the lines in each physical curve."""
    lines: dict[str, list[Int]] = {}
    for dimension, group in gmsh.model.getPhysicalGroups(1):
        own = lines.setdefault(gmsh.model.getPhysicalName(dimension, group) or f"number {group}", [])
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, group):
            for kind, count in ((LINE, 2), (LINE_2, 3)):
                nodes = gmsh.model.mesh.getElementsByType(kind, entity)[1].astype(np.int64)
                own.append(nodes.reshape(-1, count)[:, :2])
    return {name: np.concatenate(ends) for name, ends in lines.items()}
