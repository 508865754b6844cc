"""Quantities that are integrated along curved interfaces: rates at which they converge, by shape and order."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.cases import FIBRE, MATRIX

from feti_homog.case import case as cases
from feti_homog.homogenization.unit_cell import tear
from feti_homog.system.runtime.progress import Progress

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

ELLIPSE = {"x": 0.5, "y": 0.5, "a": 0.4, "b": 0.15, "angle": 20.0}
# On circles with equal sides the sums err by less than any power.
ROUNDED = 1e-12
# A row of the table of fibres, and the points and |dx / dt| of its outline at the parameters t, from 0 to 2 pi.
A, B, TURN = 0.4, 0.15, np.radians(20.0)
SHAPES = {
    "circle": ({"x": 0.5, "y": 0.5, "radius": 0.3}, 0.3, 0.3, 0.0),
    "ellipse": (ELLIPSE, A, B, TURN),
}


def moments(points):
    """(3, k) smooth functions of points (k, 2) on the torus."""
    x, y = 2 * np.pi * points.T
    return np.stack([np.ones_like(x), np.exp(np.sin(x)) * np.cos(y), np.sin(x + 2 * y + 1.0)])


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("shape", SHAPES)
def test_lengths_of_nodes_integrate_along_the_interface(comm, shape, order):
    """Errors fall by 4 with linear elements and by 16 with quadratic ones, as those of the displacements."""
    row, a, b, turn = SHAPES[shape]
    errors = []
    for refine in range(3):
        cell = {"geometry": "table", "width": 1.0, "height": 1.0, "fibre_list": [row], "mesh_size": 0.3}
        document = {
            "cell": cell | {"order": order, "refine": refine},
            "material": {"matrix": MATRIX, "fibre": FIBRE},
            "interface": {"normal_stiffness": 10.0, "tangential_stiffness": 10.0},
            "analysis": {"type": "stiffness", "plane": "strain"},
        }
        cell = tear(cases.parse(document, Path()), comm, Progress(comm, quiet=True))
        nodes, centre = cell.solver.jump_operator.nodes, cell.summary.centres[cell.summary.fibre_bodies[0]]
        t = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
        unit, across = np.stack([np.cos(t), np.sin(t)]), np.stack([-np.sin(t), np.cos(t)])
        frame = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) * [a, b]
        exact = moments((frame @ unit).T + centre) @ np.hypot(*(frame @ across)) * 2 * np.pi / len(t)
        errors.append(np.abs(moments(nodes.points) @ nodes.length - exact).max())
    rates = np.log2(np.divide(errors[:-1], np.maximum(errors[1:], ROUNDED)))
    assert min(rates) > 2 * order - 0.5 or errors[1] < 10 * ROUNDED, (rates, errors)
