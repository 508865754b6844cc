"""Cells of tables with ellipses: where nodes are, what the table's order and units do, and rows that overlap."""

from dataclasses import replace

import numpy as np
import pytest
from support.generated_meshes import generate
from support.subdomains import cut

from feti_homog.case.cell_files import check_shapes
from feti_homog.case.cell_section import Cell
from feti_homog.errors import MeshError
from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.mesh_fibres import fibre_circles
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.refinement import ReferenceLattice, refine
from feti_homog.microstructure.fibre_table import table_of
from feti_homog.microstructure.shapes.ellipses import Ellipses
from feti_homog.microstructure.shapes.outlines import gaps

ROWS = [
    {"x": 0.5, "y": 0.5, "a": 0.25, "b": 0.1, "angle": 30.0},
    {"x": 0.02, "y": 0.04, "a": 0.18, "b": 0.1, "angle": 100.0, "phase": "glass"},
    {"x": 0.93, "y": 0.52, "radius": 0.08},
]


def table(rows, corner=None):
    left, bottom = corner or (None, None)
    found = replace(table_of(rows, "t.csv"), width=1.0, height=1.0, left=left, bottom=bottom)
    faults = []
    check_shapes(found, faults)
    assert not faults
    return found


def cell_of(fibres, size=0.1, **keys):
    return Cell(geometry="table", table=fibres, mesh_size=size, **keys)


def ellipse(centre, a, b, angle):
    return Ellipses.of(np.array([centre]), np.array([a]), np.array([b]), np.array([angle]))


@pytest.mark.parametrize("interface_size", [None, 0.02])
def test_equal_semi_axes_make_discs(interface_size):
    rows = [{"x": 0.3, "y": 0.2, "a": 0.2, "b": 0.2, "angle": 37.0}, {"x": 0.8, "y": 0.7, "radius": 0.15}]
    discs = [{"x": 0.3, "y": 0.2, "radius": 0.2}, rows[1]]
    mesh, expected = (generate(cell_of(table(each), interface_size=interface_size)) for each in (rows, discs))
    assert np.array_equal(mesh.points, expected.points)
    assert np.array_equal(mesh.ellipses.circles, expected.ellipses.circles)


@pytest.mark.parametrize("corner", [(0.0, 0.0), (-0.2, -0.27), (-0.61, -0.31), (-0.46, -0.4)])
def test_nodes_of_interfaces_lie_on_the_ellipses(corner):
    """Wherever the cell's sides cut them; fibres are numbered in the order of the rows."""
    begin = dict(zip("xy", corner, strict=True))
    rows = [row | {axis: low + (row[axis] - low) % 1.0 for axis, low in begin.items()} for row in ROWS]
    cell = cell_of(table(rows, corner))
    mesh, arrangement = generate(cell), arrange(cell)
    torus = Torus.of(mesh)
    for fibre, row in enumerate(ROWS, 1):
        own = arrangement.outlines[np.array([fibre - 1])]
        inside = torus.constituent == fibre
        nodes = np.intersect1d(mesh.triangles[inside], mesh.triangles[mesh.phase == 0])
        offsets = (mesh.points[nodes] - own.centres + 0.5) % 1.0 - 0.5
        assert np.linalg.norm(own.unit(offsets), axis=1) == pytest.approx(1.0, abs=1e-9)
        assert mesh.phases[mesh.phase[inside][0]] == row.get("phase", "fibre")
        assert own.frames[0] @ own.frames[0].T == pytest.approx(square_of(row), abs=1e-9)


def square_of(row):
    if "radius" in row:
        return row["radius"] ** 2 * np.eye(2)
    turn = np.radians(row["angle"])
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return axes @ np.diag([row["a"], row["b"]]) ** 2 @ axes.T


def body_areas(mesh, refinements=4):
    """(constituents,) areas within the refined polygons, none of whose elements may turn over."""
    torus, lattice = Torus.of(mesh), ReferenceLattice.of(refinements, 1)
    found = np.zeros(torus.constituent.max() + 1)
    for submesh in cut(torus, torus.constituent):
        fine = refine(submesh, lattice)
        own = areas(fine.points, fine.triangles)
        assert own.min() > 0
        found[submesh.body] = own.sum()
    return found


def test_refinement_follows_the_ellipses():
    """Each halving quarters what the polygons of nodes lack of pi a b."""
    exact, mesh = np.pi * np.array([0.25 * 0.1, 0.18 * 0.1, 0.08**2]), generate(cell_of(table(ROWS)))
    missing = np.array([1 - body_areas(mesh, refinements)[1:] / exact for refinements in range(6)])
    assert missing[:-1] / missing[1:] == pytest.approx(4.0, rel=0.03)
    assert missing[-1].min() > 0 and missing[-1].max() < 1e-4


def test_order_units_and_origin_do_not_matter():
    lengths = ("x", "y", "a", "b", "radius")
    moved = [{key: 137.3 * value if key in lengths else value for key, value in row.items()} for row in ROWS[::-1]]
    moved = [row | {"x": row["x"] + 29.0, "y": row["y"] - 500.0} for row in moved]
    expected = generate(cell_of(table(ROWS)))
    mesh = generate(cell_of(replace(table(moved), width=137.3, height=137.3)))
    assert np.array_equal(mesh.triangles, expected.triangles)
    assert np.abs(mesh.points / 137.3 - expected.points).max() < 1e-9
    assert Torus.of(mesh).constituent.max() == len(ROWS)


THIN = [{"x": 0.5, "y": y, "a": 0.4, "b": 0.04, "angle": angle} for y, angle in ((0.3, 0.0), (0.42, 5.0))]
COATED = [{"x": 0.5, "y": 0.5, "a": 0.4, "b": 0.05, "angle": 20.0, "coating": 0.02}]


@pytest.mark.parametrize(("rows", "least"), [(THIN, 0.2), (COATED, 0.1)], ids=["near each other", "thin coating"])
def test_thin_ellipses_have_good_elements(rows, least):
    mesh = generate(cell_of(table(rows)))
    sides = np.linalg.norm(mesh.points[mesh.triangles] - mesh.points[np.roll(mesh.triangles, 1, axis=1)], axis=2)
    quality = 4 * np.sqrt(3) * areas(mesh.points, mesh.triangles) / (sides**2).sum(axis=1)
    assert quality.min() > least and len(mesh.triangles) < 8000
    body_areas(mesh)


def test_gap_of_discs_and_of_affine_images_of_tangent_discs():
    generator = np.random.default_rng(0)
    centres, radii = generator.uniform(-1, 1, (2, 50, 2)), generator.uniform(0.1, 1, (2, 50))
    discs = [Ellipses.of(c, r, r, np.zeros(50)) for c, r in zip(centres, radii, strict=True)]
    distance = np.linalg.norm(centres[1] - centres[0], axis=1)
    assert gaps(*discs)[0] == pytest.approx(distance - radii.sum(axis=0), abs=1e-12)
    direction = (centres[1] - centres[0]) / distance[:, None]
    tangent = Ellipses(centres[0] + direction * radii.sum(axis=0)[:, None], discs[1].frames)
    map_ = generator.uniform(-1, 1, (2, 2))
    images = [Ellipses(each.centres @ map_.T, map_ @ each.frames) for each in (discs[0], tangent)]
    assert gaps(*images)[0] == pytest.approx(0.0, abs=1e-9)


def test_gap_is_the_smallest_distance_of_points():
    one, other = ellipse([0.0, 0.0], 0.5, 0.1, 20.0), ellipse([0.3, 0.55], 0.4, 0.15, -50.0)
    angle = np.linspace(0, 2 * np.pi, 2000)
    points = [each[np.zeros(2000, int)].points(angle) for each in (one, other)]
    distance = np.linalg.norm(points[0][:, None] - points[1], axis=2).min()
    assert 0.05 < gaps(one, other)[0][0] == pytest.approx(distance, rel=1e-4)


TILTED = {"a": 0.3, "b": 0.05, "angle": 45.0}
FAULTY = {
    "overlap": ([{"x": 0.5, "y": 0.5} | TILTED, {"x": 0.55, "y": 0.45, "radius": 0.1}], "rows 1 and 2: overlap by 0."),
    "touch": (
        [{"x": 0.3, "y": 0.5, "a": 0.2, "b": 0.1}, {"x": 0.6, "y": 0.5, "a": 0.1, "b": 0.2}],
        "rows 1 and 2: touch",
    ),
    "over the side": (
        [{"x": 0.1, "y": 0.5, "a": 0.2, "b": 0.1}, {"x": 0.9, "y": 0.5, "radius": 0.05}],
        "rows 1 and 2: overlap by 0.05 across the border",
    ),
    "its own image": ([{"x": 0.5, "y": 0.5, "a": 0.49, "b": 0.05}, {"x": 0.5, "y": 0.9, "a": 0.4999999, "b": 0.1}],
        "row 2 and its image: touch across the border"),
    "too large": ([{"x": 0.5, "y": 0.5, "a": 0.6, "b": 0.1}], "row 1: a = 0.6: expected"),
    "images of two shapes": (
        [{"x": 0.0, "y": 0.5, "a": 0.2, "b": 0.1}, {"x": 1.0, "y": 0.5, "a": 0.1, "b": 0.2}],
        "rows 1 and 2: are images of one fibre, a period apart; expected one shape",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTY)
def test_faults_name_the_rows(name):
    rows, line = FAULTY[name]
    with pytest.raises(MeshError) as error:
        arrange(cell_of(table(rows)))
    assert [fault for fault in error.value.faults if fault.startswith(f"[cell] t.csv: {line}")], error.value.faults


def test_neighbours_that_only_circles_around_them_would_hit_are_allowed():
    rows = [{"x": 0.4, "y": 0.5} | TILTED, {"x": 0.52, "y": 0.38} | TILTED]
    assert len(arrange(cell_of(table(rows))).radii) == 2


SHAPES = {
    "both": ([ROWS[0] | {"radius": 0.1}], "row 1: has a radius and semi-axes; give one"),
    "thin": ([ROWS[0] | {"b": 0.01}], "row 1: expected a / b from 0.05 to 20"),
}


@pytest.mark.parametrize("name", SHAPES)
def test_faulty_shapes_name_the_row(name):
    (rows, line), faults = SHAPES[name], []
    check_shapes(table_of(rows, "t.csv"), faults)
    assert faults == [f"[cell] t.csv: {line}"]


@pytest.mark.parametrize("row", [ROWS[0], {"x": 0.5, "y": 0.5, "a": 0.4, "b": 0.05, "angle": 50.0}])
def test_tips_of_arcs_are_nodes_in_their_directions(row):
    """Seen from the centre that the fibre is known to have, whatever its polygon's."""
    cell, tips = cell_of(table([row]), 0.3), (10.0, 55.0, 200.0)
    mesh = generate(cell, {0: tips})
    x, y, radius = fibre_circles(Torus.of(mesh))[1]
    assert [x, y] == pytest.approx(arrange(cell).centres[0], abs=1e-12) and np.isnan(radius)
    nodes = (mesh.points[np.unique(mesh.arc_edges)] - [x, y] + 0.5) % 1.0 - 0.5
    found = np.degrees(np.arctan2(nodes[:, 1], nodes[:, 0]))
    away = (found[:, None] - tips + 180.0) % 360.0 - 180.0
    assert np.abs(away).min(axis=0) == pytest.approx(0.0, abs=1e-6)
