"""Statistics of lattices, which are known exactly."""

import numpy as np
import pytest
from pattern_statistics import SECTORS, distances, pair_directions, pair_functions, voronoi_cells
from support.fibre_patterns import hexagonal_lattice, square_lattice

from feti_homog.microstructure.random_fibres import nearest_neighbours

SQUARE = [(1.0, 4), (np.sqrt(2), 4), (2.0, 4), (np.sqrt(5), 8), (np.sqrt(8), 4), (3.0, 4), (np.sqrt(10), 8)]
HEXAGONAL = [(1.0, 6), (np.sqrt(3), 6), (2.0, 6), (np.sqrt(7), 12), (3.0, 6)]
LATTICES = [(square_lattice(), SQUARE, 1.0), (hexagonal_lattice(), HEXAGONAL, np.sqrt(3) / 2)]
IDS = ["square", "hexagonal"]
r = np.linspace(0, 3.2, 54)[1:]  # no distance of either lattice


@pytest.mark.parametrize(("lattice", "shells", "cell"), LATTICES, ids=IDS)
def test_K_counts_the_shells_and_g_is_their_rings(lattice, shells, cell):
    found = pair_functions(lattice, r)
    correction = lattice.count / (lattice.count - 1)
    counted = sum(number * (r > radius) for radius, number in shells)
    assert found.ripley_k == pytest.approx(cell * correction * counted, abs=1e-12)
    rings = np.diff(np.pi * r**2, prepend=0.0)
    assert found.radial == pytest.approx(cell * correction * np.diff(counted, prepend=0) / rings, abs=1e-12)
    assert np.pi * found.ripley_l**2 == pytest.approx(found.ripley_k)


@pytest.mark.parametrize(("lattice", "shells", "cell"), LATTICES, ids=IDS)
def test_voronoi_cells_are_those_of_the_lattice(lattice, shells, cell):
    found = voronoi_cells(lattice)
    assert found.areas == pytest.approx(cell, rel=1e-12)
    assert found.fractions == pytest.approx(np.pi * 0.3**2 / cell, rel=1e-12)
    assert found.whole.all()


def test_nearest_neighbours_of_lattices():
    square, hexagonal = nearest_neighbours(square_lattice(), 5), nearest_neighbours(hexagonal_lattice(), 7)
    assert square.means == pytest.approx([1, 1, 1, 1, np.sqrt(2)])
    assert hexagonal.means == pytest.approx([1] * 6 + [np.sqrt(3)])
    assert hexagonal.deviations == pytest.approx(0, abs=1e-7)
    away = np.abs(hexagonal.directions[:, :6, None] - np.arange(0, 361, 60)).min(axis=2)
    assert away.max() < 1e-6


@pytest.mark.parametrize(("lattice", "every"), [(square_lattice(), 6), (hexagonal_lattice(), 4)], ids=IDS)
def test_pairs_of_lattices_have_their_directions(lattice, every):
    shares = pair_directions(lattice, 1.3)
    assert shares == pytest.approx(np.where(np.arange(SECTORS) % every == 0, every, 0))


def test_one_fibre_has_its_images_as_neighbours():
    one = square_lattice(1)
    found = nearest_neighbours(one, 5)
    assert found.distances[0] == pytest.approx([1, 1, 1, 1, np.sqrt(2)])
    assert np.sort(found.directions[0, :4]) == pytest.approx([0, 90, 180, 270], abs=1e-9)
    assert voronoi_cells(one).areas == pytest.approx(1.0)


def test_narrow_cell_has_images_beyond_the_next():
    narrow = square_lattice(1)
    narrow = type(narrow)(1.0, 30.0, narrow.centres, narrow.radii, True)
    assert nearest_neighbours(narrow, 6).distances[0] == pytest.approx([1, 1, 2, 2, 3, 3])
    assert voronoi_cells(narrow).areas == pytest.approx(30.0)


def test_window_of_a_lattice():
    """Cells at the sides are cut by them; here they are whole squares, which the window cannot detect."""
    window = square_lattice(6, periodic=False)
    cells, neighbours = voronoi_cells(window), nearest_neighbours(window, 1)
    inner = np.all((window.centres > 1) & (window.centres < 5), axis=1)
    assert cells.areas == pytest.approx(1.0, rel=1e-9) and np.array_equal(cells.whole, inner)
    assert np.array_equal(neighbours.weights[:, 0] > 0, inner)
    assert neighbours.means == pytest.approx([1.0])


def test_distances_reach_half_of_the_shorter_side():
    steps = distances(hexagonal_lattice(4))
    assert steps[-1] == pytest.approx(np.sqrt(3)) and np.ptp(np.diff(steps)) < 1e-12
    assert distances(square_lattice(40))[-1] == pytest.approx(10.0)
