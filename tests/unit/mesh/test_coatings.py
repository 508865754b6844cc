"""Meshes of coated fibres: circles within circles, cut by the sides of the cell, thick and thin."""

import numpy as np
import pytest
from support.generated_meshes import generate, mesh_of_discs
from support.subdomains import cut

from feti_homog.case.cell_section import Cell
from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.coarse_mesh import areas, double_arcs
from feti_homog.mesh.mesh_fibres import fibre_circles
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.refinement import ReferenceLattice, refine
from feti_homog.microstructure.arrangements import Arrangement

CELLS = {
    "square": Cell(geometry="square", fibre_fraction=0.4, coating=0.05),
    "hexagonal": Cell(geometry="hexagonal", fibre_fraction=0.4, coating=0.2),
    "thin": Cell(geometry="hexagonal", fibre_fraction=0.4, coating=0.01),
    "thick": Cell(geometry="square", fibre_fraction=0.1, coating=1.0),
    "random": Cell(geometry="random", fibre_fraction=0.4, coating=0.02, fibres=5, seed=3, radius_spread=0.3),
}


@pytest.mark.parametrize("name", CELLS)
def test_each_phase_has_the_area_of_its_circles_and_no_element_turns_over(name):
    cell = CELLS[name]
    discs, torus = arrange(cell), Torus.of(generate(cell))
    mesh = torus.mesh
    assert mesh.phases == ("matrix", "fibre", "coating")
    assert len(double_arcs(mesh.triangles, mesh.arc_edges, mesh.arc_circle, len(mesh.points))[0]) == 0
    shares = np.zeros(3)
    for piece in cut(torus, torus.constituent):
        fine = refine(piece, ReferenceLattice.of(4, 1))
        own = areas(fine.points, fine.triangles)
        assert own.min() > 0
        shares[mesh.phases.index(piece.phase)] += own.sum()
    fibres = np.pi * (discs.radii**2).sum()
    outer = np.pi * (discs.outer_radii**2).sum()
    assert shares == pytest.approx([mesh.width * mesh.height - outer, fibres, outer - fibres], rel=1e-3)


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


def test_gaps_are_those_of_the_coatings():
    cell = Cell(geometry="random", fibre_fraction=0.3, coating=0.2, fibres=8, seed=1, min_gap=0.05)
    discs = arrange(cell)
    vector = discs.centres[:, None] - discs.centres
    distance = np.linalg.norm(vector - np.round(vector), axis=2) + 9 * np.eye(8)
    gap = distance - discs.outer_radii[:, None] - discs.outer_radii
    assert np.pi * (discs.radii**2).sum() == pytest.approx(0.3)
    assert gap.min() >= 0.05 * 2 * discs.radii.mean() * (1 - 1e-9)
