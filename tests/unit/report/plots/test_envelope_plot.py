"""The picture of an envelope: what is drawn, and what is not."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection

from feti_homog.report.plots.response_curves import envelope, modes


def document(factors: list[float | None], plane: tuple[str, str] = ("S22", "S12"), **shares: float) -> dict[str, Any]:
    points = [
        {"angle": 360.0 * k / len(factors)} | ({} if factor is None else {"factor": factor} | shares)
        for k, factor in enumerate(factors)
    ]
    case = {
        "name": "a", "analysis": {"plane": "strain"}, "interface": {"criterion": "max"},
        "envelope": {"plane": list(plane)}, "output": {"stress_unit": "MPa"},
    }  # fmt: skip
    return {"case": case, "envelope": points}


def curve(figure: Any) -> Any:
    (found,) = [c for c in figure.axes[0].collections if isinstance(c, LineCollection)]
    return found


def test_a_closed_curve_has_a_side_for_every_direction():
    figure = envelope(document([1.0, 2.0, 1.0, 2.0], normal=1.0, tangential=0.0))
    sides = np.array(curve(figure).get_segments())
    np.testing.assert_allclose(sides[:, 0], [[1, 0], [0, 2], [-1, 0], [0, -2]], atol=1e-12)
    np.testing.assert_allclose(sides[:, 1], np.roll(sides[:, 0], -1, axis=0))
    axes = figure.axes[0]
    assert axes.get_aspect() == 1.0 and axes.get_xlim()[1] > 1.0 and axes.get_ylim()[0] < -2.0
    assert axes.get_xlabel() == "$\\Sigma_{22}$ (MPa)"


def test_directions_without_an_onset_leave_a_gap():
    figure = envelope(document([1.0, None, 1.0, 2.0, 1.0], normal=1.0, tangential=0.5))
    assert len(curve(figure).get_segments()) == 3
    assert "directions without onset: 1" in figure.axes[0].get_title()


def test_far_loads_do_not_make_the_others_small():
    figure = envelope(document([1.0, 1.0, 1000.0, 1.0, 1.0], psi=45.0))
    assert abs(np.array(figure.axes[0].get_xlim())).max() < 5.0
    assert "loads up to 1000 are outside" in figure.axes[0].get_title()


@pytest.mark.parametrize("factors", [[None] * 4, [0.0] * 4])
def test_there_may_be_nothing_to_draw(factors):
    figure = envelope(document(factors, ("E11", "gamma12"), psi=0.0))
    assert figure.axes[0].get_ylabel() == "$\\gamma_{12}$"


def test_modes():
    shares = {"normal": 0.0, "tangential": 0.6, "axial": 0.8}
    assert modes(document([1.0] * 4, **shares)["envelope"]) == pytest.approx([90.0] * 4)
    assert modes(document([1.0] * 4, normal=1.0, tangential=1.0)["envelope"]) == pytest.approx([45.0] * 4)
    found = modes(document([1.0, None], psi=30.0)["envelope"])
    assert found[0] == 30.0 and np.isnan(found[1])


def test_labels_of_small_loads_do_not_overlap():
    figure = envelope(document([0.02, 0.02, 0.1, 0.1, 0.1, 0.07], normal=1.0, tangential=0.0))
    FigureCanvasAgg(figure).draw()
    boxes = [label.get_window_extent() for label in figure.axes[0].get_xticklabels()]
    assert len(boxes) > 2
    assert all(one.x1 < other.x0 for one, other in pairwise(boxes))
