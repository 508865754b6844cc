"""Small meshes of squares, and those that cannot be used."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feti_homog.errors import MeshError
from feti_homog.mesh.readers.msh_reader import read

Nodes = dict[int, tuple[float, float, float]]
# Element tag -> (gmsh element type, physical surface, entity, node tags).
Elements = dict[int, tuple[int, int, int, tuple[int, ...]]]
MATRIX, FIBRE, CURVE = 1, 2, 7
N = 4


@dataclass(frozen=True)
class MshFile:
    """A .msh file of version 2.2, by node and element tags."""

    nodes: Nodes
    elements: Elements
    names: dict[int, str] = field(default_factory=lambda: {MATRIX: "matrix", FIBRE: "fibre"})
    curves: dict[int, str] = field(default_factory=dict)

    def write(self, path: Path) -> None:
        lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames"]
        lines += [str(len(self.names) + len(self.curves))]
        lines += [f'1 {tag} "{name}"' for tag, name in self.curves.items()]
        lines += [f'2 {tag} "{name}"' for tag, name in self.names.items()]
        lines += ["$EndPhysicalNames", "$Nodes", str(len(self.nodes))]
        lines += [f"{tag} {float(x)!r} {float(y)!r} {float(z)!r}" for tag, (x, y, z) in self.nodes.items()]
        lines += ["$EndNodes", "$Elements", str(len(self.elements))]
        for tag, (kind, physical, entity, nodes) in self.elements.items():
            lines.append(" ".join(map(str, (tag, kind, 2, physical, entity, *nodes))))
        path.write_text("\n".join([*lines, "$EndElements", ""]))

    def faults(self, folder: Path, **keys: Any) -> tuple[str, ...]:
        """Return the faults of reading the mesh, which is written as faulty.msh."""
        self.write(folder / "faulty.msh")
        with pytest.raises(MeshError) as caught:
            read(folder / "faulty.msh", **keys)
        return caught.value.faults

    def moved(self, **places: Sequence[float]) -> MshFile:
        """With nodes n7=(x, y[, z]) elsewhere."""
        changed = {int(name[1:]): (*place, 0.0)[:3] for name, place in places.items()}
        return replace(self, nodes={**self.nodes, **changed})

    def without(self, *tags: int) -> MshFile:
        """Without these elements."""
        return replace(self, elements={tag: e for tag, e in self.elements.items() if tag not in tags})

    def with_element(self, tag: int, kind: int, physical: int, nodes: Sequence[int]) -> MshFile:
        """With this element, in place of any of the same tag."""
        element = (kind, physical, physical or 9, tuple(nodes))
        return replace(self, elements={**self.elements, tag: element})

    def with_curve(self, lines: Sequence[tuple[int, int]], name: str = "debonded") -> MshFile:
        """With lines between pairs of nodes in a physical curve."""
        elements = {900 + k: (1, CURVE, CURVE, tuple(pair)) for k, pair in enumerate(lines)}
        return replace(self, elements={**self.elements, **elements}, curves={CURVE: name})


def node(i: int, j: int) -> int:
    """Tag of the node at (i, j) / 4."""
    return 1 + i + (N + 1) * j


def _middle(x: float, y: float) -> bool:
    return abs(x - 0.5) < 0.25 and abs(y - 0.5) < 0.25


def grid(fibre: Callable[[float, float], bool] = _middle) -> MshFile:
    """Return a good mesh of 4 x 4 squares, elements 2 k + 1 and 2 k + 2 the lower and the upper half of square k."""
    nodes = {node(i, j): (i / N, j / N, 0.0) for j in range(N + 1) for i in range(N + 1)}
    elements = {}
    for j in range(N):
        for i in range(N):
            phase = FIBRE if fibre((i + 0.5) / N, (j + 0.5) / N) else MATRIX
            a, b, c, d = node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)
            first = 2 * (i + N * j) + 1
            elements[first] = (2, phase, phase, (a, b, c))
            elements[first + 1] = (2, phase, phase, (a, c, d))
    return MshFile(nodes, elements)


RIGHT_SIDE = ((node(3, 1), node(3, 2)), (node(3, 2), node(3, 3)))
"""Two lines of the interface of `grid()`, and all of them:"""
ALL_SIDES = (
    *RIGHT_SIDE,
    *((node(1, j), node(1, j + 1)) for j in (1, 2)),
    *((node(i, j), node(i + 1, j)) for i in (1, 2) for j in (1, 3)),
)


def turned(mesh: MshFile, *tags: int) -> MshFile:
    """Return the mesh with these elements, of three or six nodes, in the other sense."""
    for tag in tags:
        kind, physical, _, nodes = mesh.elements[tag]
        mesh = mesh.with_element(tag, kind, physical, [nodes[k] for k in (0, 2, 1, 5, 4, 3)[: len(nodes)]])
    return mesh


def _split_node(at: int, elements: Sequence[int]) -> MshFile:
    """Return a second node 99 in the place of one, used by these elements."""
    mesh = grid()
    mesh = replace(mesh, nodes={**mesh.nodes, 99: mesh.nodes[at]})
    for tag in elements:
        kind, physical, _, nodes = mesh.elements[tag]
        mesh = mesh.with_element(tag, kind, physical, [99 if n == at else n for n in nodes])
    return mesh


def _hanging(offset: float = 0.0) -> MshFile:
    """Element 11 split at the middle of its diagonal, neighbour 12 not; the new node moved by an offset."""
    mesh = grid()
    a, b, c = mesh.elements[11][3]
    middle = (np.array(mesh.nodes[a]) + np.array(mesh.nodes[c])) / 2 + (offset, -offset, 0)
    mesh = replace(mesh, nodes={**mesh.nodes, 99: tuple(middle.tolist())})
    return mesh.without(11).with_element(101, 2, FIBRE, (a, b, 99)).with_element(102, 2, FIBRE, (b, c, 99))


def _quadrilaterals() -> MshFile:
    a, b, c = grid().elements[11][3]
    corners = (a, b, c, grid().elements[12][3][2])
    return grid().without(11, 12).with_element(50, 16, FIBRE, corners + corners)


def _third_order() -> MshFile:
    """Return a 10-node triangle."""
    places = [(0, 0), (3, 0), (0, 3), (1, 0), (2, 0), (2, 1), (1, 2), (0, 2), (0, 1), (1, 1)]
    nodes = {k: (float(x), float(y), 0.0) for k, (x, y) in enumerate(places, 1)}
    return MshFile(nodes, {1: (21, 1, 1, tuple(range(1, 11)))})


def _doubled() -> MshFile:
    """Two layers of the same mesh, one shifted a little: nothing shared, all covered twice."""
    mesh = grid()
    nodes = {**mesh.nodes, **{tag + 100: (x, y, z) for tag, (x, y, z) in mesh.nodes.items()}}
    for tag, (x, y, z) in mesh.nodes.items():
        inner = 0 < x < 1 and 0 < y < 1
        nodes[tag + 100] = (x + 0.02 * inner, y + 0.01 * inner, z)
    layer = {tag + 100: (*e[:3], tuple(n + 100 for n in e[3])) for tag, e in mesh.elements.items()}
    on_border = {tag + 100: tag for tag, (x, y, _) in mesh.nodes.items() if x in (0, 1) or y in (0, 1)}
    layer = {tag: (*e[:3], tuple(on_border.get(n, n) for n in e[3])) for tag, e in layer.items()}
    used = {n for e in layer.values() for n in e[3]} | set(mesh.nodes)
    return MshFile({tag: place for tag, place in nodes.items() if tag in used}, {**mesh.elements, **layer})


def _two_islands() -> MshFile:
    """Two separate triangles in opposite corners of their bounding box, on its sides."""
    places = [(0, 0), (1, 0), (0, 1), (3, 3), (2, 3), (3, 2)]
    nodes = {k: (float(x), float(y), 0.0) for k, (x, y) in enumerate(places, 1)}
    return MshFile(nodes, {1: (2, 1, 1, (1, 2, 3)), 2: (2, 1, 1, (4, 5, 6))})


def _unbalanced() -> MshFile:
    """Return the lowest left square in three triangles, with a node on the lower side that the upper one lacks."""
    mesh = replace(grid(), nodes={**grid().nodes, 99: (0.125, 0.0, 0.0)})
    return mesh.without(1).with_element(51, 2, 1, (1, 99, 7)).with_element(52, 2, 1, (99, 2, 7))


def _broken(path: Path) -> None:
    """Write a good file that ends in the middle of its nodes."""
    grid().write(path)
    text = path.read_text()
    path.write_text(text[: text.index("$EndNodes") - 40])


def _line_twice(path: Path) -> None:
    """Write the line of element 12 in place of that of 13."""
    grid().write(path)
    lines = path.read_text().splitlines()
    own = {line.split()[0]: number for number, line in enumerate(lines) if len(line.split()) == 8}
    lines[own["13"]] = lines[own["12"]]
    path.write_text("\n".join([*lines, ""]))


def write_faulty(mesh: MshFile | str | Callable[[Path], object], path: Path) -> None:
    """Write a mesh of the table below, or its text."""
    if isinstance(mesh, MshFile):
        mesh.write(path)
    elif isinstance(mesh, str):
        path.write_text(mesh)
    else:
        mesh(path)


# Part of the message, and what is wrong.
FAULTY_MESHES: list[tuple[str, MshFile | str | Callable[[Path], object]]] = [
    ("cannot be read", lambda path: path.unlink(missing_ok=True)),
    ("not a gmsh mesh file", ""),
    ("not a gmsh mesh file", "Point(1) = {0, 0, 0};\n"),
    ("not a gmsh mesh file", "Dear gmsh,\n"),
    ("no triangles", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"),
    ("$Nodes: there is no $EndNodes: the file is damaged or broken off", _broken),
    ("gmsh cannot read it: Wrong node index 77", grid().with_element(1, 2, 1, (1, 2, 77))),
    ("32 elements are announced, and 31 are there, each with its own number", _line_twice),
    ("no triangles", grid().without(*range(1, 33))),
    ("no triangles", MshFile(grid().nodes, {1: (1, 1, 1, (1, 2))})),
    ("farther from the middle than half the edge's length", _quadrilaterals()),
    ("lines of two or three can be used (mesh the surfaces only, with Mesh.ElementOrder", _third_order()),
    ("element 60 at (0.75, 0.375), the first of 1, is a Line 4: only triangles of three or six nodes,",
     grid().with_element(60, 26, 0, (9, 14, 9, 14))),
    ('no lines in the physical curve "debonded"', grid().with_curve(())),
    ("Tetrahedron", grid().moved(n13=(0.5, 0.5, 1)).with_element(60, 4, 1, (1, 2, 7, 13))),
    ("element 5 at (0.666666667, 0.0833333333): not in any physical surface", grid().with_element(5, 2, 0, (3, 4, 9))),
    ('"number 2" is not a phase', replace(grid(), names={MATRIX: "matrix"})),
    ('"my glass" is not a phase', replace(grid(), names={1: "matrix", 2: "my glass"})),
    ("expected no elements in a void", replace(grid(), names={1: "matrix", 2: "void"})),
    ('"fibre:" is not a phase', replace(grid(), names={1: "matrix", 2: "fibre:"})),
    *((f'physical surface "fibre:{number}" is not a phase', replace(grid(), names={1: "matrix", 2: f"fibre:{number}"}))
      for number in ("0", "02", "9" * 20)),
    ('named "matrix"', replace(grid(), names={1: "fibre:2", 2: "fibre"})),
    ("node 7 (nan, 0.25): coordinates are not finite", grid().moved(n7=(float("nan"), 0.25))),
    ("coordinates are not finite", grid().moved(n7=(0.25, float("inf")))),
    ("node 7 (0.25, 0.25) has z = 0.1", grid().moved(n7=(0.25, 0.25, 0.1))),
    ("overlapping elements on the same side of an edge: the edge between node 2 (0.25, 0) and node 7",
     grid().moved(n7=(0.6, 0.25))),
    ("zero area", grid().moved(n7=(0.25, 0.0))),
    ("element 1 at", grid().with_element(1, 2, 1, (1, 2, 2))),
    ("nodes at the same place (merge nodes): node 13 (0.5, 0.5) and node 99 (0.5, 0.5)", _split_node(13, [11, 12])),
    ("nodes at the same place (merge nodes): node 13 (0.5, 0.5) and node 99 (0.50000009, 0.5)",
     _split_node(13, [11, 12]).moved(n99=(0.5 + 9e-8, 0.5))),
    ("overlapping elements", grid().with_element(77, 2, 1, (1, 2, 7))),
    ("overlapping elements", grid().without(12).with_element(77, 2, 1, (13, 7, 9))),
    ("overlapping elements", turned(grid().without(12).with_element(77, 2, 1, (13, 7, 9)), 77)),
    ("hanging nodes: node 99 (0.375, 0.375) on the edge between node 7 (0.25, 0.25)", _hanging()),
    ("hanging nodes: node 99", _hanging(1e-4)),
    ("node 15 (1, 0.5), expected at (0, 0.5); 4 nodes face 5: mesh both sides alike", grid().moved(n11=(0.1, 0.5))),
    ("no node at the corner (1, 1) of the cell; the nearest nodes are up to 0.25 away; if a hole is there, shift",
     grid().without(31, 32)),
    ("all nodes have y = 0: expected a mesh in the plane x, y",
     replace(grid(), nodes={tag: (x, 0.0, y) for tag, (x, y, _) in grid().nodes.items()})),
    ("no node at the corner", grid().moved(n25=(0.875, 1.0))),
    ("no node at the corner", _two_islands()),
    ("overlap", _doubled()),
    ("node 10 (1, 0.3), expected at (0, 0.3)", grid().moved(n10=(1.0, 0.3))),
    ("node 99 (0.125, 0), expected at (0.125, 1)", _unbalanced()),
]  # fmt: skip
