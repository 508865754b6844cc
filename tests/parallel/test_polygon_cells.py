"""L^ef of tables with rounded polygons: a monolithic solve, circles, a user's mesh of a square, laws."""

import numpy as np
import pytest
from support.cases import case_of, monolithic_stiffness, relative_error, solve
from support.ranks import assert_certified, write_once
from unit.mesh.faulty_meshes import grid

from feti_homog import run

pytestmark = pytest.mark.parallel

SQUARE = {"x": 0.5, "y": 0.5, "radius": 0.25 * 2**0.5, "sides": 4, "angle": 45.0}
ROWS = [
    {"x": 0.0, "y": 0.0, "radius": 0.25, "sides": 6, "corner": 0.2, "angle": 10.0},
    {"x": 0.5, "y": 0.5, "radius": 0.2},
    {"x": 0.05, "y": 0.5, "radius": 0.18, "sides": 3, "corner": 0.3, "angle": 90.0},
    {"x": 0.5, "y": 0.05, "a": 0.16, "b": 0.08, "angle": 30.0},
]


def table(*rows, **keys):
    return {"geometry": "table", "width": 1.0, "height": 1.0, "fibre_list": list(rows), "mesh_size": 0.1} | keys


def stiffness(comm, *rows, **keys):
    return solve(case_of(table(*rows, **keys)), comm)[1]


@pytest.mark.quick
@pytest.mark.parametrize(
    ("keys", "pieces"),
    [({"refine": 1}, {}), ({"order": 2}, {"decomposition": {"subdomains": 9}})],
)
def test_torn_polygons_have_the_monolithic_stiffness(comm, keys, pieces):
    torn, L, responses = solve(case_of(table(*ROWS, **keys), **pieces), comm)
    assert relative_error(L, monolithic_stiffness(torn)) < 1e-9
    assert max(max(r.checks.values()) for r in responses) < 1e-8


@pytest.mark.one_rank
@pytest.mark.parametrize("sides", [3, 8])
def test_a_corner_of_one_makes_a_circle(comm, sides):
    row = {"x": 0.5, "y": 0.5, "radius": 0.2 / np.cos(np.pi / sides), "sides": sides, "corner": 1.0}
    found = stiffness(comm, row, order=2, refine=1)
    expected = stiffness(comm, {"x": 0.5, "y": 0.5, "radius": 0.2}, order=2, refine=1)
    assert relative_error(found, expected) < 1e-5


@pytest.mark.one_rank
def test_a_sharp_square_is_that_of_a_users_mesh(comm, shared_path):
    """Compare squares on other nodes; both err at the corners."""
    write_once(comm, grid(), shared_path / "grid.msh")
    mesh = {"geometry": "mesh", "file": "grid.msh", "order": 2, "refine": 3}
    expected = solve(case_of(mesh, shared_path), comm)[1]
    found = stiffness(comm, SQUARE, order=2, refine=1)
    assert relative_error(found, expected) < 1e-3


@pytest.mark.one_rank
def test_turned_cells_have_turned_stiffnesses(comm):
    """A quarter of a turn leaves a square cell of a square alone, and a hexagon's shear coupling changes its sign."""
    square = stiffness(comm, SQUARE | {"corner": 0.3, "angle": 20.0}, order=2, refine=1)
    assert square[0, 0] == pytest.approx(square[1, 1], rel=1e-4)
    assert square[0, 2] == pytest.approx(-square[1, 2], abs=1e-4 * square[0, 0])
    hexagon = {"x": 0.5, "y": 0.5, "radius": 0.35, "sides": 6, "corner": 0.3}
    one, other = (stiffness(comm, hexagon | {"angle": turn}, order=2, refine=1) for turn in (10.0, 100.0))
    assert relative_error(other[[1, 0, 2]][:, [1, 0, 2]] * np.outer([1, 1, -1], [1, 1, -1]), one) < 1e-4


@pytest.mark.one_rank
def test_polygons_debond_and_are_certified(comm, shared_path):
    sections = {
        "interface": {"normal_strength": 2.0, "tangential_strength": 2.0},
        "path": {"strain": [1.0, 0.0, 0.0], "max_events": 200},
    }
    result = run(case_of(table(*ROWS[:2], mesh_size=0.4), **sections), comm, out=shared_path / "run")
    assert result.path[-1].debonded_share > 0.2
    perimeters = np.array([0.8 * 6 * 0.25 + 0.2 * 2 * np.pi * 0.25 * np.cos(np.pi / 6), 2 * np.pi * 0.2])
    for point in (result.path[0], result.path[-1]):  # angles of a polygon are fractions of 360
        assert point.debonding_angle == pytest.approx(360.0 * point.debonded_length / perimeters, rel=1e-6)
    assert_certified(comm, shared_path / "run")
