"""Statistics of random patterns: laws, invariances, brute force and means over many of them."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from pattern_statistics import envelope, measure, pair_directions, pair_functions, poisson, smallest_gap, voronoi_cells
from support.fibre_patterns import pattern, poisson_points, square_lattice

from feti_homog.microstructure.random_fibres import nearest_neighbours

r = np.linspace(0.1, 4.0, 40)
both = pytest.mark.parametrize("periodic", [True, False])


def every_distance(points, side):
    """(N, 25 N) distances to all images."""
    shifts = np.array(list(product(range(-2, 3), repeat=2))) * side
    images = (points + shifts[:, None]).reshape(-1, 2)
    return np.linalg.norm(points[:, None] - images, axis=2)


@pytest.mark.parametrize("count", [2, 3, 40])
def test_periodic_distances_are_those_of_all_images(count):
    points = poisson_points(count)
    everywhere = np.sort(every_distance(points.centres, 10.0), axis=1)
    assert nearest_neighbours(points).distances == pytest.approx(everywhere[:, 1:4])
    within = np.count_nonzero(everywhere[:, 1:, None] <= r, axis=(0, 1))
    assert pair_functions(points, r).ripley_k == pytest.approx(100 / (count * (count - 1)) * within)


def test_window_weighs_pairs_by_the_places_where_they_fit():
    points = poisson_points(20, periodic=False)
    away = np.abs(points.centres[:, None] - points.centres)
    weight = 100 / ((10 - away[..., 0]) * (10 - away[..., 1]))
    near = (np.linalg.norm(away, axis=2)[..., None] <= r) & ~np.eye(20, dtype=bool)[..., None]
    assert pair_functions(points, r).ripley_k == pytest.approx(100 / 380 * (near * weight[..., None]).sum(axis=(0, 1)))


@both
def test_K_of_random_points_is_that_of_complete_spatial_randomness(periodic):
    """The mean over 200 patterns, within four standard errors."""
    found = np.array([pair_functions(poisson_points(60, 10.0, s, periodic), r).ripley_k for s in range(200)])
    error = found.std(axis=0) / np.sqrt(len(found))
    assert np.all(np.abs(found.mean(axis=0) - np.pi * r**2) < 4 * error + 1e-12)
    directions = np.array([pair_directions(poisson_points(60, 10.0, s, periodic), 3.0) for s in range(200)])
    assert directions.mean(axis=0) == pytest.approx(1.0, abs=4 * directions.std() / np.sqrt(200))


def test_weights_of_a_window_keep_nearest_distances_unbiased():
    """The mean nearest distance of Poisson points is 1 / (2 sqrt(density)); without weights it is less."""
    windows = [poisson_points(100, 10.0, seed, periodic=False) for seed in range(200)]
    found = [nearest_neighbours(window, 1) for window in windows]
    means = np.array([neighbours.means[0] for neighbours in found])
    assert means.mean() == pytest.approx(0.5, abs=4 * means.std() / np.sqrt(200))
    counted = np.array([n.distances[n.weights > 0].mean() for n in found])
    assert counted.mean() < 0.5 - 8 * counted.std() / np.sqrt(200)


@both
def test_voronoi_areas_fill_the_rectangle_and_their_fractions_the_fibres(periodic):
    points = replace(poisson_points(200, periodic=periodic), radii=np.linspace(0.05, 0.3, 200))
    cells = voronoi_cells(points)
    assert cells.areas.sum() == pytest.approx(100.0, rel=1e-9)
    assert cells.areas @ cells.fractions / 100 == pytest.approx(points.fibre_fraction, rel=1e-9)
    places = np.random.default_rng(5).random((10_000, 2)) * 10
    away = np.abs(places[:, None] - points.centres[:20])
    shortest = np.linalg.norm(np.minimum(away, 10 - away) if periodic else away, axis=2)
    away = np.abs(places[:, None] - points.centres[20:])
    others = np.linalg.norm(np.minimum(away, 10 - away) if periodic else away, axis=2).min(axis=1)
    nearest = np.where(shortest.min(axis=1) < others, shortest.argmin(axis=1), 20)
    thrown = np.bincount(nearest, minlength=21)[:20] / 100
    assert cells.areas[:20] == pytest.approx(thrown, abs=5 * np.sqrt(cells.areas.max() / 100))


def test_cells_called_whole_stay_as_they_are_whatever_is_outside():
    window = poisson_points(80, periodic=False, seed=3)
    cells = voronoi_cells(window)
    for seed in range(5):
        around = np.random.default_rng(seed).random((700, 2)) * 30 - 10
        around = around[np.any((around < 0) | (around > 10), axis=1)]
        larger = voronoi_cells(pattern(np.concatenate([window.centres, around]) + 10, 30.0, 0.2, False))
        assert larger.areas[:80][cells.whole] == pytest.approx(cells.areas[cells.whole])
    assert 30 < np.count_nonzero(cells.whole) < 80


@pytest.mark.slow
def test_weights_of_a_window_keep_voronoi_areas_unbiased():
    """The mean area of cells is 1 / density; of those that are whole, without weights, it is less."""
    cells = [voronoi_cells(poisson_points(100, 10.0, seed, periodic=False)) for seed in range(200)]
    means = np.array([each.weights @ each.areas for each in cells])
    plain = np.array([each.areas[each.whole].mean() for each in cells])
    assert means.mean() == pytest.approx(1.0, abs=4 * means.std() / np.sqrt(200))
    assert plain.mean() < 1.0 - 8 * plain.std() / np.sqrt(200)
    assert cells[0].mean_fraction == pytest.approx(cells[0].weights @ cells[0].fractions)


@both
def test_all_is_the_same_in_other_units(periodic):
    points = poisson_points(50, periodic=periodic)
    large = replace(points, width=70.0, height=70.0, centres=7 * points.centres, radii=7 * points.radii)
    one, other = measure(points, poisson, 9), measure(large, poisson, 9)
    assert other.pairs.ripley_k == pytest.approx(49 * one.pairs.ripley_k) and other.pairs.radial == pytest.approx(
        one.pairs.radial
    )
    assert other.neighbours.distances == pytest.approx(7 * one.neighbours.distances)
    assert other.cells.fractions == pytest.approx(one.cells.fractions)
    assert other.random.p_value == one.random.p_value
    assert other.pattern.fibre_fraction == pytest.approx(50 * np.pi * 0.04 / 100)


def test_periodic_statistics_do_not_know_where_the_cell_begins():
    points = poisson_points(60)
    moved = replace(points, centres=points.centres + np.array([3.7, -12.1]))
    one, other = measure(points, poisson, 3), measure(moved, poisson, 3)
    assert other.pairs.ripley_k == pytest.approx(one.pairs.ripley_k)
    assert other.neighbours.distances == pytest.approx(one.neighbours.distances)
    assert other.neighbours.directions == pytest.approx(one.neighbours.directions)
    assert other.cells.areas == pytest.approx(one.cells.areas)
    assert other.directions == pytest.approx(one.directions)


@both
def test_smallest_gap_is_that_of_all_pairs(periodic):
    points = replace(poisson_points(12, periodic=periodic), radii=np.linspace(0.05, 0.9, 12))
    shifts = np.array(list(product(range(-2, 3), repeat=2))) * 10.0 * periodic
    away = np.linalg.norm(points.centres[:, None] - points.centres - shifts[:, None, None], axis=3)
    away[:, np.arange(12), np.arange(12)] += np.where(away[:, np.arange(12), np.arange(12)] < 1e-9, np.inf, 0)
    assert smallest_gap(points) == pytest.approx((away - points.radii[:, None] - points.radii).min())
    one = replace(points, centres=points.centres[:1], radii=points.radii[:1])
    assert smallest_gap(one) == pytest.approx(9.9 if periodic else np.inf)


def test_quantiles_are_those_of_the_weighted_distances():
    neighbours = nearest_neighbours(poisson_points(40))
    levels = (np.arange(40) + 0.5) / 40
    assert neighbours.quantiles(levels, 0) == pytest.approx(np.sort(neighbours.distances[:, 0]))
    two = nearest_neighbours(poisson_points(2, periodic=False), 2)
    with pytest.raises(ValueError, match="no distance counts"):
        two.quantiles(levels, 1)


def test_random_points_pass_and_lattices_fail_the_test_of_randomness():
    """p-values of 60 Poisson patterns are even: below 0.2 about a fifth of them (binomial, four deviations)."""
    found = []
    for seed in range(60):
        points = poisson_points(30, seed=seed)
        found.append(envelope(points, lambda p: pair_functions(p, r).ripley_l, poisson, 19, seed).p_value)
    assert 12 - 4 * np.sqrt(60 * 0.16) < np.count_nonzero(np.array(found) <= 0.2) < 12 + 4 * np.sqrt(60 * 0.16)
    lattice = square_lattice()
    grid = np.linspace(0.1, 3.9, 30)
    assert envelope(lattice, lambda p: pair_functions(p, grid).ripley_l, poisson, 39).p_value == 1 / 40


def test_envelope_is_of_the_simulations():
    points = poisson_points(30)
    values = iter(np.arange(5.0))
    found = envelope(points, lambda p: np.array([next(values), 1.0]), poisson, 4)
    assert (found.low[0], found.high[0], found.mean[0]) == (1.0, 4.0, 2.5)
    assert found.p_value == 2 / 5  # of 0, 1, 2, 3, 4 the first and the last are farthest from 2
