"""Bounds of the potential at a load, by another state of the same bonds, hold for an energy of which all is known.

The energy W = 1/2 x.A x + 1/2 k <-n.x>^2 of strains x is convex and homogeneous of degree two, as that of a cell with
contact is; a state under any mixed load has a closed form on each side of n.x = 0. The heat of an increment is that of
its slips.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from feti_homog.verify.check_loads import Prescribed
from feti_homog.verify.findings import Findings, checks
from feti_homog.verify.path_energies import PointNumbers, check_step_heat, potentials
from feti_homog.verify.reading import Status

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
