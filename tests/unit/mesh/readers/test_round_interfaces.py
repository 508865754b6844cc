"""Elliptic fibres in meshes of straight edges: found wherever they lie, and followed by refinement."""

import re

import meshio
import numpy as np
import pytest
from support.subdomains import cut
from support.users_meshes import fibre_area, polar_cell

from feti_homog.mesh.mesh_fibres import fibre_circles
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.readers.msh_reader import read
from feti_homog.mesh.readers.round_interfaces import fit_ellipse
from feti_homog.mesh.refinement import ReferenceLattice, refine

A, B, TURN = 0.3, 0.2, 0.4


@pytest.mark.parametrize("turn", [0.0, 0.4, np.pi / 2, 2.5])
@pytest.mark.parametrize(("a", "b"), [(0.3, 0.2), (0.2, 0.2), (1e-3, 4e-3), (30.0, 1.0)])
def test_fit_gives_back_the_ellipse(a, b, turn):
    t = np.sort(np.random.default_rng(1).uniform(0, 2 * np.pi, 40))
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    centre = np.array([0.7, -0.2])
    ellipse = fit_ellipse(centre + (turned @ np.diag([a, b]) @ [np.cos(t), np.sin(t)]).T)
    assert ellipse is not None and ellipse.centres[0] == pytest.approx(centre, abs=1e-10)
    square = turned @ np.diag([a**2, b**2]) @ turned.T
    assert ellipse.squares[0] == pytest.approx(square, rel=1e-8, abs=1e-8 * a * b)


@pytest.mark.parametrize(
    "places",
    [
        np.stack([np.cos(np.arange(20) * np.pi / 10), np.sin(np.arange(20) * np.pi / 10) ** 3], axis=1),
        np.stack([np.arange(20.0), np.arange(20.0) ** 2], axis=1),
        np.stack([np.arange(20.0), np.ones(20)], axis=1),
        np.stack([np.cos(np.linspace(0, 3, 20)), np.sin(np.linspace(0, 3, 20))], axis=1),
    ],
    ids=["astroid", "parabola", "line", "half a circle"],
)
def test_other_chains_are_no_ellipses(places):
    assert fit_ellipse(places) is None


@pytest.mark.parametrize("centre", [(0.5, 0.5), (0.0, 0.0), (0.93, 0.08)])
def test_fine_nodes_lie_on_the_ellipse_wherever_the_cell_cuts_it(centre, tmp_path):
    """Coarse edges miss the ellipse by h^2."""
    polar_cell(centre, B, tmp_path / "ellipse.msh", stretch=A / B, turn=TURN, size=0.06)
    mesh = read(tmp_path / "ellipse.msh")
    torus = Torus.of(mesh)
    assert len(mesh.arc_edges) > 20 and np.isnan(fibre_circles(torus)[1, 2])
    off = []
    for piece in cut(torus, torus.constituent):
        ends = piece.edges[piece.turns > 0]
        middle = piece.points[ends].mean(axis=1)
        fine = refine(piece, ReferenceLattice.of(1, 1))
        nodes = fine.points[len(piece.points) : len(piece.points) + len(piece.edges)][piece.turns > 0]
        off.append([np.abs(_level(points, centre) - 1).max() for points in (middle, nodes)])
    assert np.max(off, axis=0)[0] > 5e-3 and np.max(off, axis=0)[1] < 1e-9


@pytest.mark.parametrize(("stretch", "source", "order"), [(1.5, 1, 2), (3.0, 1, 2), (1.5, 2, 1), (1.5, 2, 2)])
def test_areas_approach_that_of_the_ellipse_by_h2(stretch, source, order, tmp_path):
    """Compare polygons of nodes in the middle of the parameter: each halving quarters the missing area.

    The file is a mesh of the order `source`.
    """
    polar_cell((0.5, 0.5), 0.15, tmp_path / "ellipse.msh", stretch=stretch, order=source, size=0.06, turn=TURN)
    mesh, exact = read(tmp_path / "ellipse.msh"), np.pi * 0.15**2 * stretch
    missing = [1 - fibre_area(mesh, refinements, order) / exact for refinements in range(5)]
    assert np.array(missing[:-1]) / missing[1:] == pytest.approx(4.0, rel=2e-2) and 0 < missing[-1] < 1e-4


@pytest.mark.parametrize("stretch", [1.0, 1.5])
@pytest.mark.parametrize(("digits", "remarks"), [(8, 0), (5, 1), (3, 1), (2, 0)])
def test_fibres_of_rounded_coordinates_are_polygons_with_a_remark(stretch, digits, remarks, tmp_path):
    """Two digits are far from round; middle nodes bend edges, however rounded."""
    path = tmp_path / "a.vtu"
    for order in (1, 2):
        polar_cell((0.5, 0.5), 0.2, tmp_path / "a.msh", stretch=stretch, size=0.06, order=order)
        source = meshio.read(tmp_path / "a.msh")
        source.points = np.round(source.points, digits)
        numbers = [np.asarray(block) for block in source.cell_data["gmsh:physical"]]
        meshio.Mesh(source.points, source.cells, cell_data={"phase": [k - 1 for k in numbers]}).write(path)
        found = read(path).remarks
        assert len(found) == remarks * (order == 1)
        for line in found:
            axes = re.search(r"semi-axes (\S+) and (\S+) around \((\S+), (\S+)\), off by ", line).groups()
            exact = [max(0.2, 0.2 * stretch), min(0.2, 0.2 * stretch), 0.5, 0.5]
            assert [float(word) for word in axes] == pytest.approx(exact, abs=10.0**-digits)
        assert (len(read(path).arc_edges) == 0) == (order == 1 and digits < 8)


def test_thin_ellipse_with_few_edges_stays_a_polygon(tmp_path):
    polar_cell((0.5, 0.5), 0.02, tmp_path / "thin.msh", stretch=20.0, size=0.2)
    assert len(read(tmp_path / "thin.msh").arc_edges) == 0


def _level(points, centre):
    """(k,) 1 on the ellipse of semi-axes A and B about the nearest image of the centre."""
    away = points - centre
    away -= np.round(away)
    along = away @ [np.cos(TURN), np.sin(TURN)], away @ [-np.sin(TURN), np.cos(TURN)]
    return np.hypot(along[0] / A, along[1] / B)
