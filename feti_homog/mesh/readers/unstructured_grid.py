"""Convert a grid from a VTK or Medit file, with VTK cell types and cell data, into triangles and lines."""

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.mesh.readers.raw_mesh import DEBONDED, Block, RawMesh, assembled
from feti_homog.schema import wording
from feti_homog.typing import Float, Int

Numbers = np.ndarray[Any, Any]
# Patterns of the first word that is not a whole number or not a real number.
WRONG_WORD = {
    "i8": re.compile(rb"(?<!\S)(?![-+]?\d+(?!\S))\S+"),
    "f8": re.compile(rb"(?i)(?<!\S)(?![-+]?((\d+(\.\d*)?|\.\d+)(e[-+]?\d+)?|nan|inf)(?!\S))\S+"),
}
# Numbers of nodes by VTK cell type; quadrilaterals become two triangles.
TRIANGLES = {5: 3, 9: 4, 22: 6, 23: 8, 28: 9}
LINES = {3: 2, 21: 3}
POINTS = (1, 2)
POLYGON, PIXEL = 7, 8
NAMES = {0: "empty cells", 4: "polylines", 6: "triangle strips", 7: "polygons", 10: "tetrahedra", 12: "hexahedra"}
NAMES |= {13: "wedges", 14: "pyramids", 34: "triangles of seven nodes", 42: "polyhedra", 69: "triangles of any order"}
PHASE = "phase"
# Cell data with material numbers of other programs, in the order of precedence.
NUMBERS = (
    "medit:ref", "gmsh:physical", "CellEntityIds", "mat_id", "MaterialIds",
    "material", "cell_tags", "region", "gmsh:geometrical",
)  # fmt: skip
MOST_PHASES = 10**9


@dataclass(frozen=True)
class Grid:
    """A grid of n points and m cells; raises MeshError for inconsistent arrays.

    Attributes:
        points: (n, 3) coordinates.
        types: (m,) VTK cell types.
        nodes: nodes of all cells in one array, cell after cell, numbered from 0.
        counts: (m,) node count of each cell.
        data: cell data, (m,) or (m, k), by name.
        first: number of the first node and the first cell in the file.
    """

    points: Float
    types: Int
    nodes: Int
    counts: Int
    data: Mapping[str, Numbers]
    first: int = 0

    def __post_init__(self) -> None:
        m, counts, nodes = len(self.types), self.counts, self.nodes
        if len(counts) != m or np.any(counts < 0) or counts.sum() != len(nodes):
            raise MeshError("the cells and their nodes do not belong together: the file is damaged")
        bad = np.flatnonzero((nodes < 0) | (nodes >= len(self.points)))
        if len(bad):
            cell, node = self.first + np.searchsorted(np.cumsum(counts), bad[0], side="right"), nodes[bad[0]]
            expected = f"expected {self.first} to {self.first + len(self.points) - 1}"
            raise MeshError(f"cell {cell} has the node {self.first + node}: {expected}")
        sizes = {name: len(values) for name, values in self.data.items() if len(values) != m}
        if sizes:
            raise MeshError(*(f"cell data {name}: {size} values for {m} cells" for name, size in sizes.items()))

    def nodes_of(self, cells: Int, count: int) -> Int:
        """Return the first `count` nodes (k, count) of each cell (k,), with the numbers in the file."""
        starts = (np.cumsum(self.counts) - self.counts)[cells]
        return np.asarray(self.first + self.nodes[starts[:, None] + np.arange(count)], np.int64)


def mesh_of(grid: Grid) -> RawMesh:
    """Convert a grid into triangles and lines.

    The cell data `phase` are 0 in the matrix, 1 in phase fibre, k in fibre:k.  Without `phase`, the first of NUMBERS in
    the grid, or else the only cell data of whole numbers, groups the triangles.  The optional cell data `debonded` are
    1 on initially debonded lines.  Other lines form a curve for each number or, with `phase`, a single curve `line`.

    Raises:
        MeshError: the grid has unusable cells or no phases.
    """
    # Pixels, and polygons of three or four nodes, are triangles and quadrilaterals.
    counts, types, nodes, data = grid.counts, grid.types.copy(), grid.nodes.copy(), grid.data
    pixels = np.flatnonzero((types == PIXEL) & (counts == 4))
    last = np.cumsum(counts)[pixels] - 1
    nodes[last], nodes[last - 1] = nodes[last - 1], nodes[last]
    types[(types == POLYGON) & (counts == 3)] = 5
    types[((types == POLYGON) | (types == PIXEL)) & (counts == 4)] = 9
    grid, faults = replace(grid, types=types, nodes=nodes), _other_cells(types, counts, grid.first)
    whole = [k for k, v in data.items() if k != DEBONDED and v.ndim == 1 and np.array_equal(v, np.round(v))]
    only = [k for k in whole if data[k].dtype.kind in "iu"] or whole
    name = next((name for name in (PHASE, *NUMBERS) if name in data), only[0] if len(only) == 1 else "")
    if not name:
        expected = "expected whole numbers, 0 in the matrix, 1 in phase fibre, 2 in fibre:2, ..."
        faults.append(f"no cell data named {PHASE}, the file has {', '.join(data) or 'none'}: {expected}")
    elif np.size(data[name]) != len(types):
        faults.append(f"cell data {name}: expected one value for each of {len(types)} cells")
    else:
        values = np.ravel(data[name])
        faulty = values[~((values == np.round(values)) & (values >= 0) & (values < MOST_PHASES))]
        faults += [f"cell data {name} = {k:g}: expected 0, 1, 2, ... below {MOST_PHASES}" for k in faulty[:1]]
    if faults:
        raise MeshError(*faults)
    has_phases, groups, blocks = name == PHASE, values.astype(np.int64), []
    distinct = np.unique(groups[np.isin(types, [*TRIANGLES])])
    for kind, count in TRIANGLES.items():
        cells = np.flatnonzero(types == kind)
        if len(cells):
            group = np.searchsorted(distinct, groups[cells])
            blocks.append(Block(grid.first + cells, grid.nodes_of(cells, count), group))
    aliases = [(f"number {k}",) for k in distinct.tolist()]
    phases = [({0: "matrix", 1: "fibre"}.get(k, f"fibre:{k}"),) for k in distinct.tolist()]
    names, containers = (phases if has_phases else aliases), (f"value of {name}", "cells")
    lines = np.flatnonzero(np.isin(types, [*LINES]))
    marks = np.ravel(data.get(DEBONDED, np.zeros(len(types))))[lines]
    number, ends = np.where(marks != 0, -1, 0 if has_phases else groups[lines]), grid.nodes_of(lines, 2)
    titles = {k: "line" if has_phases else f"number {k}" for k in np.unique(number).tolist()} | {-1: DEBONDED}
    curves = {titles[k]: ends[number == k] for k in np.unique(number).tolist()}
    tags = grid.first + np.arange(len(grid.points))
    return assembled(tags, grid.points, blocks, names, curves, containers, aliases)


def _other_cells(types: Int, counts: Int, first: int) -> list[str]:
    """List unusable cells, wrong node counts, and missing triangles; `first` is the first cell number."""
    usable, faults = TRIANGLES | LINES, []
    for kind in np.unique(types).tolist():
        cells = np.flatnonzero(types == kind)
        wrong = cells[counts[cells] != usable.get(kind, 0)]
        if kind not in usable and kind not in POINTS:
            cells_of_type = f"{len(cells)} cells are {NAMES.get(kind, f'of type {kind}')}, the first is number"
            expected = "only triangles of three or six nodes and quadrilaterals of four, eight or nine can be used"
            faults.append(f"{cells_of_type} {cells[0] + first}: {expected}")
        elif kind in usable and len(wrong):
            cell = f"cell {wrong[0] + first}, of type {kind}, has {counts[wrong[0]]} nodes"
            faults.append(f"{cell}: expected {usable[kind]}")
    if not faults and not np.isin(types, [*TRIANGLES]).any():
        faults.append("no triangles in it")
    return faults


class NotANumber(ValueError):
    """The error for a word that is not a number, with its position `place` in the text."""

    def __init__(self, text: bytes, kind: str) -> None:
        wrong = WRONG_WORD[kind].search(text)
        self.place = 0 if wrong is None else wrong.start()
        word = "" if wrong is None else f"{wording.toml_value(wrong[0].decode(errors='replace'))}: "
        super().__init__(f"{word}expected a {'whole number' if kind == 'i8' else 'number'}")


def numbers(text: bytes, kind: str) -> Numbers:
    """Convert text into an array (k,) of whole numbers (`i8`) or real numbers (`f8`).

    Raises:
        NotANumber: a word in the text is not such a number.
    """
    if not text.strip():
        return np.zeros(0, kind)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.fromstring(text, kind, sep=" ")
        except (DeprecationWarning, ValueError):  # a later version of NumPy turns the warning into an error
            raise NotANumber(text, kind) from None
