"""Tied faces keep their slip along the fibres from a point of a path to the next one; the heat of an increment."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from feti_homog.verify.check_fields import BONDED, CLOSED, OPEN, check_step_heat, check_tied_faces
from feti_homog.verify.findings import Findings, checks


def state(point, slips, status):
    jump = np.zeros((3, 3))
    jump[:, 2] = slips
    arrays = {"jump": jump, "traction": np.zeros((3, 3)), "fluctuation": np.ones((4, 3)), "damage": np.zeros(3)}
    return SimpleNamespace(name="a state", point=point, status=np.array(status), **arrays)


@pytest.mark.parametrize(
    ("axial", "point", "slip", "status", "steps", "holds"),
    [
        ("prevented", 3, 0.5, CLOSED, ("events", 1), True),
        ("prevented", 3, 0.4, CLOSED, ("events", 1), False),
        ("prevented", 3, 0.4, CLOSED, ("increments", 0), False),
        ("prevented", 3, 0.4, CLOSED, ("increments", 1), True),  # opened and closed as bonds broke, perhaps
        ("prevented", 3, 0.4, OPEN, ("events", 1), True),
        ("prevented", 4, 0.4, CLOSED, ("events", 1), True),  # opened between both, perhaps
        ("free", 3, 0.4, CLOSED, ("events", 1), True),
    ],
)
def test_slips_of_tied_faces_stay(axial, point, slip, status, steps, holds):
    section = {"criterion": "max", "friction": 0.3, "axial_friction": axial}
    place = SimpleNamespace(pair=np.zeros(3, int), fibre=np.ones(3, int))
    strength = SimpleNamespace(strength=np.ones(1))
    method, broke = steps
    written = {"case": {"path": {"method": method}}, "document": {"path": [{"broke": broke}] * 5}}
    files = SimpleNamespace(is_spatial=True, interfaces=[section], interface=place, fibres=strength, **written)
    findings = Findings(checks(1e-8, False, has_coatings=False))
    before, behind = state(2, [0, 0.5, 0.1], [BONDED, CLOSED, OPEN]), state(point, [0, slip, 0], [BONDED, status, OPEN])
    check_tied_faces(findings, SimpleNamespace(files=files, imposed=lambda state: 1.0), before, behind)
    assert all(finding.holds for finding in findings.worst()) is holds


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
    before, behind = (state(point, [0, 0, 0], [BONDED, CLOSED, OPEN]) for point in (2, 3))
    behind.jump[:, 1], behind.traction[:, 1] = [0.0, 0.1, 0.5], [5.0, 3.0, 0.0]
    check_step_heat(findings, SimpleNamespace(files=files, area=2.0), before, behind)
    assert all(finding.holds for finding in findings.worst()) is holds
