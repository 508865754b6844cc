"""Hollow fibres of tables: what is meshed, what is listed, faults."""

from pathlib import Path

import numpy as np
import pytest
from support.generated_meshes import generate

from feti_homog.case import cases
from feti_homog.errors import CaseError
from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.mesh_fibres import fibre_circles
from feti_homog.mesh.periodic_topology import Torus

TUBE = {"x": 0.0, "y": 0.0, "radius": 0.2, "inner_radius": 0.12}
COATED = {"x": 0.5, "y": 0.5, "radius": 0.2, "coating": 0.2}
OVAL = {"x": 0.5, "y": 0.1, "a": 0.16, "b": 0.08, "angle": 30.0}
VOID = {"x": 0.05, "y": 0.5, "radius": 0.15, "phase": "void"}


def case_of(*rows, coated=False, **cell):
    phases = ("matrix", "fibre", "coating") if coated else ("matrix", "fibre")
    table = {"geometry": "table", "width": 1.0, "height": 1.0, "fibre_list": list(rows), "mesh_size": 0.03} | cell
    material = {phase: {"young": 3.0, "poisson": 0.3} for phase in phases}
    return cases.parse(
        {"cell": table, "material": material, "analysis": {"type": "stiffness", "plane": "strain"}}, Path()
    )


@pytest.mark.parametrize("more", [(), (OVAL,)], ids=["circles", "ellipses"])
def test_a_hollow_fibre_is_a_ring_around_a_void(more):
    mesh = generate(case_of(COATED, TUBE, VOID, *more, coated=True).cell)
    assert Torus.of(mesh).voids == 2 and mesh.phases == ("matrix", "fibre", "coating")
    found = areas(mesh.points, mesh.triangles)
    own = (mesh.precedence == 2) & (mesh.phase == 1)
    assert found[own].sum() == pytest.approx(np.pi * (0.2**2 - 0.12**2), rel=0.02)
    assert 1 - found.sum() == pytest.approx(np.pi * (0.12**2 + 0.15**2), rel=0.02)
    torus = Torus.of(mesh)
    tube = np.unique(torus.constituent[own])
    assert len(tube) == 1 and fibre_circles(torus)[tube[0], 2] == pytest.approx(0.2)


@pytest.mark.parametrize(("row", "words"), [
    ({"inner_radius": 0.2}, "expected inner_radius / radius from 0.05 to 0.98, or 0"),
    ({"inner_radius": 0.001}, "expected inner_radius / radius from 0.05 to 0.98, or 0"),
    ({"inner_radius": -0.1}, "inner_radius = -0.1: expected a number at least 0"),
    ({"coating": 0.1}, "has an inner_radius and a coating; give one"),
    ({"phase": "void"}, "inner_radius = 0.12: a void has none"),
])  # fmt: skip
def test_faults(row, words):
    with pytest.raises(CaseError) as caught:
        case_of(TUBE | row, OVAL, coated="coating" in row)
    assert caught.value.faults[0].endswith(f"row 1: {words}")


def test_an_ellipse_is_not_hollow():
    with pytest.raises(CaseError, match="row 1: has an inner_radius, which only round fibres may have"):
        case_of(OVAL | {"inner_radius": 0.05})
