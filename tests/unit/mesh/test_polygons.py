"""Rounded polygons of tables: their outlines, gaps and meshes, what is listed of them, faults."""

from dataclasses import replace

import numpy as np
import pytest
import tomli_w
from mpi4py import MPI
from support import cases
from support.generated_meshes import generate
from unit.mesh.fill.test_gmsh_mesher import least_angle

from feti_homog import run
from feti_homog.case.cases import parse
from feti_homog.commands import listed_fibres
from feti_homog.errors import CaseError, MeshError
from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.fill.shape_mesher import mesh_outlines
from feti_homog.mesh.mesh_fibres import corner_edges
from feti_homog.mesh.outline.graded_size import MIN_EDGES_AROUND, MeshSizes
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.microstructure.arrangements import Arrangement
from feti_homog.microstructure.shapes.convex_sums import ConvexSums
from feti_homog.microstructure.shapes.shapes import outlines_of

SQUARE = {"x": 0.5, "y": 0.5, "radius": 0.3, "sides": 4, "corner": 0.3, "angle": 10.0}
ROWS = [
    {"x": 0.0, "y": 0.0, "radius": 0.25, "sides": 6, "corner": 0.2, "angle": 10.0},
    {"x": 0.5, "y": 0.5, "radius": 0.2, "coating": 0.1},
    {"x": 0.05, "y": 0.5, "radius": 0.18, "sides": 3, "corner": 0.3, "angle": 90.0},
    {"x": 0.5, "y": 0.05, "a": 0.16, "b": 0.08, "angle": 30.0, "phase": "void"},
]


def case_of(*rows, **cell):
    coated = any(row.get("coating") for row in rows)
    table = {"geometry": "table", "width": 1.0, "height": 1.0, "fibre_list": list(rows), "mesh_size": 0.06} | cell
    phases = ("matrix", "fibre", *(("coating",) if coated else ()))
    return cases.case_of(table, material=dict.fromkeys(phases, cases.MATRIX))


def polygon(x, y, sides, radius, rounding=0.0, angle=0.0):
    corner = rounding / radius / np.cos(np.pi / sides) if sides else 0.0
    row = {"x": x, "y": y, "radius": radius, "sides": sides, "corner": corner, "angle": angle, "inner_radius": 0.0}
    return {name: np.array([value]) for name, value in ({"a": np.nan, "b": np.nan} | row).items()}


def test_rounded_polygons_have_no_corners():
    for corner in (0.0, 0.3):
        assert corner_edges(Torus.of(generate(case_of(SQUARE | {"corner": corner}).cell))) == 2 * (corner == 0.0)


def gap_between(*rows):
    """Return the gap between two outlines of a row each."""
    outlines = outlines_of({name: np.concatenate([row[name] for row in rows]) for name in rows[0]})
    vector = np.diff(outlines.centres, axis=0)
    normal, reach = outlines.parting(np.array([0]), np.array([1]), vector)
    return (normal * vector).sum() - reach[0]


@pytest.mark.parametrize(("one", "other", "gap"), [
    (polygon(0, 0, 4, 2**0.5, 0.0, 45.0), polygon(3, 0.5, 4, 2**0.5, 0.0, 45.0), 1.0),  # side to side
    (polygon(0, 0, 4, 2**0.5, 0.2, 45.0), polygon(3, 0.5, 4, 2**0.5, 0.0, 45.0), 1.0),
    (polygon(0, 0, 4, 2**0.5, 0.0, 45.0), polygon(4, 4, 4, 2**0.5, 0.0, 45.0), 8**0.5),  # corner to corner
    (polygon(0, 0, 4, 2**0.5, 0.5, 45.0), polygon(4, 4, 4, 2**0.5, 0.5, 45.0), 18**0.5 - 1),
    (polygon(0, 0, 4, 1.0), polygon(3, 0, 4, 2**0.5, 0.0, 45.0), 1.0),  # corner to side
    (polygon(0, 0, 0, 1.0), polygon(0, -4, 3, 2.0, 0.0, 90.0), 1.0),  # disc to corner
    (polygon(0, 0, 0, 1.0), polygon(0, 4, 3, 2.0, 0.0, 90.0), 2.0),  # disc to side
    (polygon(0, 0, 4, 2**0.5, 0.0, 45.0), polygon(1.5, 0.0, 4, 2**0.5, 0.3, 45.0), -0.5),
])  # fmt: skip
def test_gaps_are_those_of_elementary_geometry(one, other, gap):
    assert gap_between(one, other) == pytest.approx(gap, abs=1e-8)
    assert gap_between(other, one) == pytest.approx(gap, abs=1e-8)


@pytest.mark.parametrize("sides", [3, 4, 7, 12])
@pytest.mark.parametrize("corner", [0.0, 0.3, 1.0])
def test_radii_are_of_the_same_area(sides, corner):
    """The area by the shoelace formula of many points of the outline."""
    case = case_of(SQUARE | {"sides": sides, "corner": corner})
    arrangement = arrange(case.cell)
    points, normals, _ = arrangement.outlines.boundary(4000)
    x, y = points.T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    assert np.pi * arrangement.radii[0] ** 2 == pytest.approx(area, rel=1e-6)
    away = points - arrangement.outlines.centres[0]
    inner = 0.3 * np.cos(np.pi / sides)
    reach = inner * corner + (0.3 - inner * corner / np.cos(np.pi / sides))
    assert np.linalg.norm(away, axis=1).max() == pytest.approx(reach, rel=1e-5)
    assert (away * normals).sum(axis=1).min() == pytest.approx(inner, rel=1e-5)


def test_polygons_circles_and_ellipses_are_meshed_together():
    case = case_of(*ROWS)
    mesh, arrangement = generate(case.cell), arrange(case.cell)
    found = areas(mesh.points, mesh.triangles)
    assert mesh.phases == ("matrix", "coating", "fibre") and Torus.of(mesh).voids == 1
    assert sorted(set(mesh.precedence.tolist())) == [0, 1, 2, 3, 5]
    for number, radius in enumerate(arrangement.radii[:3], 1):
        assert found[mesh.precedence == number].sum() == pytest.approx(np.pi * radius**2, rel=0.01)
    assert found[mesh.precedence == 5].sum() == pytest.approx(np.pi * 0.04 * 0.21, rel=0.02)
    assert 1 - found.sum() == pytest.approx(np.pi * 0.16 * 0.08, rel=0.02)
    torus = Torus.of(mesh)
    assert len(torus.constituent_phase) == 5
    assert least_angle(mesh.points, mesh.triangles).min() > 15


@pytest.mark.parametrize("ratio", [2.0, 5.0, 10.0])
def test_edges_on_slender_ellipses_beside_polygons_follow_their_curvature(ratio):
    """At the tips the radius of curvature is b^2 / a, in the middle a^2 / b."""
    oval, hexagon = {"x": 0.5, "y": 0.5, "a": 0.35, "b": 0.35 / ratio, "angle": 20.0}, {"radius": 0.03, "sides": 6}
    mesh = generate(case_of(oval, {"x": 0.15, "y": 0.85} | hexagon, mesh_size=0.1).cell)
    curves = mesh.ellipses[mesh.arc_circle]
    ends = [curves.parameter(mesh.points[mesh.arc_edges[:, k]] - curves.centres) for k in (0, 1)]
    start, stop = (curves.normal(angle) for angle in ends)
    turn = np.arccos(np.clip((start * stop).sum(axis=1), -1.0, 1.0))
    assert turn.sum() == pytest.approx(2 * np.pi)
    assert turn.max() < 1.6 * 2 * np.pi / MIN_EDGES_AROUND
    assert 8 < len(turn) < 60


@pytest.mark.parametrize("gap", [0.02, 0.005])
def test_narrow_gaps_between_sides_have_good_triangles(gap):
    half = 0.15
    row = SQUARE | {"radius": half * 2**0.5, "angle": 45.0, "corner": 0.1}
    mesh = generate(case_of(row | {"x": 0.5 - half - gap / 2}, row | {"x": 0.5 + half + gap / 2, "y": 0.55}).cell)
    assert least_angle(mesh.points, mesh.triangles).min() > 15


def test_rows_in_any_order_and_any_unit_give_one_mesh():
    one = generate(case_of(*ROWS).cell)
    other = generate(case_of(*ROWS[::-1]).cell)
    assert np.abs(one.points - other.points).max() < 1e-12 and np.array_equal(one.triangles, other.triangles)
    lengths = ("x", "y", "radius", "a", "b")
    rows = [{k: 50 * v if k in lengths else v for k, v in row.items()} for row in ROWS]
    large = generate(case_of(*rows, width=50.0, height=50.0).cell)
    assert np.abs(large.points / 50 - one.points).max() < 1e-9 and np.array_equal(one.triangles, large.triangles)


@pytest.mark.slow
def test_the_table_of_polygons_and_a_hollow_fibre_gives_the_cell_again(tmp_path):
    case = case_of(*ROWS, {"x": 0.75, "y": 0.75, "radius": 0.07, "inner_radius": 0.04})
    document = {k: v for k, v in case.resolved().items() if k in ("cell", "material", "analysis")}
    (tmp_path / "case.toml").write_text(tomli_w.dumps(document))
    (tmp_path / "again.csv").write_text(listed_fibres.table(tmp_path / "case.toml"))
    document["cell"] = {"geometry": "table", "file": "again.csv", "mesh_size": 0.06}
    mesh, again = generate(case.cell), generate(parse(document, tmp_path).cell)
    sums = [[areas(m.points, m.triangles)[m.phase == phase].sum() for phase in range(3)] for m in (mesh, again)]
    assert sums[0] == pytest.approx(sums[1], rel=1e-3) and Torus.of(again).voids == 2
    run(case.replace({"cell.mesh_size": 0.2}), MPI.COMM_SELF, out=tmp_path / "run")
    assert listed_fibres.table(tmp_path / "run") == (tmp_path / "again.csv").read_text()


@pytest.mark.parametrize(("row", "fault"), [
    ({"sides": 2}, "expected sides from 3 to 12, a whole number, or 0"),
    ({"sides": 13}, "expected sides from 3 to 12, a whole number, or 0"),
    ({"sides": 4.5}, "expected sides from 3 to 12, a whole number, or 0"),
    ({"sides": -4}, "sides = -4: expected a number at least 0"),
    ({"corner": 1.5}, "expected corner at most 1, which makes a circle"),
    ({"corner": -0.1}, "corner = -0.1: expected a number at least 0"),
    ({"sides": 0}, "has a corner, but no sides"),
    ({"coating": 0.1}, "has sides and coating; give one"),
    ({"inner_radius": 0.1}, "has sides and inner_radius; give one"),
])  # fmt: skip
def test_faults_of_rows(row, fault):
    with pytest.raises(CaseError) as caught:
        case_of(SQUARE | row, {"x": 0.0, "y": 0.0, "radius": 0.1})
    assert caught.value.faults[0].endswith(f"row 1: {fault}")


def test_a_core_of_two_corners_is_a_stadium():
    """Straight sides between half-discs; triangles with straight edges lack 0.2 % of its area."""
    ends, radius = np.array([[0.15, 0.05], [-0.15, -0.05]]), 0.2
    outlines = ConvexSums(np.full((1, 2), 0.5), ends[None], radius * np.eye(2)[None])
    area = np.pi * radius**2 + 2 * radius * np.linalg.norm(ends[0] - ends[1])
    assert np.pi * outlines.radii**2 == pytest.approx(area)
    arrangement = Arrangement(1.0, 1.0, outlines, ("fibre",), np.zeros(1), np.zeros(1, bool))
    mesh = mesh_outlines(arrangement, MeshSizes(0.03, 0.03, 0.03), 1.0)
    assert areas(mesh.points, mesh.triangles)[mesh.precedence == 1].sum() == pytest.approx(area, rel=4e-3)


@pytest.mark.parametrize("place", [{}, {"left": 0.0, "bottom": 0.0}], ids=["any origin", "placed"])
@pytest.mark.parametrize("radius", [0.27, 0.4])
def test_corners_of_cells_are_in_no_void(radius, place):
    """The widest gaps between tangents are within the void; so is the corner of the table that is placed."""
    case = case_of(SQUARE | {"radius": 0.12}, {"x": 0.0, "y": 0.0, "radius": radius, "phase": "void"})
    arrangement = arrange(replace(case.cell, table=replace(case.cell.table, **place)))
    void = arrangement.centres[arrangement.is_void]
    assert np.linalg.norm((void + 0.5) % 1.0 - 0.5, axis=1) > radius
    mesh = mesh_outlines(arrangement, MeshSizes(0.05, 0.05, 0.05), 1.0)
    assert areas(mesh.points, mesh.triangles).sum() == pytest.approx(1.0 - np.pi * radius**2, rel=5e-3)
    assert Torus.of(mesh).voids == 1


def test_a_cut_window_moves_polygons():
    """Squares that overlap across the border by 0.02 are moved apart along its normal."""
    rows = [{"x": x, "y": 0.5, "radius": 0.2 * 2**0.5, "sides": 4, "angle": 45.0} for x in (0.17, 0.79)]
    with pytest.raises(MeshError, match=r"overlap by 0\.02 across the border"):
        arrange(case_of(*rows).cell)
    first, second = arrange(case_of(*rows, window="cut").cell).centres
    assert 1.0 - abs(first[0] - second[0]) > 0.4 and first[1] == pytest.approx(second[1], abs=1e-6)


def test_faults_of_the_table():
    with pytest.raises(CaseError, match="row 1: has a corner, but no sides"):
        case_of({"x": 0.5, "y": 0.5, "radius": 0.1, "corner": 0.3})
    with pytest.raises(CaseError, match=r"tip_size = 0\.01: fibre_list has polygons, whose meshes have no"):
        case_of(SQUARE, tip_size=0.01)


@pytest.mark.parametrize(("row", "fault"), [
    ({"x": 0.9, "y": 0.5, "radius": 0.2}, "rows 1 and 2: overlap by"),
    (SQUARE | {"x": 0.55}, "rows 1 and 2: overlap by"),
    (SQUARE | {"x": 0.0, "y": 0.0, "radius": 0.6}, "row 2: radius = 0.6: expected from 1e-06 to below 0.5"),
    (SQUARE | {"x": 3.0}, "row 2: x = 3: lies outside the cell"),
])  # fmt: skip
def test_faults_of_places(row, fault):
    with pytest.raises(MeshError) as caught:
        arrange(case_of(SQUARE, row).cell)
    assert any(fault in line for line in caught.value.faults)
