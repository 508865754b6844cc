"""The heat of an increment is that of its slips."""

from types import SimpleNamespace

import numpy as np
import pytest

from feti_homog.verify.findings import Findings, checks
from feti_homog.verify.path_energies import check_step_heat
from feti_homog.verify.reading import Status


def state(point, status):
    arrays = {
        "jump": np.zeros((3, 3)),
        "traction": np.zeros((3, 3)),
        "fluctuation": np.ones((4, 3)),
        "damage": np.zeros(3),
    }
    return SimpleNamespace(name="a state", point=point, status=np.array(status), **arrays)


@pytest.mark.parametrize(
    ("heat", "method", "broke", "holds"),
    [
        (0.6, "increments", 0, True),
        (1.2, "increments", 0, False),
        (1.2, "increments", 1, True),
        (1.2, "events", 0, True),
    ],
)
def test_heat_of_an_increment_is_that_of_its_slips(heat, method, broke, holds):
    """Heat of the closed node alone: slip 0.1, traction 3, length 4, area 2; what was stored before is nothing."""
    place = SimpleNamespace(pair=np.zeros(3, int), fibre=np.ones(3, int), length=np.full(3, 4.0))
    points = [{"friction_heat": 1.0, "stored": stored, "broke": 0} for stored in (1e9, 1.0, 1.0)]
    points.append({"friction_heat": 1.0 + heat, "stored": 2.0, "broke": broke})
    written = {"case": {"path": {"method": method}}, "document": {"path": points}}
    section, strength = {"criterion": "max", "friction": 0.3}, SimpleNamespace(strength=np.ones(1))
    files = SimpleNamespace(interfaces=[section], interface=place, fibres=strength, **written)
    findings = Findings(checks(1e-8, False, has_coatings=False))
    before, behind = (state(point, [Status.BONDED, Status.CLOSED, Status.OPEN]) for point in (2, 3))
    behind.jump[:, 1], behind.traction[:, 1] = [0.0, 0.1, 0.5], [5.0, 3.0, 0.0]
    check_step_heat(findings, SimpleNamespace(files=files, area=2.0), before, behind)
    assert all(finding.holds for finding in findings.worst()) is holds
