"""The triangles of a .msh file of gmsh."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.mesh.readers import msh_content
from feti_homog.mesh.readers.msh_content import KINDS, MshContent
from feti_homog.mesh.readers.raw_mesh import DEBONDED, Block, RawMesh, assembled, at, first_of
from feti_homog.system.runtime import input_files
from feti_homog.typing import Float, Int

# Types of lines and of triangles, which quadrilaterals are cut into.
LINES, TRIANGLES = (1, 8), (2, 9, 3, 10, 16)

# Numbers (m,), nodes (m, k) and entities (m,) of the elements of one type.
Elements = tuple[Int, Int, Int]


def load(path: Path) -> RawMesh:
    """Read the triangles of a file; only their kind and their numbers are checked.

    Raises:
        OSError: it cannot be read.
        MeshError: it is damaged, or it has other elements.
    """
    content = msh_content.read(input_files.read(path))
    tags, points = np.zeros(0, np.int64), np.zeros((0, 3))
    if content.nodes:
        tags, points = (np.concatenate(parts) for parts in zip(*content.nodes, strict=True))
    elements: dict[int, Elements] = {}
    for kind, blocks in content.elements.items():
        numbers, nodes, entity = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
        order = np.argsort(entity, kind="stable")
        if len(order):
            elements[kind] = numbers[order], nodes[order], entity[order]
    faults = _misnumbered(tags, elements) or _other_kinds(tags, points, elements)
    curves = _curves(content, elements)
    if faults := faults or _without_lines(content, curves):
        raise MeshError(*faults)
    triangles, groups = _triangles(content, elements)
    names, aliases = (
        [tuple(map(name, group)) for group in groups] for name in (partial(content.name, 2), "number {}".format)
    )
    return assembled(tags, points, triangles, names, curves, aliases=aliases)


def _triangles(content: MshContent, elements: Mapping[int, Elements]) -> tuple[list[Block], list[tuple[int, ...]]]:
    """Return the triangles, and the numbers of the physical surfaces of their entities."""
    triangles, groups = list[Block](), list[tuple[int, ...]]()
    for kind in TRIANGLES:
        if kind in elements:
            numbers, nodes, entity = elements[kind]
            entities = np.unique(entity)
            triangles.append(Block(numbers, nodes, len(groups) + np.searchsorted(entities, entity)))
            groups += [content.groups.get((2, number), ()) for number in entities.tolist()]
    return triangles, groups


def _misnumbered(tags: Int, elements: Mapping[int, Elements]) -> list[str]:
    """List numbers that are there twice, or else, of each type, the first element with a lost node."""
    numbers = np.concatenate([np.zeros(0, np.int64), *(tag for tag, _, _ in elements.values())])
    faults = []
    for name, ordered in (("node", np.sort(tags)), ("element", np.sort(numbers))):
        twice = np.unique(ordered[1:][ordered[1:] == ordered[:-1]])
        if len(twice):
            faults.append(f"{name} {first_of(map(str, twice), len(twice))}: the number is there twice")
    if faults:
        return faults
    for numbers, nodes, _ in elements.values():
        bad = np.argwhere(~np.isin(nodes, tags))
        faults += [f"element {numbers[row]}: there is no node {nodes[row, column]}" for row, column in bad[:1]]
    return faults


def _other_kinds(tags: Int, points: Float, elements: Mapping[int, Elements]) -> list[str]:
    """List elements that are neither triangles nor quadrilaterals of first or second order, and the lack of these."""
    faults = []
    kinds = [kind for kind in sorted(elements) if KINDS[kind][1] >= 1 and kind not in LINES]
    for kind in (kind for kind in kinds if kind not in TRIANGLES):
        numbers, nodes, _ = elements[kind]
        centre = points[np.isin(tags, nodes[0])].mean(axis=0)
        remedy = "mesh the surfaces only" if KINDS[kind][1] == 3 else "mesh with Mesh.ElementOrder = 1 or 2"
        faults.append(
            f"element {numbers[0]} at {at(centre)}, the first of {len(numbers)}, is a {KINDS[kind][0]}: only triangles "
            "of three or six nodes, quadrilaterals of four, eight or nine and lines of two or three can be used "
            f"({remedy})"
        )
    if not kinds:
        faults.append("no triangles in it: mesh the surfaces and put them in physical surfaces before saving")
    return faults


def _without_lines(content: MshContent, curves: Mapping[str, Int]) -> list[str]:
    """Return the fault of a curve DEBONDED that has a name but no lines."""
    named = {name for (dimension, _), name in content.names.items() if dimension == 1}
    is_empty = DEBONDED in named and not len(curves.get(DEBONDED, ()))
    return [f'no lines in the physical curve "{DEBONDED}"'] if is_empty else []


def _curves(content: MshContent, elements: Mapping[int, Elements]) -> dict[str, Int]:
    """Return the nodes (d, 2) at the ends of the lines in each physical curve."""
    entities = [
        (group, entity) for (dimension, entity), groups in content.groups.items() if dimension == 1 for group in groups
    ]
    curves: dict[str, Int] = {}
    for group, entity in sorted(set(entities)):
        name = content.name(1, group)
        curves.setdefault(name, np.zeros((0, 2), np.int64))
        for kind in (kind for kind in LINES if kind in elements):
            _, nodes, groups = elements[kind]
            ends = nodes[slice(*np.searchsorted(groups, (entity, entity + 1))), :2]
            curves[name] = np.concatenate([curves[name], ends])
    return curves
