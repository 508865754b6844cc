"""L^ef of cells of tables and mixes: any origin, unit and order of rows; a lattice that is not rectangular."""

import numpy as np
import pytest
from support.cases import FIBRE, MATRIX, case_of, monolithic_stiffness, relative_error, solve

from feti_homog.mesh.arrange import arrange

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

STIFF = {"young": 400.0, "poisson": 0.1}
RANDOM = {"geometry": "random", "fibre_fraction": 0.45, "fibres": 8, "seed": 3, "radius_spread": 0.2,
          "mesh_size": 0.1}  # fmt: skip
MIXED = {"geometry": "random", "seed": 3}


def stiffness(comm, cell, **materials):
    """Return the torn cell and its stiffness. Collective."""
    material = {"matrix": MATRIX} | (materials or {"fibre": FIBRE})
    return solve(case_of({"mesh_size": 0.1} | cell, material=material), comm)[:2]


def listed(centres, radii, size, names):
    fibres = [
        {"x": x, "y": y, "radius": radius, "phase": name}
        for (x, y), radius, name in zip(centres.tolist(), radii.tolist(), names, strict=True)
    ]
    return {"geometry": "table", "width": float(size[0]), "height": float(size[1]), "fibre_list": fibres}


@pytest.mark.quick
def test_a_random_cell_from_its_table(comm, shared_path):
    arrangement, path = arrange(case_of(RANDOM).cell), shared_path / "t.csv"
    if comm.rank == 0:
        rows = np.column_stack([arrangement.centres, arrangement.radii])
        lines = ["# width = 1, height = 1, left = 0, bottom = 0", "x,y,radius"]
        path.write_text("\n".join([*lines, *(",".join(map(repr, row)) for row in rows.tolist())]))
    comm.barrier()
    found, expected = (stiffness(comm, cell)[1] for cell in ({"geometry": "table", "file": str(path)}, RANDOM))
    assert relative_error(found, expected) < 1e-9


@pytest.mark.quick
def test_origin_units_and_order_do_not_matter(comm):
    """Try fibres of two phases, numbered in the order of the rows."""
    arrangement = arrange(case_of(RANDOM).cell)
    names = np.array(["fibre", "fibre:2"])[np.arange(8) % 2]
    order = np.random.default_rng(1).permutation(8)
    centres = 137.3 * ((arrangement.centres + np.array([0.3, 0.6])) % 1.0) - np.array([50.0, -9.0])
    plain = listed(arrangement.centres, arrangement.radii, (1.0, 1.0), names.tolist())
    moved = listed(centres[order], 137.3 * arrangement.radii[order], (137.3, 137.3), names[order].tolist())
    materials = {"fibre": FIBRE, "fibre:2": STIFF}
    (_, expected), (cell, found) = (stiffness(comm, each, **materials) for each in (plain, moved))
    assert relative_error(found, expected) < 1e-9
    phases = cell.summary.constituent_phase[1:]
    assert [cell.summary.phases[phase] for phase in phases] == names[order].tolist()
    assert cell.summary.radii[1:] == pytest.approx(137.3 * arrangement.radii[order], rel=1e-8)


def test_a_square_lattice_along_its_diagonal_has_the_turned_stiffness(comm):
    """As "Lattices that are not rectangular" of meshes/README.md describes: w = sqrt(2), s = h = w / 2, q = 2."""
    fine, w = {"mesh_size": 0.12, "refine": 1, "order": 2}, np.sqrt(2)
    centres, radii = np.array([[0.0, 0.0], [w / 2, w / 2]]), np.full(2, np.sqrt(0.4 / np.pi))
    _, found = stiffness(comm, listed(centres, radii, (w, w), ["fibre"] * 2) | fine)
    _, square = stiffness(comm, {"geometry": "square", "fibre_fraction": 0.4} | fine)
    turn = np.array([[0.5, 0.5, 1.0], [0.5, 0.5, -1.0], [-0.5, 0.5, 0.0]])  # of stresses, to (1, 1) and (-1, 1)
    assert found == pytest.approx(turn @ square @ turn.T, abs=1e-5 * square.max())


@pytest.mark.quick
def test_two_phases_of_one_material_are_one_phase(comm):
    """Fibres of equal radii share the number 8 in proportion to their fractions, at the centres of the plain cell."""
    _, plain = stiffness(comm, MIXED | {"fibre_fraction": 0.4, "fibres": 8})
    mix = {"mix": {"glass": 0.1, "carbon": 0.3}, "fibres": 8}
    assert relative_error(stiffness(comm, MIXED | mix, glass=FIBRE, carbon=FIBRE)[1], plain) < 1e-9


@pytest.mark.quick
def test_a_mix_has_the_stiffness_of_its_mesh_solved_at_once(comm):
    mix = {"mix": {"glass": 0.25, "carbon": 0.2}, "radii": {"glass": 6.0, "carbon": 4.0}, "width": 40.0, "coating": 0.1}
    coating = {"young": 20.0, "poisson": 0.2}
    cell, found = stiffness(comm, MIXED | mix, glass=FIBRE, carbon=STIFF, coating=coating)
    assert cell.summary.width == pytest.approx(40.0)
    assert relative_error(found, monolithic_stiffness(cell)) < 1e-8
    assert np.argsort(cell.summary.phases[1:3]).tolist() == [0, 1]
