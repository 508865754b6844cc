"""Random cells that match a table: their distances, radii, hard cores; the keys of the case and their faults."""

from dataclasses import replace

import numpy as np
import pytest
from pattern_statistics import smallest_gap
from scipy.stats import ks_2samp
from support.base_case import BASE
from support.fibre_patterns import hexagonal_lattice, poisson_points
from support.measured_fibres import clustered_table

from feti_homog.case import cases
from feti_homog.case.cell_section import Cell
from feti_homog.errors import CaseError
from feti_homog.mesh.arrange import arrange
from feti_homog.microstructure.fibre_pattern import FibrePattern, read_window
from feti_homog.microstructure.random_fibres import (
    match_distance,
    matched,
    nearest_neighbours,
    wanted_distances,
)


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    return clustered_table(tmp_path_factory.mktemp("table") / "fibres.csv")


def cell(table=None, **keys):
    window = None if table is None else read_window(table)
    given = {"match": table, "matched": window, "fibres": 40, "fibre_fraction": 0.2, "min_gap": 0.01}
    return Cell(geometry="random", **given | keys)


def pattern_of(arrangement):
    return FibrePattern(1.0, 1.0, arrangement.centres, arrangement.radii, periodic=True)


def distance(table, arrangement):
    return match_distance(pattern_of(arrangement), wanted_distances(read_window(table), len(arrangement.radii)))


@pytest.mark.parametrize("seed", range(3))
def test_distances_become_those_of_the_table(table, seed):
    found, other = arrange(cell(table, seed=seed)), arrange(cell(seed=seed))
    assert distance(table, found) < 0.02 < 0.08 < distance(table, other)
    window, pattern = read_window(table), pattern_of(found)
    near, own = nearest_neighbours(window), nearest_neighbours(pattern)
    for k in range(2):
        counted = near.distances[near.weights[:, k] > 0, k] / window.mean_radius
        assert ks_2samp(own.distances[:, k] / pattern.mean_radius, counted).pvalue > 0.05
    assert ks_2samp(nearest_neighbours(pattern_of(other)).distances[:, 0] / other.radii.mean(), counted).pvalue < 1e-3


def test_fraction_gap_and_radii_are_kept(table):
    found, window = arrange(cell(table, min_gap=0.04, fibres=60)), read_window(table)
    pattern = pattern_of(found)
    assert pattern.fibre_fraction == pytest.approx(0.2, abs=1e-14)
    assert smallest_gap(pattern) >= 0.04 * 2 * pattern.mean_radius * (1 - 1e-9)
    ratio = np.sort(found.radii) / np.sort(window.radii)
    assert ratio == pytest.approx(ratio[0], rel=0.01)
    assert np.all((found.centres >= 0) & (found.centres < 1))


def test_coatings_keep_their_gap_and_fibres_their_distances(table):
    found = arrange(cell(table, coating=0.1))
    assert found.coating == pytest.approx(0.1 * found.radii)
    assert pattern_of(found).fibre_fraction == pytest.approx(0.2, abs=1e-14)
    rings = replace(pattern_of(found), radii=found.outer_radii)
    assert smallest_gap(rings) >= 0.01 * 2 * found.radii.mean() * (1 - 1e-9)
    assert distance(table, found) < 0.02 < 0.08 < distance(table, arrange(cell(coating=0.1)))


def test_same_seed_same_cell_other_seed_another(table):
    first, again, other = (arrange(cell(table, seed=seed)) for seed in (3, 3, 4))
    assert np.array_equal(first.centres, again.centres) and np.array_equal(first.radii, again.radii)
    assert not np.allclose(first.centres, other.centres)


def test_distance_is_that_of_sorted_distances():
    """Zero to itself; of lattices the difference of their one distance; the same in other units."""
    points, lattice = poisson_points(30), hexagonal_lattice(4)
    wanted = wanted_distances(points, 30)
    assert match_distance(points, wanted) == pytest.approx(0, abs=1e-12)
    wide = replace(lattice, width=2 * lattice.width, height=2 * lattice.height, centres=2 * lattice.centres)
    wanted = wanted_distances(wide, lattice.count)
    assert match_distance(lattice, wanted) == pytest.approx(1 / 0.6)
    large = replace(points, width=50.0, height=50.0, centres=5 * points.centres, radii=5 * points.radii)
    assert match_distance(large, wanted[:1] * np.ones((30, 2))) == pytest.approx(
        match_distance(points, wanted[:1] * np.ones((30, 2)))
    )


def test_moves_never_take_the_distributions_apart(table):
    """After any number of moves: with other numbers of fibres the walk ends elsewhere, and no farther away."""
    start = pattern_of(arrange(cell(fibres=20)))
    wanted = wanted_distances(read_window(table), 20)
    centres = matched(start, 0.0, wanted, np.random.default_rng(0))
    end = replace(start, centres=centres)
    assert match_distance(end, wanted) < 0.3 * match_distance(start, wanted)
    assert np.array_equal(matched(end, 0.0, wanted_distances(end, 20), np.random.default_rng(0)), end.wrapped)


def text(words):
    return BASE.replace('geometry = "hexagonal"\nfibre_fraction = 0.4\n', f'geometry = "random"\n{words}\n')


def load(folder, words):
    (folder / "case.toml").write_text(text(words))
    return cases.load(folder / "case.toml")


def test_number_and_fraction_are_those_of_the_table_unless_given(tmp_path):
    window = read_window(clustered_table(tmp_path / "f.csv", 50))
    case = load(tmp_path, 'match = "f.csv"')
    assert (case.cell.fibres, case.cell.fibre_fraction) == (50, window.fibre_fraction)
    assert case.cell.match == tmp_path / "f.csv" and cases.parse(case.resolved(), tmp_path) == case
    given = load(tmp_path, 'match = "f.csv"\nfibres = 12\nfibre_fraction = 0.25')
    assert (given.cell.fibres, given.cell.fibre_fraction) == (12, 0.25)
    digest = given.digest()
    clustered_table(tmp_path / "f.csv", 50, seed=5)
    assert load(tmp_path, 'match = "f.csv"\nfibres = 12\nfibre_fraction = 0.25').digest() != digest


FAULTY = {
    'match = "g.csv"': r'\[cell\] match = "g.csv": no such file \(expected at .*g.csv\)',
    "match = 3": r"\[cell\] match = 3: expected the name of a .csv file",
    'match = "f.csv"\nfibres = 9': r"\[cell\] fibres = 9: expected at least 10 with match",
    'match = "f.csv"\nradius_spread = 0.1': r"\[cell\] match, radius_spread: exclude each other",
    'match = "f.csv"\nfibre_fraction = 0.95': r"\[cell\] fibre_fraction = 0.95: expected less than",
    'match = "bad.csv"': r"\[cell\] match: bad.csv: row 3: its centre is outside of the window of 1 x 1",
    'match = "small.csv"': r'\[cell\] match = "small.csv": the window is too small',
}


@pytest.mark.parametrize("words", FAULTY)
def test_faults(tmp_path, words):
    clustered_table(tmp_path / "f.csv", 50)
    (tmp_path / "bad.csv").write_text("# width = 1, height = 1\nx,y,radius\n2,0.5,0.1\n")
    rows = [f"{k},{k % 2},0.1" for k in range(10)]
    (tmp_path / "small.csv").write_text("\n".join(["# width = 9, height = 1", "x,y,radius", *rows]))
    with pytest.raises(CaseError, match=FAULTY[words]) as error:
        load(tmp_path, words)
    assert len(error.value.faults) == (2 if words == 'match = "bad.csv"' else 1)


def test_match_is_for_random_cells(tmp_path):
    clustered_table(tmp_path / "f.csv", 50)
    (tmp_path / "case.toml").write_text(BASE.replace("[cell]", '[cell]\nmatch = "f.csv"'))
    with pytest.raises(CaseError, match=r'match = "f.csv": belongs to geometry = "random", not "hexagonal"'):
        cases.load(tmp_path / "case.toml")
