"""Meshes that are finer on interfaces and at tips.

Sizes as asked for, bounded growth, no more elements than that takes.

That they are meshes at all, periodic and of good triangles, `test_gmsh_mesher.py` holds for them too.
"""

from dataclasses import replace

import numpy as np
import pytest
from support.circular_cells import cell
from support.generated_meshes import generate
from unit.mesh.fill.test_gmsh_mesher import least_angle

from feti_homog.errors import MeshError
from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.fill import element_estimate
from feti_homog.mesh.outline.graded_size import MAX_GROWTH, MIN_EDGES_AROUND

pytestmark = pytest.mark.slow

SQUARE, WIDE_GAPS = cell("square"), cell(fibres=9, fraction=0.35, gap=0.3, spread=0.4)
CROWDED = cell(fibres=20, fraction=0.6, gap=0.02)


def edge_lengths(mesh):
    """Return (a,) edges on the circles."""
    return np.linalg.norm(np.diff(mesh.points[mesh.arc_edges], axis=1)[:, 0], axis=1)


def sides(mesh):
    """(m, 3) lengths of the sides of triangles."""
    corners = mesh.points[mesh.triangles]
    return np.stack([np.linalg.norm(corners[:, i] - corners[:, i - 1], axis=1) for i in range(3)], axis=1)


def circle_distance(points, arrangement):
    """(n,) distances on the torus from the nearest circle."""
    offset = (points[:, None] - arrangement.centres + 0.5) % 1.0 - 0.5
    return np.abs(np.linalg.norm(offset, axis=2) - arrangement.radii).min(axis=1)


@pytest.mark.parametrize("case", [SQUARE, WIDE_GAPS], ids=["square", "random"])
@pytest.mark.parametrize(("size", "rounding"), [(0.02, 0.1), (0.01, 0.05), (0.002, 0.01)])
def test_edges_on_interfaces_are_as_long_as_asked(case, size, rounding):
    """But for the number of edges of an arc, which is rounded up."""
    lengths = edge_lengths(generate(replace(case, interface_size=size)))
    assert lengths.max() <= size and lengths.mean() > (1 - rounding) * size and lengths.min() > 0.8 * size


def test_narrow_passages_keep_their_own_size():
    plain, fine = (edge_lengths(generate(replace(CROWDED, interface_size=size))) for size in (None, 0.01))
    assert plain.max() > 0.012 > 0.01 >= fine.max() and 0.8 < fine.min() / plain.min() < 1.2


@pytest.mark.parametrize("case", [SQUARE, WIDE_GAPS], ids=["square", "random"])
@pytest.mark.parametrize("size", [0.01, 0.002])
def test_elements_grow_with_the_distance_from_the_interface(case, size):
    mesh = generate(replace(case, interface_size=size))
    away = circle_distance(mesh.points[mesh.triangles].mean(axis=1), arrange(case))
    asked = np.minimum(case.mesh_size, size + MAX_GROWTH * away)
    mean = sides(mesh).mean(axis=1)
    assert (mean < 1.5 * asked).all() and 0.8 < np.mean(mean / asked) < 1.05
    assert sides(mesh).max() < 1.5 * case.mesh_size


@pytest.mark.parametrize("fraction", [1e-4, 1e-6, 1e-9])
def test_elements_grow_from_tiny_fibres(fraction):
    """Between them, too, however far they are apart."""
    case = cell(fibres=4, fraction=fraction, gap=0.3)
    arrangement = arrange(case)
    mesh, size = generate(case), 2 * np.pi * arrangement.radii.max() / MIN_EDGES_AROUND
    away = circle_distance(mesh.points[mesh.triangles].mean(axis=1), arrangement)
    asked = np.minimum(case.mesh_size, size + MAX_GROWTH * away)
    assert 0.8 < np.mean(sides(mesh).mean(axis=1) / asked) < 1.2


def test_a_fine_interface_takes_elements_beside_it_only(case=SQUARE):
    """On both sides of a length P there are 2 P / (A g h) triangles, A = sqrt(3) / 4: not as many as 1 / h^2."""
    sizes = np.array([0.004, 0.002, 0.001])
    counts = np.array([len(generate(replace(case, interface_size=size)).triangles) for size in sizes])
    around = 2 * np.pi * arrange(case).radii.sum()
    expected = 2 * around / (np.sqrt(3) / 4 * MAX_GROWTH * sizes)
    assert np.all((counts > expected) & (counts < 1.6 * expected + 1 / (np.sqrt(3) / 4 * case.mesh_size**2)))
    assert np.all((counts[1:] / counts[:-1] > 1.6) & (counts[1:] / counts[:-1] < 2.1))


def test_the_size_of_the_mesh_asks_for_no_grading():
    plain, same = (generate(cell("square", interface_size=size)) for size in (None, 0.05))
    assert np.array_equal(plain.points, same.points) and np.array_equal(plain.triangles, same.triangles)


@pytest.mark.parametrize("geometry", ["square", "random"])
def test_what_would_take_hours_is_refused(geometry):
    with pytest.raises(
        MeshError, match=r"interface_size = 1e-05, fibres = 16: about .* elements before refine; expected at most"
    ):
        generate(cell(geometry, interface_size=1e-5))


MARKS = {0: (30.0, 150.0, 170.0), 1: (-170.0, 45.0), 4: (90.0,)}


def at_marks(mesh, arrangement, marks):
    """For each mark its place (2,) and the lengths of the edges on the circle that meet in its vertex on the torus."""
    lengths, size = edge_lengths(mesh), mesh.period
    for curve, own in marks.items():
        fibre, radii = (~curve, arrangement.radii) if curve < 0 else (curve, arrangement.outer_radii)
        for angle in np.radians(own):
            place = arrangement.centres[fibre] + radii[fibre] * np.array([np.cos(angle), np.sin(angle)])
            away = (mesh.points - place + size / 2) % size - size / 2
            vertex = np.argmin(np.linalg.norm(away, axis=1))
            assert np.linalg.norm(away[vertex]) < 1e-12
            same = np.flatnonzero(mesh.representative == mesh.representative[vertex])
            yield place, lengths[np.isin(mesh.arc_edges, same).any(axis=1)]


@pytest.mark.parametrize("interface", [None, 0.01])
@pytest.mark.parametrize("size", [5e-3, 5e-4, 1e-5])
def test_edges_at_tips_are_as_long_as_asked(interface, size):
    case = replace(WIDE_GAPS, tip_size=size, interface_size=interface)
    mesh, arrangement = generate(case, MARKS), arrange(case)
    lengths = [own for _, own in at_marks(mesh, arrangement, MARKS)]
    assert all(len(own) == 2 and 0.85 * size < own.min() <= own.max() <= size * (1 + 1e-6) for own in lengths)
    assert np.mean(lengths) > 0.93 * size
    # The same behind a tip as before it.
    assert max(own.max() / own.min() for own in lengths) < 1.15


@pytest.mark.parametrize("coating", [0.3, 0.05])
@pytest.mark.parametrize("curve", [0, ~0], ids=["outer", "inner"])
def test_the_circles_of_a_coated_fibre_have_their_own_tips(curve, coating):
    case = cell("square", fraction=0.3, coating=coating, tip_size=5e-4)
    mesh, arrangement = generate(case, {curve: (30.0, 150.0)}), arrange(case)
    own = np.array([own for _, own in at_marks(mesh, arrangement, {curve: (30.0, 150.0)})])
    assert np.all((own > 0.85 * 5e-4) & (own <= 5e-4 * (1 + 1e-6)))
    coarse = edge_lengths(generate(replace(case, tip_size=None), {curve: (30.0, 150.0)}))
    ends = mesh.points[mesh.arc_edges] - arrangement.centres[0]
    is_inner = np.linalg.norm(ends, axis=2).mean(axis=1) < arrangement.radii[0] * (1 + coating / 2)
    assert edge_lengths(mesh)[is_inner == (curve == 0)].min() > 2.5 * 5e-4 and coarse.min() > 2.5 * 5e-4


@pytest.mark.parametrize("case", [replace(SQUARE, tip_size=1e-5), replace(WIDE_GAPS, tip_size=1e-4)])
def test_elements_grow_with_the_distance_from_the_tip(case):
    marks = {0: (30.0, 150.0)}
    mesh, arrangement = generate(case, marks), arrange(case)
    centroids, mean = mesh.points[mesh.triangles].mean(axis=1), sides(mesh).mean(axis=1)
    away = [
        np.linalg.norm((centroids - place + 0.5) % 1.0 - 0.5, axis=1) for place, _ in at_marks(mesh, arrangement, marks)
    ]
    asked = np.minimum(case.mesh_size, case.tip_size + MAX_GROWTH * np.min(away, axis=0))
    assert (mean < 1.8 * asked).all() and (mean[asked < case.mesh_size] > 0.4 * asked[asked < case.mesh_size]).all()
    assert least_angle(mesh.points, mesh.triangles).min() > 18


def test_a_tip_takes_as_many_elements_as_is_estimated():
    """Logarithmically few: a tenth of the size, 2 pi ln(10) / (A g^2) triangles more at each."""
    marks, sizes = {0: (0.0, 120.0)}, (5e-3, 5e-4, 5e-5, 5e-6)
    counts = np.array([len(generate(replace(SQUARE, tip_size=size), marks).triangles) for size in sizes])
    estimates = [element_estimate.triangles_of_a_tip(0.05 / size) for size in sizes]
    per_tip = (counts - len(generate(SQUARE, marks).triangles)) / 2
    assert np.all((per_tip > 0.7 * np.array(estimates)) & (per_tip < 2 * np.array(estimates)))
    ratios = [element_estimate.ratio_at_a_tip(estimate) for estimate in estimates]
    assert ratios == pytest.approx([0.05 / size for size in sizes], rel=0.02)


@pytest.mark.parametrize("geometry", ["square", "random"])
def test_without_arcs_tips_have_no_size(geometry):
    plain, same = (generate(cell(geometry, tip_size=size)) for size in (None, 1e-5))
    assert np.array_equal(plain.points, same.points) and np.array_equal(plain.triangles, same.triangles)


def test_tips_that_would_take_hours_are_refused():
    case, marks = (
        cell(fibres=300, tip_size=1e-6, size=0.01),
        {fibre: tuple(range(0, 360, 30)) for fibre in range(300)},
    )
    with pytest.raises(MeshError, match=r"tip_size = 1e-06, fibres = 300: about .* elements before refine; expected"):
        generate(case, marks)
