"""Numbers of triangles that are told before a cell of ellipses is meshed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipe
from unit.mesh.test_table_ellipses import cell_of, table

from feti_homog.fibres.arrange import arrange
from feti_homog.fibres.outlines.ellipses import Ellipses
from feti_homog.mesh.fill.gmsh_mesher import generate
from feti_homog.mesh.sizes.element_estimate import ElementEstimate


@pytest.mark.parametrize("ratio", [1.5, 4.0, 16.0])
@pytest.mark.parametrize(("interface_size", "within"), [(None, 0.3), (0.005, 0.2)])
def test_estimates_are_near_the_numbers_of_meshes(ratio, interface_size, within):
    row = {"x": 0.5, "y": 0.5, "a": 0.45, "b": 0.45 / ratio, "angle": 20.0}
    cell = cell_of(table([row]), interface_size=interface_size)
    assert ElementEstimate.of(cell, arrange(cell)).triangles == pytest.approx(len(generate(cell).triangles), rel=within)


def test_perimeters_are_elliptic_integrals():
    b = np.array([1.0, 0.5, 0.1, 0.05])
    found = Ellipses.of(np.zeros((4, 2)), np.ones(4), b, np.array([0.0, 10.0, 200.0, 90.0])).perimeters
    assert found == pytest.approx(4 * ellipe(1 - b**2), rel=1e-4)
