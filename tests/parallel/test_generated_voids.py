"""Cells whose voids the program meshes: against user's meshes, closed forms, other descriptions; their certificates."""

import numpy as np
import pytest
from support.cases import MATRIX, case_of, monolithic_stiffness, relative_error, solve
from support.generated_meshes import generate
from support.ranks import assert_certified
from support.void_cells import write_part

from feti_homog import run
from feti_homog.mesh.arrange import arrange

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

VOID = {"x": 0.0, "y": 0.0, "radius": 0.15, "phase": "void"}
OVAL = {"x": 0.5, "y": 0.02, "a": 0.16, "b": 0.08, "angle": 30.0, "phase": "void"}
ROWS = [VOID, {"x": 0.5, "y": 0.5, "radius": 0.2}, {"x": 0.9, "y": 0.55, "radius": 0.1}, OVAL]


def table(rows, **keys):
    return {"geometry": "table", "width": 1.0, "height": 1.0, "fibre_list": rows, "mesh_size": 0.1} | keys


def solved(comm, cell, *given, out=None, **sections):
    return run(case_of(cell, *given, **sections), comm, out=out)


@pytest.mark.one_rank
@pytest.mark.quick
@pytest.mark.parametrize("decomposition", [{}, {"subdomains": 5}])
def test_voids_of_a_table_are_those_of_a_mesh_with_holes(comm, shared_path, decomposition):
    """Both have the same nodes: the user's mesh has fibres, some of which are left out."""
    case = case_of(table([row | {"phase": "fibre"} for row in ROWS[:3]]))
    if comm.rank == 0:
        mesh = generate(case.cell)
        centres, number = mesh.points[mesh.triangles].mean(axis=1), mesh.precedence
        hole = np.argmin(np.linalg.norm((centres - arrange(case.cell).centres[0] + 0.5) % 1.0 - 0.5, axis=1))
        write_part(shared_path / "cell.msh", mesh, number != number[hole])
    comm.barrier()
    own = solved(comm, table(ROWS[:3], refine=1), decomposition=decomposition)
    mesh = {"geometry": "mesh", "file": "cell.msh", "voids": True, "refine": 1}
    other = solved(comm, mesh, folder=shared_path, decomposition=decomposition)
    assert own.cell.porosity == pytest.approx(other.cell.porosity, rel=1e-9)
    assert relative_error(own.effective_stiffness, other.effective_stiffness) < 1e-9


@pytest.mark.one_rank
@pytest.mark.parametrize(("a", "b"), [(0.04, 0.04), (0.06, 0.03), (0.02, 0.06)])
def test_a_small_elliptic_void_softens_as_the_dilute_limit_says(comm, a, b):
    """Compliances of plane stress grow in proportion to the area of an ellipse [Kachanov 1993].

    They grow by pi / (E A) times 2 b^2 + a b, 2 a^2 + a b, -a b and of shear 2 (a + b)^2, to first order in the area.
    """
    row = {"x": 0.5, "y": 0.5, "a": a, "b": b, "phase": "void"}
    cell = table([row], mesh_size=0.2, interface_size=0.01, order=2)
    L = solved(comm, cell, plane="stress", material={"matrix": MATRIX}).effective_stiffness
    young, poisson = MATRIX["young"], MATRIX["poisson"]
    bare = np.array([[1.0, -poisson, 0.0], [-poisson, 1.0, 0.0], [0.0, 0.0, 2 * (1 + poisson)]]) / young
    more = np.array([[2 * b * b + a * b, -a * b, 0.0], [-a * b, 2 * a * a + a * b, 0.0], [0.0, 0.0, 2 * (a + b) ** 2]])
    found = np.linalg.inv(L) - bare
    assert np.abs(found - np.pi / young * more).max() < 0.04 * np.pi / young * more.max()


@pytest.mark.parametrize("plane", ["strain", "stress", "generalized"])
def test_voids_soften_and_their_cells_are_certified(comm, shared_path, plane):
    random = {"geometry": "random", "fibres": 5, "fibre_fraction": 0.3, "seed": 1, "mesh_size": 0.1}
    whole = solved(comm, random, plane=plane)
    found = solved(comm, random | {"voids": 0.08, "void_radius": 0.5}, plane=plane, out=shared_path / "run")
    assert found.cell.porosity == pytest.approx(0.08, rel=0.1) and whole.cell.porosity == 0.0
    assert np.all(np.diag(found.effective_stiffness)[:2] < 0.9 * np.diag(whole.effective_stiffness)[:2])
    assert_certified(comm, shared_path / "run")


@pytest.mark.one_rank
def test_fibres_debond_beside_voids_to_the_end(comm, shared_path):
    random = {"geometry": "random", "fibres": 3, "fibre_fraction": 0.3, "seed": 4, "mesh_size": 0.15, "voids": 0.05}
    sections = {
        "interface": {"normal_strength": 2.0, "tangential_strength": 2.0},
        "path": {"strain": [1.0, 0.0, 0.0]},
    }
    result = solved(comm, random, out=shared_path / "run", **sections)
    assert result.path[-1].debonded_share > 0.2
    assert_certified(comm, shared_path / "run")


@pytest.mark.one_rank
def test_an_accuracy_counts_free_faces_of_voids():
    """With them a cell of hardly any contrast needs more."""
    asked = {"geometry": "table", "width": 1.0, "height": 1.0, "accuracy": 1e-3}
    alike = {"matrix": MATRIX, "fibre": MATRIX}
    plain, void = (case_of(asked | {"fibre_list": rows}, material=alike) for rows in (ROWS[1:3], ROWS[:3]))
    assert void.cell.refine > plain.cell.refine == 0


@pytest.mark.one_rank
def test_hollow_fibres_have_the_monolithic_stiffness(comm):
    rows = [VOID, ROWS[1] | {"inner_radius": 0.15}, {"x": 0.0, "y": 0.5, "radius": 0.15, "inner_radius": 0.05}]
    for pieces in ({}, {"decomposition": {"subdomains": 6}}):
        torn, L, _ = solve(case_of(table(rows, refine=1), **pieces), comm)
        assert relative_error(L, monolithic_stiffness(torn)) < 1e-9
