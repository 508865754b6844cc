"""Tied faces that touch keep their slip along the fibres from a point of a path to the next one."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from feti_homog.verify.check_fields import BONDED, CLOSED, OPEN, check_tied_faces
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
