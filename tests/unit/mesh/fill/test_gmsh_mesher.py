"""Coarse meshes by gmsh against closed forms: area, Euler characteristic, periodicity, circles, angles."""

from collections import Counter
from dataclasses import replace
from functools import cache
from operator import attrgetter

import numpy as np
import pytest
from support.circular_cells import cell
from support.generated_meshes import generate

from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.coarse_mesh import areas, flip_double_arcs
from feti_homog.mesh.outline.bare_outline import BareOutline
from feti_homog.mesh.outline.graded_size import MeshSizes
from feti_homog.mesh.tiles.tile_filling import Tile, fill

CELLS = {
    "square": cell("square"),
    "square, coarse": cell("square", size=0.5),
    "square, dilute": cell("square", 0.001, 0.2),
    "square, dense": cell("square", 0.78),
    "hexagonal": cell("hexagonal"),
    "hexagonal, dense": cell("hexagonal", 0.9),
    "one": cell(fibres=1, fraction=0.5),
    "two": cell(fibres=2, fraction=0.6),
    "seven": cell(fibres=7, fraction=0.65),
    "sixteen": cell(fraction=0.5),
    "spread": cell(fibres=60, fraction=0.6, gap=0.01, spread=0.8),
    "gap of a fifth": cell(fibres=64, fraction=0.5, gap=0.2),
    "hundred": cell(fibres=100, fraction=0.65, gap=0.03),
    "square, fine interface": cell("square", interface_size=0.002),
    "hexagonal, fine interfaces": cell("hexagonal", interface_size=0.01),
    "seven, fine interfaces": cell(fibres=7, fraction=0.65, interface_size=0.01),
    "spread, fine interfaces": cell(fibres=60, fraction=0.6, gap=0.01, spread=0.8, interface_size=0.01),
}
named = pytest.mark.parametrize("name", CELLS)


@pytest.mark.parametrize(
    ("geometry", "interface_size"), [("square", None), ("hexagonal", None), ("random", None), ("hexagonal", 0.01)]
)
def test_cells_of_all_sizes_have_one_mesh(geometry, interface_size):
    keys = {"spread": 0.3, "interface_size": interface_size}
    unit, small = (generate(cell(geometry, **keys, **width)) for width in ({}, {"width": 2e-4}))
    assert np.array_equal(small.triangles, unit.triangles) and np.array_equal(small.arc_edges, unit.arc_edges)
    for name in ("points", "ellipses.circles", "period"):
        one, other = map(attrgetter(name), (small, unit))
        assert one == pytest.approx(2e-4 * other, rel=1e-14)
    assert (small.width, small.height) == pytest.approx((2e-4, 2e-4 * unit.height))
    of_radius = generate(cell(geometry, **keys, fibre_radius=5e-6))
    radii = np.unique(of_radius.ellipses.circles[:, 2])
    assert radii.min() <= 5e-6 * (1 + 1e-12) and radii.max() >= 5e-6 * (1 - 1e-12)
    assert of_radius.ellipses.circles == pytest.approx(unit.ellipses.circles * of_radius.width, rel=1e-12)


@cache
def mesh_of(name):
    return generate(CELLS[name])


def least_angle(points, triangles):
    """Smallest angle of each triangle in degrees, by the law of cosines."""
    a, b, c = (np.linalg.norm(points[triangles[:, i]] - points[triangles[:, i - 1]], axis=1) for i in range(3))
    cosines = [(y**2 + z**2 - x**2) / (2 * y * z) for x, y, z in ((a, b, c), (b, c, a), (c, a, b))]
    return np.degrees(np.arccos(np.max(cosines, axis=0)))


def undirected(triangles):
    """Count the triangles of each edge, by its sorted pair of nodes."""
    return Counter(tuple(sorted((t[i], t[i - 1]))) for t in triangles.tolist() for i in range(3))


@named
def test_triangles_fill_the_cell(name):
    mesh = mesh_of(name)
    area = areas(mesh.points, mesh.triangles)
    assert area.min() > 0 and area.sum() == pytest.approx(mesh.width * mesh.height, rel=1e-12)
    assert set(mesh.triangles.ravel()) == set(range(len(mesh.points)))
    assert max(undirected(mesh.triangles).values()) == 2


@named
def test_fibre_area_is_that_of_the_inscribed_polygons(name):
    mesh = mesh_of(name)
    radius = mesh.ellipses.circles[mesh.arc_circle, 2]
    chord = np.linalg.norm(np.diff(mesh.points[mesh.arc_edges], axis=1)[:, 0], axis=1)
    turn = 2 * np.arcsin(chord / (2 * radius))
    missing = np.sum(radius**2 / 2 * (turn - np.sin(turn)))
    meshed = areas(mesh.points, mesh.triangles)[mesh.phase == 1].sum()
    expected = CELLS[name].fibre_fraction * mesh.width * mesh.height
    assert meshed + missing == pytest.approx(expected, rel=1e-12)
    radii = arrange(CELLS[name]).radii
    assert turn.sum() == pytest.approx(2 * np.pi * len(radii))


@named
def test_opposite_sides_have_the_same_nodes(name):
    mesh = mesh_of(name)
    for axis, period in ((0, mesh.width), (1, mesh.height)):
        sides = [np.sort(mesh.points[mesh.points[:, axis] == level, 1 - axis]) for level in (0.0, period)]
        assert np.array_equal(*sides) and sides[0][0] == 0 and len(sides[0]) >= 2
    shift = mesh.points - mesh.points[mesh.representative]
    assert np.all((shift == 0) | (shift == [mesh.width, mesh.height]))
    assert np.all(mesh.points[mesh.representative] < [mesh.width, mesh.height])
    assert np.array_equal(mesh.representative[mesh.representative], mesh.representative)


@named
def test_euler_characteristic_of_the_torus_is_zero(name):
    mesh = mesh_of(name)
    plane = undirected(mesh.triangles)
    sides = sum(1 for count in plane.values() if count == 1)
    edges = len(plane) - sides // 2
    assert len(np.unique(mesh.representative)) - edges + len(mesh.triangles) == 0


@named
def test_arcs_are_the_interface_and_lie_on_circles(name):
    mesh = mesh_of(name)
    spokes = mesh.points[mesh.arc_edges] - mesh.ellipses.circles[mesh.arc_circle][:, None, :2]
    radius = mesh.ellipses.circles[mesh.arc_circle, 2][:, None]
    assert np.abs(np.linalg.norm(spokes, axis=2) / radius - 1).max() < 1e-12
    phases = {}
    for triangle, phase in zip(mesh.triangles.tolist(), mesh.phase.tolist(), strict=True):
        for i in range(3):
            phases.setdefault(tuple(sorted((triangle[i], triangle[i - 1]))), set()).add(phase)
    interface = {edge for edge, both in phases.items() if len(both) == 2}
    assert interface == {tuple(sorted(edge)) for edge in mesh.arc_edges.tolist()}


@named
def test_no_triangle_has_two_edges_on_one_circle(name):
    mesh = mesh_of(name)
    circle = {tuple(sorted(e)): c for e, c in zip(mesh.arc_edges.tolist(), mesh.arc_circle.tolist(), strict=True)}
    for triangle in mesh.triangles.tolist():
        own = [circle.get(tuple(sorted((triangle[i], triangle[i - 1])))) for i in range(3)]
        own = [c for c in own if c is not None]
        assert len(own) == len(set(own))


@named
def test_angles_are_wide_and_edges_around_a_fibre_enough(name):
    mesh = mesh_of(name)
    angles = least_angle(mesh.points, mesh.triangles)
    assert angles.min() > 13 and np.mean(angles) > 43
    around = len(mesh.arc_edges) / len(arrange(CELLS[name]).radii)
    assert around >= 16


@named
def test_arcs_stay_clear_of_the_next_fibre(name):
    """The sagitta of an edge is small against the way from its middle to any other circle."""
    mesh = mesh_of(name)
    middle = mesh.points[mesh.arc_edges].mean(axis=1)
    radius = mesh.ellipses.circles[mesh.arc_circle, 2]
    chord = np.linalg.norm(np.diff(mesh.points[mesh.arc_edges], axis=1)[:, 0], axis=1)
    away = np.linalg.norm(middle[:, None] - mesh.ellipses.circles[:, :2], axis=2) - mesh.ellipses.circles[:, 2]
    away[np.arange(len(away)), mesh.arc_circle] = np.inf
    assert np.all(chord**2 / (8 * radius) < 0.3 * away.min(axis=1))


@pytest.mark.parametrize("name", ["square", "hexagonal", "seven", "sixteen"])
@pytest.mark.parametrize("seed", range(2))
def test_the_last_bits_of_the_outline_do_not_change_the_mesh(name, seed):
    """Take the last bits as another machine may give them."""
    case, chance = CELLS[name], np.random.default_rng(seed)
    sizes = MeshSizes(*[case.mesh_size] * 3)
    bare = BareOutline.of(arrange(case), sizes, {})
    lines = bare.outline(bare.lines.stations(bare.field))
    nodes = np.arange(len(lines.points))
    tile = Tile(lines.points, nodes, nodes, lines.curves, sizes.largest, False)
    ends = lines.points + chance.choice([-1.0, 1.0], lines.points.shape)
    here, elsewhere = fill(tile), fill(replace(tile, points=np.nextafter(lines.points, ends)))
    for name in ("inner", "triangles", "circle"):
        assert np.array_equal(getattr(here, name), getattr(elsewhere, name))


def test_a_triangle_with_two_arc_edges_is_flipped():
    """An octagon: a fan about node 8, but for the ear 0, 1, 2 in front of the triangle 0, 2, 8."""
    triangles = np.array([[0, 1, 2], [0, 2, 8]] + [[i, (i + 1) % 8, 8] for i in range(2, 8)], dtype=np.int32)
    arcs = np.array([[i, (i + 1) % 8] for i in range(8)], dtype=np.int32)
    zeros = np.zeros(8, dtype=np.int32)
    flipped = flip_double_arcs(triangles, zeros, arcs, zeros, 9)
    assert {frozenset(t) for t in flipped.tolist()} == {frozenset((i, (i + 1) % 8, 8)) for i in range(8)}
    assert np.array_equal(flip_double_arcs(triangles, zeros, arcs, np.arange(8, dtype=np.int32), 9), triangles)


def test_the_number_of_triangles_follows_the_size():
    counts = [len(generate(cell("square", size=size)).triangles) for size in (0.04, 0.02)]
    assert 3.5 < counts[1] / counts[0] < 4.5
    expected = 4 / np.sqrt(3) / 0.02**2
    assert 0.8 < counts[1] / expected < 1.4


@pytest.mark.parametrize("name", ["square", "hexagonal", "two", "sixteen"])
def test_marks_become_nodes(name):
    marks = {0: (30.0, -30.0, 123.4), 1: (0.0, 90.0, 271.0)} if name != "square" else {0: (-15, 15, 180)}
    mesh = generate(CELLS[name], marks)
    arrangement = arrange(CELLS[name])
    size = np.array([mesh.width, mesh.height])
    for fibre, angles in marks.items():
        for angle in np.radians(angles):
            spoke = arrangement.radii[fibre] * np.array([np.cos(angle), np.sin(angle)])
            away = (mesh.points - arrangement.centres[fibre] - spoke + size / 2) % size - size / 2
            assert np.linalg.norm(away, axis=1).min() < 1e-12
    assert least_angle(mesh.points, mesh.triangles).min() > 13
    assert areas(mesh.points, mesh.triangles).sum() == pytest.approx(mesh.width * mesh.height, rel=1e-12)


def test_marks_that_nearly_meet_are_one_node():
    """At 90 degrees the corner fibre crosses the side; the mark beside it must not make a needle."""
    mesh = generate(CELLS["hexagonal"], {0: (90.001, 45.0, 45.002)})
    assert len(mesh.points) < 1.3 * len(mesh_of("hexagonal").points)
    assert least_angle(mesh.points, mesh.triangles).min() > 13


@pytest.mark.slow
def test_hundreds_of_fibres_are_meshed_without_needles():
    mesh = generate(cell(fibres=400, fraction=0.6, gap=0.03))
    assert least_angle(mesh.points, mesh.triangles).min() > 10
