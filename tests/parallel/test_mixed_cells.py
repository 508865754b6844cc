"""L^ef of cells of several phases: that of one phase where they are alike, and of the table of their fibres."""

from pathlib import Path

import numpy as np
import pytest
from support.cases import FIBRE, MATRIX, monolithic_stiffness, relative_error, solve

from feti_homog.case import cases
from feti_homog.mesh.arrange import arrange

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

RANDOM = {"geometry": "random", "seed": 3, "mesh_size": 0.1}
STIFF = {"young": 400.0, "poisson": 0.1}
MIX, RADII = {"glass": 0.25, "carbon": 0.2}, {"glass": 6.0, "carbon": 4.0}


def case_of(cell, **materials):
    document = {
        "cell": cell,
        "material": {"matrix": MATRIX} | materials,
        "analysis": {"type": "stiffness", "plane": "strain"},
        "petsc": {"feti_ksp_rtol": 1e-11},
    }
    return cases.parse(document, Path())


@pytest.mark.quick
def test_two_phases_of_one_material_are_one_phase(comm):
    """With equal radii, where numbers are as the fractions, the centres are those of the cell of one phase."""
    plain = case_of(RANDOM | {"fibre_fraction": 0.4, "fibres": 8}, fibre=FIBRE)
    mixed = case_of(RANDOM | {"mix": {"glass": 0.1, "carbon": 0.3}, "fibres": 8}, glass=FIBRE, carbon=FIBRE)
    assert relative_error(solve(mixed, comm)[1], solve(plain, comm)[1]) < 1e-9


@pytest.mark.quick
def test_a_mix_is_the_table_of_its_fibres_in_any_order(comm):
    cell = RANDOM | {"mix": MIX, "radii": RADII, "fibres": 7}
    materials = {"glass": FIBRE, "carbon": STIFF}
    mixed = case_of(cell, **materials)
    found = arrange(mixed.cell)
    rows = [
        {"x": x, "y": y, "radius": radius, "phase": name}
        for (x, y), radius, name in zip(found.centres.tolist(), found.radii.tolist(), found.phase, strict=True)
    ]
    size = {"geometry": "table", "width": 1.0, "height": 1.0, "mesh_size": 0.1}
    turned = [rows[k] for k in np.random.default_rng(0).permutation(len(rows))]
    listed, permuted = (solve(case_of(size | {"fibre_list": own}, **materials), comm)[1] for own in (rows, turned))
    assert relative_error(permuted, listed) < 1e-9
    # another triangulation of the same cell
    assert relative_error(solve(mixed, comm)[1], listed) < 2e-3


@pytest.mark.quick
def test_a_mix_has_the_stiffness_of_its_mesh_solved_at_once(comm):
    cell, stiffness, _ = solve(
        case_of(RANDOM | {"mix": MIX, "radii": RADII, "width": 40.0, "coating": 0.1}, glass=FIBRE, carbon=STIFF,
                coating={"young": 20.0, "poisson": 0.2}), comm
    )  # fmt: skip
    assert cell.summary.width == pytest.approx(40.0)
    assert relative_error(stiffness, monolithic_stiffness(cell)) < 1e-8
    order = np.argsort(cell.summary.phases[1:3])
    assert order.tolist() == [0, 1]


@pytest.mark.quick
def test_names_do_not_matter_but_for_the_places_of_fibres(comm):
    """The phases of a mix are placed in the order of their names."""
    first = case_of(RANDOM | {"mix": {"a": 0.25, "b": 0.2}, "fibres": 6}, a=FIBRE, b=STIFF)
    second = case_of(RANDOM | {"mix": {"d": 0.2, "c": 0.25}, "fibres": 6}, d=STIFF, c=FIBRE)
    assert relative_error(solve(first, comm)[1], solve(second, comm)[1]) < 1e-12
