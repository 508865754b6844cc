"""The triangles of a .msh file, and of gmsh's current model."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.mesh.readers import msh_content
from feti_homog.mesh.readers.msh_content import KINDS, MshContent
from feti_homog.mesh.readers.raw_mesh import DEBONDED, Block, RawMesh, assembled, at, first_of
from feti_homog.mesh.tiles.filling import LINE, TRIANGLE
from feti_homog.system.runtime import input_files
from feti_homog.typing import Float, Int

# What to do about other elements, by order and dimension.
REMEDY = {
    (3, 1): "mesh with Mesh.ElementOrder = 1 or 2",
    (3, 2): "mesh with Mesh.ElementOrder = 1 or 2",
    (1, 3): "mesh the surfaces only",
    (2, 3): "mesh the surfaces only",
    (3, 3): "mesh the surfaces only",
}
# gmsh's other types of elements; how many nodes a triangle of each type has, or a quadrilateral, which is cut in two.
LINE_2, TRIANGLE_2 = 8, 9
NODES_OF_TRIANGLES = {TRIANGLE: 3, TRIANGLE_2: 6, 3: 4, 10: 9, 16: 8}

# Numbers (m,), nodes (m, k) and entities (m,) of the elements of one type.
Elements = tuple[Int, Int, Int]


def load(path: Path) -> RawMesh:
    """Read the triangles of a file; only their kind and their numbers are checked.

    Raises:
        OSError: it cannot be read.
        MeshError: it is damaged, or it has other elements.
    """
    content = msh_content.read(input_files.read(path))
    nodes, points = np.zeros(0, np.int64), np.zeros((0, 3))
    if content.nodes:
        nodes, points = (np.concatenate(parts) for parts in zip(*content.nodes, strict=True))
    elements = {kind: own for kind, blocks in content.elements.items() if len((own := _by_entity(blocks))[0])}
    faults = _repeated(nodes, elements) or _lost(nodes, elements) or _other_kinds(nodes, points, elements)
    curves = _curves_of_content(content, elements)
    if faults := faults or _without_lines(content, curves):
        raise MeshError(*faults)
    blocks, physical = _triangles(content, elements)
    names = partial(_name, content, 2), "number {}".format
    groups, aliases = ([tuple(map(name, own)) for own in physical] for name in names)
    return assembled(nodes, points, blocks, groups, curves, aliases=aliases)


def _triangles(content: MshContent, elements: Mapping[int, Elements]) -> tuple[list[Block], list[tuple[int, ...]]]:
    """Return the triangles, and the numbers of the physical surfaces of their entities."""
    blocks, groups = list[Block](), list[tuple[int, ...]]()
    for kind in NODES_OF_TRIANGLES:
        if kind in elements:
            numbers, nodes, entity = elements[kind]
            entities = np.unique(entity)
            blocks.append(Block(numbers, nodes, len(groups) + np.searchsorted(entities, entity)))
            groups += [tuple(content.groups.get((2, number), ())) for number in entities.tolist()]
    return blocks, groups


def _by_entity(blocks: list[Elements]) -> Elements:
    """Return the elements of one type, by increasing number of their entity."""
    numbers, nodes, entity = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    order = np.argsort(entity, kind="stable")
    return numbers[order], nodes[order], entity[order]


def _repeated(nodes: Int, elements: Mapping[int, Elements]) -> list[str]:
    """Numbers of nodes or of elements that are there twice."""
    everything = {"node": nodes, "element": np.concatenate([np.zeros(0, np.int64), *(e[0] for e in elements.values())])}
    faults = []
    for name, numbers in everything.items():
        ordered = np.sort(numbers)
        twice = np.unique(ordered[1:][ordered[1:] == ordered[:-1]])
        if len(twice):
            faults.append(f"{name} {first_of(map(str, twice), len(twice))}: the number is there twice")
    return faults


def _lost(nodes: Int, elements: Mapping[int, Elements]) -> list[str]:
    """Nodes of elements that are not there: the first one of each type."""
    faults = []
    for numbers, own, _ in elements.values():
        bad = np.argwhere(~np.isin(own, nodes))
        if len(bad):
            row, column = bad[0]
            faults.append(f"element {numbers[row]}: there is no node {own[row, column]}")
    return faults


def _other_kinds(nodes: Int, points: Float, elements: Mapping[int, Elements]) -> list[str]:
    """Elements that are neither triangles nor quadrilaterals of first or second order, and the lack of these."""
    faults = []
    kinds = [kind for kind in sorted(elements) if KINDS[kind][1] >= 1 and kind not in (LINE, LINE_2)]
    for kind in kinds:
        if kind not in NODES_OF_TRIANGLES:
            name, dimension, order, _ = KINDS[kind]
            numbers, own, _ = elements[kind]
            centre = points[np.isin(nodes, own[0])].mean(axis=0)
            faults.append(
                f"element {numbers[0]} at {at(centre)}, the first of {len(numbers)}, is a {name}: only triangles of "
                "three or six nodes, quadrilaterals of four, eight or nine and lines of two or three can be used "
                f"({REMEDY[min(order, 3), dimension]})"
            )
    if not kinds:
        faults.append("no triangles in it: mesh the surfaces and put them in physical surfaces before saving")
    return faults


def _without_lines(content: MshContent, curves: Mapping[str, Int]) -> list[str]:
    """Return the fault of a curve DEBONDED that has a name but no lines."""
    named = [name for (dimension, _), name in content.names.items() if dimension == 1]
    is_empty = DEBONDED in named and not len(curves.get(DEBONDED, ()))
    return [f'no lines in the physical curve "{DEBONDED}"'] if is_empty else []


def _name(content: MshContent, dimension: int, group: int) -> str:
    return content.names.get((dimension, group)) or f"number {group}"


def _curves_of_content(content: MshContent, elements: Mapping[int, Elements]) -> dict[str, Int]:
    """Node tags (d, 2) of the ends of the lines in each physical curve."""
    pairs = (
        (group, entity) for (dimension, entity), groups in content.groups.items() for group in groups if dimension == 1
    )
    lines: dict[str, list[Int]] = {}
    for group, entity in sorted(set(pairs)):
        own = lines.setdefault(_name(content, 1, group), [np.zeros((0, 2), np.int64)])
        for kind in (LINE, LINE_2):
            if kind in elements:
                _, nodes, entities = elements[kind]
                own.append(nodes[slice(*np.searchsorted(entities, (entity, entity + 1))), :2])
    return {name: np.concatenate(ends) for name, ends in lines.items()}


def triangles_of_model(gmsh: ModuleType) -> RawMesh:
    """Return the triangles of gmsh's current model, with the nodes that they use."""
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
