"""Numbers, centres and corners of fibres, and the curves that a user's mesh has debonded."""

from dataclasses import replace

import numpy as np
import pytest
from support.generated_meshes import generate, mesh_of_discs
from unit.mesh.faulty_meshes import ALL_SIDES, FIBRE, MATRIX, RIGHT_SIDE, grid, node

from feti_homog.case.cell_section import Cell
from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.mesh_fibres import fibre_circles, has_corners
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.readers.msh_reader import read


def circles_of(mesh):
    torus = Torus.of(mesh)
    return torus, fibre_circles(torus)


def centres_of(mesh):
    torus, circles = circles_of(mesh)
    return torus, circles[:, :2]


@pytest.mark.parametrize(
    "cell",
    [
        Cell(geometry="square", fibre_fraction=0.4),
        Cell(geometry="hexagonal", fibre_fraction=0.5, mesh_size=0.1),
        Cell(geometry="random", fibre_fraction=0.4, fibres=1, mesh_size=0.1),
        *(Cell(geometry="random", fibre_fraction=0.5, fibres=20, seed=seed, mesh_size=0.1) for seed in range(3)),
        Cell(geometry="random", fibre_fraction=0.5, fibres=9, radius_spread=0.4, mesh_size=0.1),
    ],
    ids=lambda cell: f"{cell.geometry} {cell.fibres} {cell.seed}",
)
def test_fibres_are_numbered_as_arranged(cell):
    """Also those that the boundary cuts, whose images come from all sides."""
    arrangement = arrange(cell)
    _, circles = circles_of(generate(cell))
    size = np.array([arrangement.width, arrangement.height])
    offset = circles[1:, :2] - arrangement.centres
    assert np.abs(offset - np.round(offset / size) * size).max() < 1e-12
    assert circles[1:, 2] == pytest.approx(arrangement.radii, rel=1e-12)
    assert np.isnan(circles[0]).all()


def test_fibres_of_many_phases_are_numbered_as_arranged():
    cell = Cell(geometry="random", fibre_fraction=0.5, fibres=7, mesh_size=0.1)
    names = ("b", "a", "a", "c", "b", "a", "c")
    arrangement = replace(arrange(cell), phase=names)
    torus, circles = circles_of(mesh_of_discs(arrangement))
    offset = circles[1:, :2] - arrangement.centres
    assert np.abs(offset - np.round(offset)).max() < 1e-12
    assert torus.mesh.phases == ("matrix", "b", "a", "c")
    assert [torus.mesh.phases[phase] for phase in torus.constituent_phase] == ["matrix", *names]


def test_numbers_do_not_depend_on_marks():
    cell = Cell(geometry="random", fibre_fraction=0.5, fibres=12, mesh_size=0.1)
    _, plain = centres_of(generate(cell))
    _, marked = centres_of(generate(cell, {3: (10.0, 200.0), 7: (0.0,)}))
    assert np.array_equal(plain, marked, equal_nan=True)


def test_polygons_have_the_centre_of_their_area_and_layers_none(tmp_path):
    grid().write(tmp_path / "good.msh")
    _, circles = circles_of(read(tmp_path / "good.msh"))
    assert circles[1, :2] == pytest.approx([0.5, 0.5]) and np.isnan(circles[1, 2])
    grid(lambda x, y: abs(y - 0.5) < 0.25).write(tmp_path / "good.msh")
    _, centres = centres_of(read(tmp_path / "good.msh"))
    assert np.isnan(centres).all()


def test_a_fibre_around_the_corner_has_its_centre_at_the_corner(tmp_path):
    """An L of three quarters: areas at (1/4, 1/4), (3/4, 1/4), (1/4, 3/4) of a square about the corner."""
    inside = lambda x, y: (x > 0.75 or x < 0.25) and (y > 0.75 or y < 0.25) and not (x < 0.25 and y < 0.25)  # noqa: E731
    grid(inside).write(tmp_path / "good.msh")
    _, centres = centres_of(read(tmp_path / "good.msh"))
    assert centres[1] % 1.0 == pytest.approx([1 - 1 / 24, 1 - 1 / 24])


@pytest.mark.parametrize(("fibre", "expected"), [
    (lambda x, y: abs(x - 0.5) < 0.25, False),
    (lambda x, y: max(abs(x - 0.5), abs(y - 0.5)) < 0.25, True),
    (lambda x, y: (x < 0.5) == (y < 0.5), True),
], ids=["stripe", "square", "checkerboard"])  # fmt: skip
def test_stripes_have_no_corners(fibre, expected, tmp_path):
    grid(fibre).write(tmp_path / "good.msh")
    assert has_corners(Torus.of(read(tmp_path / "good.msh"))) == expected


@pytest.mark.parametrize("lines", [RIGHT_SIDE, ALL_SIDES], ids=["open", "closed"])
def test_debonded_lines_come_back(lines, tmp_path):
    mesh = grid().with_curve(lines)
    mesh.write(tmp_path / "good.msh")
    result = read(tmp_path / "good.msh")
    expected = {frozenset((mesh.nodes[a][:2], mesh.nodes[b][:2])) for a, b in lines}
    found = {frozenset(map(tuple, ends)) for ends in result.points[result.debonded_edges].tolist()}
    assert found == expected


@pytest.mark.parametrize("side", [0, 4])
def test_debonded_lines_on_either_side_of_the_cell(side, tmp_path):
    """A fibre that ends at the right side, where the matrix begins at the left one."""
    mesh = grid(lambda x, y: x > 0.5 and 0.25 < y < 0.75).with_curve([(node(side, 1), node(side, 2))])
    mesh.write(tmp_path / "good.msh")
    result = read(tmp_path / "good.msh")
    torus = Torus.of(result)
    (edge,) = torus.plane_edges(result.debonded_edges)
    assert result.points[result.debonded_edges[0], 0].tolist() == [side / 4] * 2
    assert np.count_nonzero(torus.torus_edge == torus.torus_edge[edge]) == 2


def _layers():
    """Rows of squares from below: matrix, fibre, and two of fibre:2."""
    mesh = grid(lambda x, y: y > 0.25)
    upper = {tag: (kind, 3, 3, nodes) for tag, (kind, _, _, nodes) in mesh.elements.items() if tag > 16}
    names = {MATRIX: "matrix", FIBRE: "fibre", 3: "fibre:2"}
    return replace(mesh, elements=mesh.elements | upper, names=names)


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (
            grid().with_curve([*RIGHT_SIDE, (node(0, 0), node(0, 1)), (node(1, 1), node(2, 2))]),
            'lines in the physical curve "debonded" that are not between a fibre and the matrix: the edge between '
            "node 1 (0, 0) and node 6 (0, 0.25), the edge between node 7",
        ),
        (grid().with_curve([(node(1, 1), node(3, 1))]), "not between a fibre and the matrix: the edge between node 7"),
        (
            replace(grid(), nodes={**grid().nodes, 99: (0.1, 0.1, 0.0)}).with_curve([(1, 99)]),
            'lines in the physical curve "debonded" that are no edges of triangles: that between nodes 1 and 99',
        ),
        (
            _layers().with_curve([(node(0, 2), node(1, 2))]),
            "not between a fibre and the matrix: the edge between node 11",
        ),
    ],
    ids=["bonds elsewhere", "no edge", "loose node", "two fibres"],
)
def test_lines_that_cannot_debond_are_refused(mesh, message, tmp_path):
    (fault,) = mesh.faults(tmp_path)
    assert fault.startswith("faulty.msh: ") and message in fault
