"""Numbers of triangles before a cell is meshed, and edge lengths that grow from sources."""

import numpy as np
import pytest
from scipy.special import ellipe
from support.generated_meshes import generate
from unit.mesh.test_table_ellipses import cell_of, table

from feti_homog.errors import MeshError
from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.fill.element_estimate import ElementEstimate, refuse_many
from feti_homog.mesh.outline.graded_size import CHUNK, MAX_GROWTH, MeshSizes, SizeField, size_field
from feti_homog.microstructure.shapes.ellipses import Ellipses


@pytest.mark.parametrize("ratio", [1.5, 4.0, 16.0])
@pytest.mark.parametrize(("interface_size", "within"), [(None, 0.3), (0.005, 0.2)])
def test_estimates_are_near_the_numbers_of_meshes(ratio, interface_size, within):
    row = {"x": 0.5, "y": 0.5, "a": 0.45, "b": 0.45 / ratio, "angle": 20.0}
    cell = cell_of(table([row]), interface_size=interface_size)
    assert ElementEstimate.of(cell, arrange(cell)).triangles == pytest.approx(len(generate(cell).triangles), rel=within)


def test_perimeters_are_elliptic_integrals():
    b = np.array([1.0, 0.5, 0.1, 0.05])
    found = Ellipses.of(np.zeros((4, 2)), np.ones(4), b, np.array([0.0, 10.0, 200.0, 90.0])).perimeters
    assert found == pytest.approx(4 * ellipe(1 - b**2), rel=1e-4)


@pytest.mark.parametrize("coating", [0.0, 0.02])
def test_no_size_is_below_the_least(coating):
    rows = [{"x": 0.3, "y": 0.4, "radius": 0.25, "coating": coating}, {"x": 0.8, "y": 0.5, "radius": 0.2}]
    arrangement = arrange(cell_of(table(rows)))
    for sizes in (MeshSizes(0.1, 0.1, 0.1), MeshSizes(0.1, 0.03, 1e-3)):
        field = size_field(arrangement, sizes, np.zeros((1, 2)), np.array([[0.55, 0.4]]))
        places = np.random.default_rng(1).random((20_000, 2)) * arrangement.size
        # Tips and narrow passages are points.
        assert field.least <= field(places).min() < 10 * field.least
        refuse_many(lambda _: pytest.fail("sizes are summed"), field.least, arrangement.size, 10**9)
        with pytest.raises(MeshError, match="elements before refine"):
            refuse_many(field, field.least, arrangement.size, 100)


SIZE = np.array([1.0, 0.8])
LARGEST = 0.04


def sources(count, seed=1):
    """Return some of any length and growth, near enough to each other that several matter everywhere."""
    rng = np.random.default_rng(seed)
    return rng.random((count, 2)) * SIZE, 0.05 * rng.random(count), MAX_GROWTH * rng.random(count)


def brute_force(some, points):
    """Return the formula, with every source within its reach."""
    places, lengths, growths = some
    way = points[:, None] - places
    away = np.sqrt(((way - SIZE * np.round(way / SIZE)) ** 2).sum(axis=2))
    sizes = np.where(away < LARGEST / MAX_GROWTH, lengths + growths * away, LARGEST)
    return np.minimum(LARGEST, sizes.min(axis=1))


@pytest.mark.parametrize("count", [1, 20, 150])
def test_sizes_are_those_of_the_formula(count):
    """In several parts."""
    some = sources(count)
    points = 2 * np.random.default_rng(2).random((500, 2)) - 0.5
    expected = brute_force(some, points)
    assert expected.min() < 0.9 * LARGEST or count == 1
    parts = CHUNK // len(points) + 1
    found = SizeField([some], SIZE, LARGEST)(np.tile(points, (parts, 1)))
    np.testing.assert_allclose(found, np.tile(expected, parts), rtol=1e-13)
