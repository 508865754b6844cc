"""Estimated errors by the mesh of the loads at which the first bonds break."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.cases import FIBRE, MATRIX

from feti_homog import Case, run
from feti_homog.materials.voigt import voigt_names

pytestmark = pytest.mark.parallel

STRENGTHS = {"normal_strength": 5.0, "tangential_strength": 5.0}
SPRINGS = {"normal_stiffness": 900.0, "tangential_stiffness": 300.0}
BONDS = {
    "strength": STRENGTHS,
    "energy": SPRINGS | {"law": "energy", "toughness": 0.02},
    "arc": SPRINGS | STRENGTHS | {"debonded": [{"fibre": "all", "centre": 20.0, "angle": 90.0}], "contact": False},
    "released": {"normal_stiffness": 20.0, "tangential_stiffness": 5.0, "law": "energy", "toughness": 0.02}
    | {"growth": "released", "debonded": [{"fibre": "all", "centre": 20.0, "angle": 90.0}], "contact": False},
}


def case(bonds: dict[str, Any], kind: str, mesh: dict[str, Any], plane: str = "strain", **more: Any) -> Case:
    """Return a case of the onset in a square cell."""
    cell = {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.1} | mesh
    document = {"cell": cell, "material": {"matrix": MATRIX, "fibre": FIBRE}, "interface": bonds}
    return Case.parse(document | {"analysis": {"type": kind, "plane": plane}} | more)


def envelope(comm, bonds, mesh, state="strain", **more):
    section = {"envelope": {"plane": ["E11", "gamma12"], "directions": 4} | more}
    return run(case(bonds, "envelope", mesh, state, **section), comm)


@pytest.mark.parametrize("plane", ["strain", "generalized"])
@pytest.mark.parametrize("name", BONDS)
def test_the_first_break_of_a_path_errs_as_that_of_the_envelope(comm, name, plane):
    mesh = {"order": 2, "mesh_size": 0.3}
    at = envelope(comm, BONDS[name], mesh, plane).envelope[0]
    keys = {
        "path": {"to": {"E11": 1.01 * at.factor} | dict.fromkeys(voigt_names(len(at.strain))[0][1:], 0.0)},
        "output": {"states": 2},
    }
    points = run(case(BONDS[name], "path", mesh, plane, **keys), comm, fields=True).path
    assert points[0].load_factor == pytest.approx(1 / 1.01, rel=1e-6)
    assert points[0].load_mesh_error == pytest.approx(at.mesh_error, rel=1e-4)
    assert points[-1].broke == 0 and points[-1].load_mesh_error is None


@pytest.mark.parametrize(("order", "name"), [(1, "energy"), (2, "strength"), (1, "arc"), (1, "released")])
def test_errors_are_those_against_a_finer_mesh(comm, order, name):
    fine, found = (envelope(comm, BONDS[name], mesh).envelope for mesh in ({"order": 2, "refine": 2}, {"order": order}))
    off = np.abs([a.factor / b.factor - 1 for a, b in zip(found, fine, strict=True)])
    ratio = off / [point.mesh_error for point in found]
    assert 0.25 < np.median(ratio) < 2.5
    assert (ratio < 5.0).sum() >= 3  # in one direction beside arcs another bond governs on the finer mesh


def test_tips_of_rigid_bonds_have_no_limit(comm):
    arc = STRENGTHS | {"debonded": [{"fibre": "all", "centre": 20.0, "angle": 90.0}], "contact": False}
    found = envelope(comm, arc, {})
    assert all(point.mesh_error is None and point.factor is not None for point in found.envelope)
    assert sum("no error of the loads" in remark for remark in found.remarks) == 1


def test_tips_that_are_not_pulled_have_no_part_in_errors(comm):
    # Without a tangential strength pressed bonds use nothing, those beside a tip and tips themselves.
    arc = SPRINGS | {"normal_strength": 5.0, "debonded": [{"fibre": "all", "angle": 90.0}], "contact": False}
    mesh = {"order": 2, "mesh_size": 0.3}
    found = envelope(comm, arc, mesh, plane=["E11", "E22"], directions=24).envelope
    assert all(0.0 < point.mesh_error <= 1.0 for point in found if point.factor is not None)
    keys = {"path": {"strain": [0.0, 0.0, 0.1]}, "output": {"states": "all"}}
    points = [point for point in run(case(arc, "path", mesh, **keys), comm, fields=True).path if point.broke]
    assert points and all(0.0 < point.load_mesh_error <= 1.0 for point in points)


def test_what_bonds_may_use_is_continuous_where_another_one_breaks_first(comm):
    points = envelope(comm, STRENGTHS, {}, directions=720).envelope
    most = np.array([(1.0 + point.mesh_error) / point.factor for point in points])
    jump, place = np.abs(most / np.roll(most, 1) - 1.0), np.array([point.bond_angle for point in points])
    another = place != np.roll(place, 1)
    assert another.sum() > 8 and jump[another].max() < jump[~another].max()
