"""Read the mesh and the fields of result.h5, coarsened for pictures.

Refinements are undone until at most TRIANGLE_LIMIT triangles are left, if possible; the file is read in blocks.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.materials import voigt
from feti_homog.typing import Array

LEAST_AREA = 0.5  # deformed / undeformed triangle area: a triangle turns over at zero
TRIANGLE_LIMIT = 100_000  # triangles in a picture
SAME_PLACE = 1e-6  # largest distance of coincident nodes, in sizes of the cell
QUARTERS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])  # the quarters of a six-node triangle


@dataclass(frozen=True)
class DrawnMesh:
    """The q triangles and p nodes of a picture: `group` file triangles make one, or one of them makes `pieces`."""

    block: int  # rows of a table read at once
    group: int
    pieces: int  # drawn triangles per element: 4 for a curved one
    nodes: Array  # (p,) file numbers of the drawn nodes, ascending
    points: Array  # (p, 2)
    triangles: Array  # (q, 3) into points
    body: Array  # (q,)
    subdomain: Array  # (q,)
    rank: Array  # (q,)
    phase: Array  # (q,)

    @cached_property
    def areas(self) -> Array:
        """Return the areas of the triangles (q,)."""
        return np.asarray(np.abs(_determinant(_sides(self.points, self))) / 2)

    @cached_property
    def node_areas(self) -> Array:
        """Return the nodal areas (p,), a third of the triangle areas around each node."""
        return np.bincount(self.triangles.ravel(), np.repeat(self.areas / 3, 3), len(self.points))

    @cached_property
    def places(self) -> Array:
        """Number the positions in each body, and return the number of every node's position (p,)."""
        tolerance = SAME_PLACE * np.ptp(self.points, axis=0).max()
        body = np.zeros(len(self.points), np.int64)
        body[self.triangles] = self.body[:, None]
        keys = np.column_stack([body, np.round(self.points / tolerance).astype(np.int64)])
        return np.asarray(np.unique(keys, axis=0, return_inverse=True)[1].ravel())


def drawn_mesh(file: Any, limit: int = TRIANGLE_LIMIT, block: int = 1 << 18) -> DrawnMesh:
    """Read a mesh for pictures from an open result.h5, `block` table rows at a time.

    The mesh is the finest refinement level with at most `limit` triangles, or else the coarsest level.
    """
    table = file["mesh/triangles"]
    refine, curved = int(file.attrs["refine"]), table.shape[1] == 6
    level = next((j for j in range(refine) if len(table) <= limit * 4**j), refine)
    group = 4**level
    pieces = 4 if curved and level == 0 and 4 * len(table) <= limit else 1

    def corners_of(rows: Array) -> Array:
        if pieces > 1:
            return np.asarray(rows[:, 0][:, QUARTERS].reshape(-1, 3))
        # Corner i is vertex i of one triangle in the group.
        return np.asarray(rows[:, np.arange(3) * ((group - 1) // 3), np.arange(3)])

    corners = _blocks(table, group, block, corners_of)
    nodes, triangles = np.unique(corners, return_inverse=True)
    labels = {
        name: np.repeat(_blocks(file[f"mesh/{name}"], group, block, lambda rows: rows[:, 0]), pieces)
        for name in ("body", "subdomain", "rank", "phase")
    }
    points = _picked(file["mesh/points"], nodes, block)
    return DrawnMesh(block, group, pieces, nodes, points, triangles.reshape(-1, 3), **labels)


def nodal_values(table: Any, drawn: DrawnMesh) -> Array:
    """Return the rows (p, ...) of a nodal table at the drawn nodes."""
    return _picked(table, drawn.nodes, drawn.block)


def triangle_means(table: Any, column: int | None, drawn: DrawnMesh) -> Array:
    """Average a table column, or a table without columns, over the drawn triangles (q,)."""
    selection = ... if column is None else (..., column)
    means = _blocks(table, drawn.group, drawn.block, lambda rows: rows[selection].mean(axis=1))
    return np.repeat(means, drawn.pieces)


def node_means(values: Array, drawn: DrawnMesh) -> Array:
    """Average triangle values (q,) at the drawn nodes (p,), weighted by area, within each body."""
    place, weights = drawn.places[drawn.triangles].ravel(), np.repeat(drawn.areas, 3)
    sums = np.bincount(place, np.repeat(values * drawn.areas, 3)) / np.bincount(place, weights)
    return np.asarray(sums[drawn.places])


def outline_edges(drawn: DrawnMesh, label: Array) -> Array:
    """Return the edges (e, 2) that bound each group of triangles with an equal `label` (q,).

    An edge between two groups occurs once on either side.  Nodes are torn, so an edge with one triangle is on a
    subdomain border; the edge has a coincident twin across that border, but no twin on the cell border.
    """
    edges = np.concatenate([drawn.triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    owner = np.tile(label, 3)
    ordered = np.sort(edges, axis=1)
    keys = ordered[:, 0] * len(drawn.nodes) + ordered[:, 1]
    _, first, count = np.unique(keys, return_index=True, return_counts=True)
    border, owner = ordered[first[count == 1]], owner[first[count == 1]]
    middle = drawn.points[border].mean(axis=1)
    twins = cKDTree(middle).query_pairs(SAME_PLACE * np.ptp(drawn.points, axis=0).max(), output_type="ndarray")
    is_border = np.ones(len(border), dtype=bool)
    is_border[twins[owner[twins[:, 0]] == owner[twins[:, 1]]].ravel()] = False
    return np.asarray(border[is_border])


def _blocks(table: Any, group: int, block: int, function: Callable[[Array], Array]) -> Array:
    """Apply `function` to the blocks of a table, and join the results.  Blocks have shape (g, group, columns)."""
    step = max(group, block - block % group)
    blocks = (table[start : start + step] for start in range(0, len(table), step))
    return np.concatenate([function(rows.reshape(-1, group, *rows.shape[1:])) for rows in blocks])


def _picked(table: Any, numbers: Array, block: int) -> Array:
    """Return the rows `numbers` (ascending) of a table."""
    parts = []
    for start in range(0, len(table), block):
        first, last = np.searchsorted(numbers, (start, start + block))
        parts.append(table[start : start + block][numbers[first:last] - start])
    return np.concatenate(parts)


def drawn_displacement(state: Any, drawn: DrawnMesh) -> Array:
    """Return the displacements u of a state at the drawn nodes (p, 2).

    The solution leaves the translation open; here u* = u - E x has zero mean over the drawn triangles, with the
    macroscopic strain E and the positions x.
    """
    displacement = nodal_values(state["displacement"], drawn)
    loads = dict(zip(voigt.voigt_names(len(state.attrs["strain"]))[0], state.attrs["strain"], strict=True))
    shear = 0.5 * loads["gamma12"]
    x = drawn.points - drawn.points.min(axis=0)  # else a factor would move the picture of a cell far from the origin
    fluctuation = displacement - x @ np.array([[loads["E11"], shear], [shear, loads["E22"]]])
    means = fluctuation[drawn.triangles].mean(axis=1)
    return np.asarray(displacement - np.average(means, axis=0, weights=drawn.areas))


def largest_scale(displacement: Array, drawn: DrawnMesh) -> float:
    """Return the largest factor s of displacements u (p, 2) at which each triangle keeps LEAST_AREA of its area.

    For all s' up to s, det(I + s' grad u) = 1 + s' tr(grad u) + s'^2 det(grad u) >= LEAST_AREA in every drawn triangle.
    The result is infinite if every factor is possible.
    """
    sides, moves = _sides(drawn.points, drawn), _sides(displacement, drawn)
    area = _determinant(sides)
    trace = (_determinant(np.stack([moves[:, 0], sides[:, 1]], axis=1))
             + _determinant(np.stack([sides[:, 0], moves[:, 1]], axis=1))) / area  # fmt: skip
    rest = 1.0 - LEAST_AREA
    square = trace**2 - 4.0 * rest * _determinant(moves) / area
    # The least positive root s is 2 rest / (-trace + sqrt(square)), if that is real and positive.
    divisor = np.sqrt(np.maximum(square, 0.0)) - trace
    rate = float(np.where(square >= 0.0, divisor, 0.0).max(initial=0.0))
    return 2.0 * rest / rate if rate > 0.0 else np.inf


def _sides(values: Array, drawn: DrawnMesh) -> Array:
    """Return the differences (q, 2, 2) of nodal values (p, 2) along two sides of each triangle."""
    first, second, third = np.moveaxis(values[drawn.triangles], 1, 0)
    return np.stack([second - first, third - first], axis=1)


def _determinant(rows: Array) -> Array:
    """Return the determinants (q,) of matrices (q, 2, 2)."""
    return np.asarray(rows[:, 0, 0] * rows[:, 1, 1] - rows[:, 0, 1] * rows[:, 1, 0])
