"""Classes of nodes, edges of the torus and partners on opposite sides of meshes whose pairs are known."""

from dataclasses import dataclass

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from feti_homog.mesh.coarse_mesh import CoarseMesh, areas, paired_sides, representatives
from feti_homog.mesh.periodic_topology import Torus


@dataclass(frozen=True)
class PeriodicGrid:
    """A mesh of uneven columns and rows, its nodes and triangles in any order.

    Attributes:
        column, row: (n,) of each node; those on opposite sides are a pair.
    """

    mesh: CoarseMesh
    column: np.ndarray
    row: np.ndarray

    @property
    def columns(self):
        return self.column.max()

    @property
    def rows(self):
        return self.row.max()


@st.composite
def periodic_grids(draw):
    """Grids of 1 to 6 columns and rows, whose spacings are exact in binary."""
    spacings = st.lists(st.integers(1, 64).map(lambda n: n / 64), min_size=1, max_size=6)
    x, y = (np.cumsum([0.0, *draw(spacings)]) for _ in range(2))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    nodes = len(x) * len(y)
    place = rng.permutation(nodes).reshape(len(x), len(y))
    column, row = (np.empty(nodes, int) for _ in range(2))
    column[place], row[place] = np.arange(len(x))[:, None], np.arange(len(y))
    a, b, c, d = (part.ravel() for part in (place[:-1, :-1], place[1:, :-1], place[1:, 1:], place[:-1, 1:]))
    triangles = rng.permutation(np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]))
    points, width, height = np.stack([x[column], y[row]], axis=1), x[-1], y[-1]
    none, matrix = np.zeros((0, 2), np.int32), np.zeros(len(triangles), np.int32)
    mesh = CoarseMesh(
        width, height, points, triangles.astype(np.int32), matrix, ("matrix",), matrix,
        representatives(points, width, height), np.zeros((0, 3)), none, np.zeros(0, np.int32), none,
    )  # fmt: skip
    return PeriodicGrid(mesh, column, row)


def same_parts(one, other):
    """Return whether two labellings divide things into the same parts."""
    pairs = np.unique(np.stack([one, other]), axis=1).shape[1]
    return pairs == len(np.unique(one)) == len(np.unique(other))


@given(periodic_grids())
def test_nodes_that_differ_by_a_period_are_one_class(grid):
    made = grid.column % grid.columns * grid.rows + grid.row % grid.rows
    assert same_parts(Torus.of(grid.mesh).node_class, made)


@given(periodic_grids())
def test_a_class_is_represented_by_its_node_off_the_far_sides(grid):
    representative = grid.mesh.representative
    assert (representative[representative] == representative).all()
    assert (grid.column[representative] == grid.column % grid.columns).all()
    assert (grid.row[representative] == grid.row % grid.rows).all()


@given(periodic_grids())
def test_edges_that_differ_by_a_period_are_one_torus_edge(grid):
    torus = Torus.of(grid.mesh)
    assert areas(grid.mesh.points, grid.mesh.triangles).min() > 0
    column, row = (table[torus.edges].min(axis=1) for table in (grid.column, grid.row))
    across, up = (np.ptp(table[torus.edges], axis=1) for table in (grid.column, grid.row))
    made = np.stack([column % grid.columns, row % grid.rows, across, up])
    assert same_parts(torus.torus_edge, np.unique(made, axis=1, return_inverse=True)[1].ravel())
    # Every edge of a torus has a triangle on either side.
    assert (np.bincount(torus.triangle_torus_edges.ravel()) == 2).all()
    nodes, edges, triangles = torus.node_class.max() + 1, torus.torus_edge.max() + 1, len(grid.mesh.triangles)
    assert nodes - edges + triangles == 0


PERIOD = np.array([2.0, 3.0])


def random_sides(rng, count):
    """Points inside and on the sides of the cell, corners among them, in any order; the same on opposite sides."""
    low_x, low_y = np.r_[0.0, np.sort(rng.random(count)), 1.0] * 3.0, rng.random(count) * 2.0
    points = np.concatenate(
        [
            rng.random((count, 2)) * PERIOD,
            np.column_stack([np.zeros_like(low_x), low_x]),
            np.column_stack([np.full_like(low_x, 2.0), low_x]),
            np.column_stack([low_y, np.zeros_like(low_y)]),
            np.column_stack([low_y, np.full_like(low_y, 3.0)]),
        ]
    )
    return points[rng.permutation(len(points))]


def test_partners_differ_by_a_period_and_every_point_of_a_side_has_one():
    rng = np.random.default_rng(0)
    for count in (0, 1, 7, 40):
        points = random_sides(rng, count)
        for axis, low, high in paired_sides(points, PERIOD):
            assert len(low) == count + 2
            np.testing.assert_array_equal(points[high] - points[low], np.tile(np.eye(2)[axis] * PERIOD, (count + 2, 1)))
            assert (np.diff(points[low, 1 - axis]) > 0).all()
            assert set(low) == set(np.flatnonzero(points[:, axis] == 0))
            assert set(high) == set(np.flatnonzero(points[:, axis] == PERIOD[axis]))
