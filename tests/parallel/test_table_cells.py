"""L^ef of cells of tables: that of the cell they are made of, and the same for any origin, unit and order of rows."""

from pathlib import Path

import numpy as np
import pytest
from support.cases import FIBRE, MATRIX, relative_error, solve

from feti_homog.case import cases
from feti_homog.mesh.arrange import arrange

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

PHASES = {"matrix": MATRIX, "fibre": FIBRE, "fibre:2": {"young": 400.0, "poisson": 0.1}}
RANDOM = {"geometry": "random", "fibre_fraction": 0.45, "fibres": 8, "seed": 3, "radius_spread": 0.2}


def case_of(cell, *names):
    document = {
        "cell": {"mesh_size": 0.1} | cell,
        "material": {name: PHASES[name] for name in ("matrix", "fibre", *names)},
        "analysis": {"type": "stiffness", "plane": "strain"},
        "petsc": {"feti_ksp_rtol": 1e-11},
    }
    return cases.parse(document, Path())


def listed(centres, radii, size, names):
    fibres = [
        {"x": x, "y": y, "radius": radius, "phase": name}
        for (x, y), radius, name in zip(centres.tolist(), radii.tolist(), names, strict=True)
    ]
    return {"geometry": "table", "width": float(size[0]), "height": float(size[1]), "fibre_list": fibres}


@pytest.mark.quick
def test_a_random_cell_from_its_table(comm, shared_path):
    built = case_of(RANDOM)
    arrangement = arrange(built.cell)
    path = shared_path / "t.csv"
    if comm.rank == 0:
        rows = np.column_stack([arrangement.centres, arrangement.radii])
        lines = ["# width = 1, height = 1, left = 0, bottom = 0", "x,y,radius"]
        path.write_text("\n".join([*lines, *(",".join(map(repr, row)) for row in rows.tolist())]))
    comm.barrier()
    found, expected = (solve(case, comm)[1] for case in (case_of({"geometry": "table", "file": str(path)}), built))
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
    (_, expected, _), (cell, found, _) = (solve(case_of(each, "fibre:2"), comm) for each in (plain, moved))
    assert relative_error(found, expected) < 1e-9
    phases = cell.summary.constituent_phase[1:]
    assert [cell.summary.phases[phase] for phase in phases] == names[order].tolist()
    assert cell.summary.radii[1:] == pytest.approx(137.3 * arrangement.radii[order], rel=1e-8)


def test_equal_phases_under_two_names_are_one(comm, monkeypatch):
    monkeypatch.setitem(PHASES, "fibre:2", FIBRE)
    arrangement = arrange(case_of(RANDOM).cell)
    names = [["fibre"] * 8, ["fibre:2", "fibre"] * 4]
    tables = [listed(arrangement.centres, arrangement.radii, (1.0, 1.0), each) for each in names]
    cases_ = [case_of(tables[0]), case_of(tables[1], "fibre:2")]
    found, expected = (solve(case, comm)[1] for case in cases_)
    assert relative_error(found, expected) < 1e-9
