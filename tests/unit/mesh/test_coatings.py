"""Meshes of coated circles and ellipses, cut by the sides of the cell, thick and thin; coatings that overlap."""

import numpy as np
import pytest
from support.generated_meshes import generate, mesh_of_discs
from unit.mesh.test_table_ellipses import ROWS, body_areas, cell_of, table

from feti_homog.case.cell_section import Cell
from feti_homog.errors import MeshError
from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.coarse_mesh import areas, double_arcs
from feti_homog.mesh.mesh_fibres import fibre_circles
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.microstructure.arrangements import Arrangement

CELLS = {
    "square": Cell(geometry="square", fibre_fraction=0.4, coating=0.05),
    "hexagonal": Cell(geometry="hexagonal", fibre_fraction=0.4, coating=0.2),
    "thin": Cell(geometry="hexagonal", fibre_fraction=0.4, coating=0.01),
    "thick": Cell(geometry="square", fibre_fraction=0.1, coating=1.0),
    "random": Cell(geometry="random", fibre_fraction=0.4, coating=0.02, fibres=5, seed=3, radius_spread=0.3),
}


@pytest.mark.parametrize("name", CELLS)
def test_each_body_has_the_area_of_its_circles(name):
    discs, mesh = arrange(CELLS[name]), generate(CELLS[name])
    assert mesh.phases == ("matrix", "fibre", "coating")
    assert len(double_arcs(mesh.triangles, mesh.arc_edges, mesh.arc_circle, len(mesh.points))[0]) == 0
    inner, outer = np.pi * discs.radii**2, np.pi * discs.outer_radii**2
    expected = [mesh.width * mesh.height - outer.sum(), *inner, *(outer - inner)]
    assert body_areas(mesh) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("name", CELLS)
def test_coatings_come_behind_the_fibres_in_their_order(name):
    cell = CELLS[name]
    discs, torus = arrange(cell), Torus.of(generate(cell))
    count = len(discs.radii)
    assert torus.constituent_phase.tolist() == [0] + [1] * count + [2] * count
    circles = fibre_circles(torus)[1:]
    assert circles[:count, 2] == pytest.approx(discs.radii)
    assert circles[count:, 2] == pytest.approx(discs.radii * (1 + cell.coating))
    away = circles[:, :2] - np.tile(discs.centres, (2, 1))
    assert np.abs(away - np.round(away / mesh_size(discs)) * mesh_size(discs)).max() < 1e-12


def mesh_size(discs: Arrangement) -> np.ndarray:
    return np.array([discs.width, discs.height])


def test_sides_may_cut_coatings_anywhere():
    """Through the coating alone, the fibre, the corner of the cell: what is cut is one body on the torus."""
    for at in ([0.27, 0.4], [0.2, 0.05], [0.1, 0.1], [0.0, 0.0], [0.26, 0.5]):
        discs = Arrangement.of_discs(1.0, 1.0, np.array([at]), np.array([0.25]), ("fibre",), coating=np.array([0.05]))
        torus = Torus.of(mesh_of_discs(discs))
        share = np.bincount(torus.mesh.phase, areas(torus.mesh.points, torus.mesh.triangles))
        assert torus.constituent_phase.tolist() == [0, 1, 2]
        assert share.sum() == pytest.approx(1.0) and share[1:] == pytest.approx([0.196, 0.0864], rel=0.05)


def test_bare_and_coated_fibres_go_together():
    centres, radii = np.array([[0.25, 0.3], [0.75, 0.7]]), np.array([0.1, 0.2])
    discs = Arrangement.of_discs(1.0, 1.0, centres, radii, ("glass", "carbon"), coating=np.array([0.0, 0.02]))
    mesh = mesh_of_discs(discs)
    assert mesh.phases == ("matrix", "glass", "carbon", "coating")
    assert Torus.of(mesh).constituent_phase.tolist() == [0, 1, 2, 3]


COATED = [ROWS[0] | {"coating": 0.1}, ROWS[1] | {"coating": 0.05}, ROWS[2], {"x": 0.5, "y": 0.85, "radius": 0.07}]
COATED[3] |= {"coating": 0.2}


@pytest.mark.parametrize("corner", [None, (0.0, 0.0), (-0.2, -0.27), (-0.46, -0.4)])
@pytest.mark.parametrize("interface_size", [None, 0.02])
def test_each_body_has_the_area_of_its_ellipses(corner, interface_size):
    """Semi-axes are longer by coating sqrt(a b) with the coating; wherever the sides of the cell cut them."""
    begin = dict(zip("xy", corner or (0.0, 0.0), strict=True))
    rows = [row | {axis: low + (row[axis] - low) % 1.0 for axis, low in begin.items()} for row in COATED]
    mesh = generate(cell_of(table(rows, corner), interface_size=interface_size))
    assert mesh.phases == ("matrix", "fibre", "glass", "coating")
    assert len(double_arcs(mesh.triangles, mesh.arc_edges, mesh.arc_circle, len(mesh.points))[0]) == 0
    a, b = (np.array([row.get(key, row.get("radius")) for row in COATED]) for key in "ab")
    thick = np.array([row.get("coating", 0.0) for row in COATED]) * np.sqrt(a * b)
    inner, outer = np.pi * a * b, np.pi * (a + thick) * (b + thick)
    rings = (outer - inner)[thick > 0]
    assert body_areas(mesh) == pytest.approx([1 - outer.sum(), *inner, *rings], rel=2e-3)


def test_coatings_of_nearly_round_ellipses_are_those_of_discs():
    rows = [{"x": 0.3, "y": 0.2, "a": 0.2 + 1e-9, "b": 0.2, "angle": 37.0, "coating": 0.1}]
    disc = [{"x": 0.3, "y": 0.2, "radius": 0.2, "coating": 0.1}]
    found, expected = (body_areas(generate(cell_of(table(each)))) for each in (rows, disc))
    assert found == pytest.approx(expected, rel=2e-4)


def test_centres_of_coatings_are_those_of_the_fibres():
    cell = cell_of(table(COATED))
    centres = fibre_circles(Torus.of(generate(cell)))[1:, :2]
    away = centres - arrange(cell).centres[[0, 1, 2, 3, 0, 1, 3]]
    assert np.abs(away - np.round(away)).max() < 1e-12


def test_coatings_that_overlap_are_reported():
    """The second lies above the first, 0.05 apart; coatings of a tenth of 0.2 are 0.02 thick each."""
    rows = [{"x": 0.5, "y": y, "a": 0.4, "b": 0.1} for y in (0.3, 0.55)]
    arrange(cell_of(table([row | {"coating": 0.1} for row in rows])))
    with pytest.raises(MeshError) as error:
        arrange(cell_of(table([row | {"coating": 0.15} for row in rows])))
    assert "[cell] t.csv: rows 1 and 2: overlap by 0.01" in error.value.faults
