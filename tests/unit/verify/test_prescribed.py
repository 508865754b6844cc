"""Verification reads the loads of the program, measures stresses by what the case asks for, and bounds energies."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.verified_results import LOADS, MIXED_PATHS, document

from feti_homog import Case
from feti_homog.verify.check_loads import NAMES, Prescribed, at_points, check_loads, targets
from feti_homog.verify.findings import Findings, checks
from feti_homog.verify.path_energies import PointNumbers, check_step_heat, potentials
from feti_homog.verify.reading import Status

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


ROUNDING = 1e-12


def convex_energy(rng, n):
    """Stiffnesses (2, n, n) on both sides of n.x = 0, and that normal."""
    root, normal = rng.normal(size=(n, n)), rng.normal(size=n)
    stiffness = root @ root.T + 0.1 * np.eye(n)
    return np.stack([stiffness, stiffness + 5.0 * np.outer(normal, normal)]), normal


def state(stiffnesses, normal, load):
    """Strains and stresses under a load: of both sides the one that is where it should be."""
    f = load.by_stress
    for side, A in zip((1, -1), stiffnesses, strict=True):
        x = np.where(f, 0.0, load.values)
        x[f] = np.linalg.solve(A[np.ix_(f, f)], load.values[f] - A[np.ix_(f, ~f)] @ x[~f])
        if side * (normal @ x) >= 0.0:
            return PointNumbers("", x, A @ x, float(x @ A @ x) / 2, load)
    raise AssertionError


@pytest.mark.parametrize("seed", range(200))
def test_potentials_lie_within_their_bounds_and_on_rays_are_known(seed):
    """Bounds by another state of the same bonds hold for the energy W = 1/2 x.A x + 1/2 k <-n.x>^2 of strains x.

    It is convex and homogeneous of degree two, as that of a cell with contact is; a state under any mixed load has a
    closed form on each side of n.x = 0.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.choice([3, 7]))
    energy = convex_energy(rng, n)
    by_stress = rng.random(n) < rng.choice([0.0, 0.5, 1.0])
    values, others = rng.normal(size=(2, n))
    kind = rng.choice(["strains alike", "stresses alike", "no stresses", "no strains", "ray"])
    t = rng.uniform(0.2, 3.0)
    alike = {"strains alike": ~by_stress, "stresses alike": by_stress, "ray": np.ones(n, bool)}
    values = np.where(alike.get(kind, False), t * others, values)
    none = {"no stresses": by_stress, "no strains": ~by_stress}.get(kind, np.zeros(n, bool))
    values, others = np.where(none, 0.0, values), np.where(none, 0.0, others)
    here, other = (state(*energy, Prescribed(own, by_stress)) for own in (values, others))
    least, most = potentials(here.load, other)
    scale = here.stored + t**2 * other.stored
    assert least - ROUNDING * scale <= here.potential <= most + ROUNDING * scale
    if kind == "ray":
        assert abs(here.potential - least) + abs(here.potential - most) <= 1e2 * ROUNDING * scale
    if kind == "stresses alike" or none[by_stress].all():
        assert np.isfinite(least)
    if kind == "strains alike" or none[~by_stress].all():
        assert np.isfinite(most)


def test_what_works_on_a_temperature_and_is_not_known_bounds_nothing_that_it_works_on():
    kinds = np.array([True, False])
    unknown = PointNumbers(
        "", np.array([0.1, 0.0]), np.array([2.0, np.nan]), 0.1, Prescribed(np.array([2.0, 0.0]), kinds)
    )
    assert potentials(Prescribed(np.array([4.0, 0.0]), kinds), unknown) == pytest.approx((-0.4, -0.4))
    assert potentials(Prescribed(np.array([4.0, 5.0]), kinds), unknown) == (-np.inf, np.inf)


def rubbing(point, status):
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
    """Only the closed node makes heat: slip 0.1, traction 3, length 4, area 2; the earlier state stores no energy."""
    place = SimpleNamespace(pair=np.zeros(3, int), fibre=np.ones(3, int), length=np.full(3, 4.0))
    points = [{"friction_heat": 1.0, "stored": stored, "broke": 0} for stored in (1e9, 1.0, 1.0)]
    points.append({"friction_heat": 1.0 + heat, "stored": 2.0, "broke": broke})
    written = {"case": {"path": {"method": method}}, "document": {"path": points}}
    section, strength = {"criterion": "max", "friction": 0.3}, SimpleNamespace(strength=np.ones(1))
    files = SimpleNamespace(interfaces=[section], interface=place, fibres=strength, **written)
    findings = Findings(checks(1e-8, False))
    before, behind = (rubbing(point, [Status.BONDED, Status.CLOSED, Status.OPEN]) for point in (2, 3))
    behind.jump[:, 1], behind.traction[:, 1] = [0.0, 0.1, 0.5], [5.0, 3.0, 0.0]
    check_step_heat(findings, SimpleNamespace(files=files, area=2.0), before, behind)
    assert all(finding.holds for finding in findings.worst()) is holds
