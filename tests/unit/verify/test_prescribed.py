"""Verification reads the loads that the program goes through, and measures stresses by what the case asks for."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.verified_results import LOADS, MIXED_PATHS, document

from feti_homog import Case
from feti_homog.verify.check_loads import NAMES, Prescribed, at_points, check_loads, targets
from feti_homog.verify.findings import Findings, checks

TWO_LEGS = {"path": {"waypoints": [{"E11": 0.4, "S22": 2.0}, {"S11": 3.0, "S22": 6.0}]}}


@pytest.mark.parametrize("kind", [*MIXED_PATHS, *LOADS, "path", "peaks"])
def test_loads_in_full_are_those_of_the_case(kind):
    case = Case.parse(document(kind))
    for load, expected in zip(targets(case.resolved()), case.targets, strict=True):
        v = 6 if len(load.values) > 3 else 3
        names = np.where(load.by_stress[:v], NAMES[v][1], NAMES[v][0]).tolist()
        assert dict(zip([*names, "temperature"], load.values.tolist(), strict=False)) == expected


def along(load_factor, broke=0, **means):
    point = {"load_factor": load_factor, "broke": broke, "strain": [0.0] * 3, "stress": [0.0] * 3}
    return point | means


@pytest.mark.parametrize("method", ["events", "increments"])
def test_a_leg_begins_with_what_the_state_has_of_components_whose_kind_changes(method):
    case = {"analysis": {"plane": "strain"}, "path": TWO_LEGS["path"] | {"method": method}}
    end_of_leg = along(0.5, strain=[0.4, 9.0, 9.0], stress=[1.0, 2.0, 0.0])
    loads = list(at_points(case, [along(0.25), end_of_leg, along(0.75), along(1.0)]))
    expected = [[0.2, 1.0, 0.0], [0.4, 2.0, 0.0], [2.0, 4.0, 0.0], [3.0, 6.0, 0.0]]
    np.testing.assert_allclose([load.values for load in loads], expected, rtol=1e-15)
    assert [load.by_stress.tolist() for load in loads] == 2 * [[False, True, True]] + 2 * [[True, True, True]]


def test_breaks_at_a_waypoint_belong_to_the_leg_that_ends_there():
    case = {"analysis": {"plane": "strain"}, "path": TWO_LEGS["path"] | {"method": "events"}}
    after = along(0.5, strain=[0.4, 0.0, 0.0], stress=[0.5, 2.0, 0.0])
    _, at_break, at_end, beyond = at_points(case, [along(0.25), along(0.5, broke=1), after, along(0.75)])
    assert at_break.values.tolist() == at_end.values.tolist() == [0.4, 2.0, 0.0]
    np.testing.assert_allclose(beyond.values, [1.75, 4.0, 0.0], rtol=1e-15)


def test_steps_that_pass_a_waypoint_go_round_its_corner():
    path = {"waypoints": [[0.3, 0.0, 0.0], [0.3, 0.3, 0.0]], "method": "increments"}
    points = [along(step / 3) for step in (1, 2, 3)]
    loads = at_points({"analysis": {"plane": "strain"}, "path": path}, points)
    expected = [[0.2, 0.0, 0.0], [0.3, 0.1, 0.0], [0.3, 0.3, 0.0]]
    np.testing.assert_allclose([load.values for load in loads], expected, rtol=1e-14, atol=1e-16)


@pytest.mark.parametrize(("strain", "missed", "holds"), [(0.01, 0.0, True), (1e7, 0.0, True), (1e7, 5e-4, False)])
def test_a_stress_that_is_missed_is_measured_by_the_load(strain, missed, holds):
    load = Prescribed(np.array([-0.001, 0.0, 0.008]), np.array([False, True, True]))
    strains, stresses = np.array([-0.001, 0.0, strain]), np.array([-0.004, 0.0, 0.008 - missed])
    state = SimpleNamespace(name="a state", point=0, strain=strains, mean_stress=stresses, temperature=0.0)
    cell = SimpleNamespace(
        files=SimpleNamespace(document={}),
        reuss=np.diag([4.0, 4.0, 1.0]),
        largest_strain=strain,
        loads=lambda strain, temperature: strain,
    )
    findings = Findings(checks(1e-8, False))
    check_loads(findings, cell, [state], [(load, {})])
    assert all(finding.holds for finding in findings.worst()) is holds


@pytest.mark.parametrize(("rounding", "holds"), [(1e-13, True), (1e-11, False)])
def test_a_temperature_near_zero_is_measured_by_the_largest(rounding, holds):
    """A path from 80 to -50 passes zero at a load factor with rounding of both ends."""
    rows, states = [], []
    for number, (given, reached) in enumerate(((80.0, 80.0), (80.0 * rounding, 0.0), (-50.0, -50.0 - 80.0 * rounding))):
        rows.append((Prescribed(np.array([0.0] * 6 + [given]), np.arange(7) < 6), {}))
        zeros = {"strain": np.zeros(6), "mean_stress": np.zeros(6)}
        states.append(SimpleNamespace(name=f"state {number}", point=number, temperature=reached, **zeros))
    files = SimpleNamespace(document={"angle": [None] * 3})
    cell = SimpleNamespace(files=files, reuss=np.eye(6), largest_strain=0.01, loads=lambda strain, temperature: strain)
    findings = Findings(checks(1e-8, False))
    check_loads(findings, cell, states, rows)
    assert all(finding.holds for finding in findings.worst()) is holds
