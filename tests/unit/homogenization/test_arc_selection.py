"""Default sizes of elements at tips: as fine as the rest is accurate, and no finer than many tips allow."""

import numpy as np
import pytest
from support import cases

from feti_homog.homogenization import arc_selection
from feti_homog.mesh.fill.element_estimate import ElementEstimate, triangles_of_a_tip

CELL = {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.05}
RADIUS = np.sqrt(0.4 / np.pi)


def case_of(kind="stiffness", values=None, arcs=({"fibre": "all", "angle": 120.0},), **cell):
    arcs = [{name: value for name, value in arc.items() if values is None or name != "angle"} for arc in arcs]
    given = {"angle": {"angle": {"values": values}}, "path": {"path": {"strain": [1.0, 0.0, 0.0]}}}
    return cases.case_of(CELL | cell, interface={"debonded": arcs}, **given.get(kind, {}))


def size_of(case):
    return arc_selection.size(case, ElementEstimate.of(case.cell, None))


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("refine", [0, 1, 2])
def test_the_size_falls_as_the_error_of_the_rest(order, refine):
    found = size_of(case_of(order=order, refine=refine))
    expected = 2**refine * RADIUS * (0.05 / 2**refine / RADIUS) ** (2 * order) / 2
    assert found == pytest.approx(max(expected, 1e-5))


def test_tips_have_the_size_of_their_fibre_and_interface():
    found = size_of(case_of(geometry="random", fibres=16, order=2))
    radius = RADIUS / 4
    edge = 2 * np.pi * radius / 16
    assert found == pytest.approx(radius * (edge / radius) ** 4 / 2) and found > 8 * size_of(case_of(order=2))
    assert size_of(case_of(interface_size=0.01)) == pytest.approx(size_of(case_of(mesh_size=0.01)))
    assert size_of(case_of(tip_size=0.02)) == 0.02 and size_of(case_of("path", tip_size=0.02)) == 0.02
    assert size_of(case_of("path")) is None and size_of(case_of(arcs=())) is None
    assert size_of(case_of(arcs=({"fibre": 1, "angle": 360.0},))) is None


def test_many_openings_share_twice_the_elements_of_the_rest():
    """One opening of an angle has the tips of a stiffness; with 36 of them the mesh is three times as large."""
    assert size_of(case_of("angle", values=[120.0], order=2)) == size_of(case_of(order=2))
    case = case_of("angle", values=list(range(5, 181, 5)), order=2)
    size = size_of(case)
    added = 72 * triangles_of_a_tip(0.05 / size)
    assert added == pytest.approx(2 * ElementEstimate.of(case.cell, None).triangles, rel=0.01) and size > 0.005
