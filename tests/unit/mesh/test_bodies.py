"""Bodies of a cell: numbers, centres, corners of fibres, debonded curves, nesting, vertices at which bodies touch."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.generated_meshes import generate, mesh_of_discs
from support.pixel_images import SYMMETRIES, pixel_mesh
from support.void_cells import write_rings
from unit.case.test_interface_pairs import Case, document
from unit.mesh.faulty_meshes import ALL_SIDES, FIBRE, MATRIX, RIGHT_SIDE, grid, node

from feti_homog.case.cell_section import Cell
from feti_homog.homogenization import cell_remarks
from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.mesh_fibres import corner_edges, fibre_circles, fibre_numbers
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.readers.msh_reader import read
from feti_homog.mesh.submeshes import pinned_classes


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
    (lambda x, y: abs(x - 0.5) < 0.25, 0),
    (lambda x, y: max(abs(x - 0.5), abs(y - 0.5)) < 0.25, 2),
    (lambda x, y: (x < 0.5) == (y < 0.5), 4),
], ids=["stripe", "square", "checkerboard"])  # fmt: skip
def test_stripes_have_no_corners(fibre, expected, tmp_path):
    grid(fibre).write(tmp_path / "good.msh")
    assert corner_edges(Torus.of(read(tmp_path / "good.msh"))) == expected


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


@pytest.fixture
def coated(tmp_path):
    write_rings(tmp_path / "coated.msh", "fibre", "fibre:2")
    return read(tmp_path / "coated.msh")


@pytest.mark.parametrize("order", [("matrix", "fibre", "coating"), ("matrix", "coating", "fibre")])
def test_a_coating_is_around_its_fibre_whatever_the_order_of_phases(coated, order):
    named = np.array([order.index(name) for name in ("matrix", "fibre", "coating")], np.int32)
    mesh = replace(coated, phase=named[coated.phase], precedence=named[coated.phase], phases=order)
    torus = Torus.of(mesh)
    inwards = [order[torus.constituent_phase[body]] for body in np.argsort(torus.nesting)]
    assert inwards == ["matrix", "coating", "fibre"]
    number, is_fibre = fibre_numbers(torus)
    assert number[torus.constituent_phase == 0] == 0 and (number[torus.constituent_phase > 0] == 1).all()
    assert [order[phase] for phase in torus.constituent_phase[is_fibre]] == ["fibre"]


def test_other_phases_have_numbers_of_their_own_and_nest_by_their_place(coated):
    torus = Torus.of(coated)
    assert fibre_numbers(torus)[0].tolist() == [0, 1, 2]
    assert torus.nesting.tolist() == [0, 2, 1]


def test_a_coating_without_a_fibre_is_a_fibre(tmp_path):
    grid().write(tmp_path / "one.msh")
    torus = Torus.of(replace(read(tmp_path / "one.msh"), phases=("matrix", "coating")))
    number, is_fibre = fibre_numbers(torus)
    assert number.tolist() == [0, 1] and is_fibre.tolist() == [False, True]


@pytest.mark.parametrize(
    "pair, words",
    [
        (["matrix", "glass"], 'the cell has no phase "glass"; it has matrix, fibre, fibre:2'),
        (["matrix", "fibre"], "expected phases that touch"),
    ],
)
def test_pairs_that_the_cell_does_not_have_are_reported(coated, pair, words):
    case = Case.parse(document({"normal_strength": 1.0, "between": pair}))
    (fault,) = cell_remarks.faults(case, coated.phases, *(coated.phase[each] for each in Torus.of(coated).sides[:2]))
    assert fault.startswith("[interface] between = [") and words in fault


# Rows from below: the fibre winds around the cell along the lowest, and its branches touch at (1, 2) / 4.
BRANCHES = np.array([[1, 1, 1, 1], [1, 0, 0, 0], [0, 1, 0, 0], [0, 1, 0, 0]])
# A void at the corner (2, 2) / 5 of the fibre, which elsewhere is in the matrix; then along its side.
VOID_AT_CORNER = np.array([[0, 0, 0, 0, 0], [0, 1, 0, 0, 0], [0, 0, -1, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 0]])
VOID_AT_SIDE = np.array([[0, 0, 0, 0, 0], [0, 1, -1, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 0]])
# Two fibres that touch, and so three bodies meet.
TWO_FIBRES = np.array([[0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 0]])


def torus_of(folder: Path, image: np.ndarray, jitter: float = 0.0, symmetry: np.ndarray = SYMMETRIES[0]) -> Torus:
    pixel_mesh(image, jitter, symmetry).write(folder / "pixels.msh")
    return Torus.of(read(folder / "pixels.msh", has_voids=True))


def places(torus: Torus, classes: np.ndarray, size: int) -> set[tuple[float, float]]:
    """Return the plane nodes of some classes, in pixels."""
    found = torus.mesh.points[classes[torus.node_class]] * size
    return {tuple(place) for place in np.round(found, 1).tolist()}


@pytest.mark.parametrize(
    ("image", "touching", "triple"),
    [
        (BRANCHES, {(1, 2)}, set()),
        (VOID_AT_CORNER, {(2, 2)}, set()),
        (VOID_AT_SIDE, set(), set()),
        (TWO_FIBRES, set(), {(2, 2)}),
    ],
    ids=["branches", "void at a corner", "void at a side", "two fibres"],
)
def test_bodies_that_do_not_meet_along_one_line_are_found_without_coordinates(
    tmp_path: Path, image: np.ndarray, touching: set, triple: set
) -> None:
    for symmetry, jitter in zip(SYMMETRIES, itertools.cycle([0.0, 1e-9, 1e-2]), strict=False):
        torus, size = torus_of(tmp_path, image, jitter, symmetry), len(image)
        turned = [
            {tuple(np.round((np.array(place) - size / 2) @ symmetry.T + size / 2, 1).tolist()) for place in some}
            for some in (touching, triple)
        ]
        assert [places(torus, torus.touching, size), places(torus, torus.meeting > 2, size)] == turned
        assert np.array_equal(torus.never_part, torus.touching | (torus.meeting > 2))


def test_what_never_parts_is_pinned_rather_than_what_may(tmp_path: Path) -> None:
    """Where no node is inside a body."""
    torus = torus_of(tmp_path, np.kron(np.array([[1, 0], [0, 1]]), np.ones((1, 1), int)))
    assert torus.never_part.all()
    torus = torus_of(tmp_path, BRANCHES)
    inside = torus.meeting == 1
    assert inside[pinned_classes(torus)]
    thin = torus_of(tmp_path, np.array([[1, 1, 1], [1, 0, 0], [0, 1, 0]]))
    assert not (thin.meeting == 1).any() and thin.never_part[pinned_classes(thin)]
