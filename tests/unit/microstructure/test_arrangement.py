"""Arrange fibres of one or several phases; compare gaps with brute force over all pairs and images."""

from itertools import product

import numpy as np
import pytest
from support.circular_cells import cell
from support.generated_meshes import generate

from feti_homog.case.cell_section import Cell
from feti_homog.case.cell_sizes import fibre_counts
from feti_homog.errors import MeshError
from feti_homog.mesh.arrange import arrange, random_arrangement
from feti_homog.mesh.fill.element_estimate import ElementEstimate
from feti_homog.mesh.fill.gmsh_mesher import arrangement_scale
from feti_homog.microstructure.arrangements import Arrangement, clear_shift, clearance, neighbours


def smallest_gap(arrangement):
    """Over all pairs of discs and 25 images of each, a disc and its own images included."""
    size = np.array([arrangement.width, arrangement.height])
    gaps = []
    for step in product(range(-2, 3), repeat=2):
        offset = arrangement.centres[:, None] - arrangement.centres - np.array(step) * size
        gap = np.linalg.norm(offset, axis=2) - arrangement.radii[:, None] - arrangement.radii
        gaps.append(gap[~np.eye(len(gap), dtype=bool)] if step == (0, 0) else gap.ravel())
    return np.concatenate(gaps).min()


def fraction(arrangement):
    return np.pi * np.sum(arrangement.radii**2) / (arrangement.width * arrangement.height)


RANDOM = [
    (0.65, 100, 0.03, 0.0),
    (0.65, 100, 0.06, 0.0),
    (0.60, 1000, 0.03, 0.0),
    (0.50, 64, 0.2, 0.0),
    (0.50, 256, 0.2, 0.0),
    (0.60, 100, 0.03, 0.5),
    (0.30, 30, 0.005, 0.9),
    (0.50, 16, 0.06, 0.0),
    (0.50, 1, 0.06, 0.0),
    (0.60, 2, 0.06, 0.0),
    (0.50, 3, 0.0, 0.2),
]


@pytest.mark.slow
@pytest.mark.parametrize(("share", "fibres", "gap", "spread"), RANDOM)
def test_random_keeps_fraction_and_gap_and_is_found_in_few_steps(share, fibres, gap, spread):
    case = cell(fraction=share, fibres=fibres, gap=gap, spread=spread)
    result = arrange(case)
    soon = random_arrangement(case, max_steps=199, max_attempts=1)
    assert np.array_equal(result.centres, soon.centres)
    assert fraction(result) == pytest.approx(share, abs=1e-14)
    assert smallest_gap(result) >= gap * 2 * result.radii.mean() * (1 - 1e-12)
    assert np.all((result.centres >= 0) & (result.centres < 1)) and len(result.radii) == fibres
    assert np.ptp(result.radii) <= 2 * spread * result.radii.mean() * 1.2


@pytest.mark.parametrize("seed", range(8))
def test_dense_arrangement_is_found_whatever_the_seed(seed):
    result = arrange(cell(fraction=0.65, fibres=50, gap=0.06, seed=seed))
    assert smallest_gap(result) >= 0.12 * result.radii[0] * (1 - 1e-12)


def test_same_seed_same_numbers_other_seed_others():
    first, again, other = (arrange(cell(seed=seed, spread=0.3)) for seed in (7, 7, 8))
    assert np.array_equal(first.centres, again.centres) and np.array_equal(first.radii, again.radii)
    assert not np.allclose(first.centres, other.centres)


def test_spread_is_the_half_width_of_the_radii():
    radii = arrange(cell(fraction=0.2, fibres=400, spread=0.4)).radii
    middle = (radii.min() + radii.max()) / 2
    assert np.ptp(radii) / 2 / middle == pytest.approx(0.4, abs=0.02)
    assert radii.std() / radii.mean() == pytest.approx(0.4 / np.sqrt(3), rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "fibres", "gap"), [(0.85, 100, 0.05), (0.8, 10, 0.03), (0.5, 20, 0.6)])
def test_impossible_arrangement_names_the_keys(share, fibres, gap):
    with pytest.raises(MeshError, match=r"\[cell\] fibre_fraction = .* with min_gap = .* at most about 0\.\d\d"):
        arrange(cell(fraction=share, fibres=fibres, gap=gap))


@pytest.mark.parametrize(("geometry", "count", "height"), [("square", 1, 1.0), ("hexagonal", 2, np.sqrt(3))])
@pytest.mark.parametrize("share", [0.001, 0.4, 0.78])
def test_lattices_have_the_fraction_that_is_asked_for(geometry, count, height, share):
    result = arrange(cell(geometry, share))
    assert (result.width, result.height, len(result.radii)) == (1.0, height, count)
    assert fraction(result) == pytest.approx(share, abs=1e-14)
    assert smallest_gap(result) == pytest.approx(1 - 2 * result.radii[0])


@pytest.mark.parametrize(("geometry", "limit"), [("square", 0.7854), ("hexagonal", 0.9069)])
def test_touching_lattices_are_refused(geometry, limit):
    with pytest.raises(MeshError, match=rf"\[cell\] fibre_fraction = 0.95.*{limit}"):
        arrange(cell(geometry, 0.95))


def test_neighbours_are_all_pairs_of_images():
    size, reach = np.array([1.0, 1.5]), 0.4
    centres = np.random.default_rng(3).random((12, 2)) * size
    first, second, vector = neighbours(centres, size, reach)
    expected = set()
    for i, j in product(range(12), repeat=2):
        for step in product((-1, 0, 1), repeat=2):
            away = centres[j] + np.array(step) * size - centres[i]
            if i < j and np.linalg.norm(away) < reach:
                expected.add((i, j, *np.round(away, 9)))
    assert {(i, j, *np.round(away, 9)) for i, j, away in zip(first, second, vector, strict=True)} == expected


def test_shift_clears_tangency_and_keeps_the_arrangement():
    before = Arrangement.of_discs(1.0, 1.0, np.array([[0.2, 0.5], [0.7001, 0.2]]), np.array([0.2, 0.2]), ("fibre",) * 2)
    after = clear_shift(before)
    assert smallest_gap(after) == pytest.approx(smallest_gap(before))
    for axis in (0, 1):
        distance = np.abs((after.centres[:, axis] + 0.5) % 1 - 0.5)
        assert np.abs(distance - after.radii).min() > 0.04


@pytest.mark.parametrize("height", [0.2, 1.0, 5.0])
@pytest.mark.parametrize("gap", [0.01, 0.03])
def test_clearance_is_a_distance_along_either_axis(height, gap):
    """Both in the cell and in the cell turned by 90 degrees."""
    y, radius = height - 0.05 - gap, 0.05
    upright = Arrangement.of_discs(1.0, height, np.array([[0.5, y]]), np.array([radius]), ("fibre",))
    turned = Arrangement.of_discs(height, 1.0, np.array([[y, 0.5]]), np.array([radius]), ("fibre",))
    assert clearance(upright) == pytest.approx(gap) == clearance(turned)


MIX = {"glass": 0.3, "carbon": 0.25}
RADII = {"glass": 6.0, "carbon": 3.5}


def cell_of(**keys) -> Cell:
    return Cell(**{"geometry": "random", "mix": MIX, "seed": 3, "mesh_size": 0.1} | keys)


def shares(arrangement) -> dict[str, float]:
    area = np.pi * arrangement.radii**2
    return {name: area[np.array(arrangement.phase) == name].sum() for name in arrangement.phases[1:]}


@pytest.mark.parametrize(
    "keys",
    [
        {"fibres": 20},
        {"fibres": 25, "radii": RADII},
        {"width": 70.0, "radii": RADII},
        {"fibres": 12, "radius_spread": 0.3},
    ],
)
def test_each_phase_has_its_fraction_and_gaps_are_kept(keys):
    cell = cell_of(**keys)
    found = arrange(cell)
    assert shares(found) == pytest.approx(MIX, abs=1e-14)
    assert {name: found.phase.count(name) for name in MIX} == fibre_counts(cell)
    assert smallest_gap(found) >= cell.min_gap * 2 * found.radii.mean() * (1 - 1e-12)
    assert ElementEstimate.of(cell, None).fibres == len(found.radii)
    assert ElementEstimate.of(cell, None).mean_radius == pytest.approx(np.sqrt((found.radii**2).mean()), rel=1e-12)


@pytest.mark.parametrize("size", [{"fibres": 60}, {"width": 100.0}])
def test_radii_are_those_asked_for_within_half_a_fibre(size):
    cell = cell_of(radii=RADII, **size)
    found = arrange(cell)
    radii = arrangement_scale(cell, found) * found.radii
    for name, count in fibre_counts(cell).items():
        own = radii[np.array(found.phase) == name]
        assert np.ptp(own) < 1e-12 * own[0]
        assert own[0] / RADII[name] == pytest.approx(1.0, abs=0.5 / count)


def test_coatings_are_those_of_each_fibre():
    found = arrange(cell_of(fibres=12, radii=RADII, coating=0.1))
    assert found.coating == pytest.approx(0.1 * found.radii)
    assert found.phases == ("matrix", "carbon", "glass", "coating")


def test_a_mix_of_one_phase_is_the_cell_of_that_fraction():
    plain = arrange(Cell(geometry="random", fibre_fraction=0.5, fibres=15, radius_spread=0.3, seed=5))
    named = arrange(cell_of(mix={"glass": 0.5}, fibres=15, radius_spread=0.3, seed=5))
    assert np.array_equal(plain.centres, named.centres) and np.array_equal(plain.radii, named.radii)
    assert set(named.phase) == {"glass"}


def test_the_mesh_has_the_areas_of_each_phase():
    mesh = generate(cell_of(fibres=9, radii=RADII, mesh_size=0.02))
    corners = mesh.points[mesh.triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = np.bincount(mesh.phase, (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2)
    found = dict(zip(mesh.phases, areas / areas.sum(), strict=True))
    assert found == pytest.approx(MIX | {"matrix": 0.45}, rel=0.02)


def test_what_cannot_be_arranged_names_the_mix():
    with pytest.raises(
        MeshError, match=r"^\[cell\] mix = \{glass = 0.6, carbon = 0.3\} with min_gap = 0.05 and fibres"
    ):
        arrange(cell_of(mix={"glass": 0.6, "carbon": 0.3}, fibres=9))
    with pytest.raises(MeshError, match=r"^\[cell\] mix = \{glass = 1e-14\}: a fibre has a radius of"):
        generate(cell_of(mix={"glass": 1e-14}, fibres=1))
