"""The two oracles of friction, `reference.friction` and `reference.friction_path`, against each other and by hand."""

from dataclasses import replace

import numpy as np
import pytest
from reference.closed_forms import first_slip, rubbing_laminate
from reference.condensed_cell import MixedLoad
from reference.friction import BACKWARD, BONDED, FORWARD, OPEN, STICK, RubbingFaces
from reference.friction_path import FrictionPath
from reference.references import FIRST_SLIP

GLASS, EPOXY = {"young": 70800.0, "poisson": 0.22}, {"young": 2790.0, "poisson": 0.33}


def random_faces(rng, nodes, most_friction):
    """Return faces of a random positive definite cell under three loads, each node with a coefficient of its own."""
    n = 2 * nodes + 3
    B = rng.normal(size=(n + 4, n))
    bonded = np.zeros(nodes, bool)
    bonded[3:] = rng.random(max(nodes - 3, 0)) < 0.2
    return RubbingFaces(B.T @ B / n, bonded, rng.uniform(0.0, most_friction, nodes))


def random_loads(rng, number):
    return [MixedLoad(rng.normal(size=3), rng.random(3) < 0.3) for _ in range(number)]


def at_ends(points, legs):
    return [[p for p in points if abs(p.load_factor * legs - k) < 1e-12][-1] for k in range(1, legs + 1)]


@pytest.mark.parametrize("seed", range(6))
def test_paths_are_those_of_brute_force_over_statuses(seed):
    """Every rate is the only one, in contact from rest on, with reversals; the first leg is one implicit step."""
    rng = np.random.default_rng(seed)
    faces, loads = random_faces(rng, 2 + seed % 4, 0.4), random_loads(rng, 4)
    seen = set()

    class Checked(FrictionPath):
        def rate(self, way):
            found = super().rate(way)
            for other in self.rates(way):
                np.testing.assert_allclose(other.stress, found.stress, atol=1e-9 * np.abs(found.stress).max())
            seen.update(found.status)
            return found

    points = Checked(faces).follow(loads)
    assert seen >= {STICK, OPEN} and seen & {FORWARD, BACKWARD}
    (first, *_) = at_ends(points, 4)
    step = faces.increment(faces.at_rest, loads[0])
    np.testing.assert_allclose(step.stress, first.state.stress, atol=1e-9 * np.abs(first.state.stress).max())
    np.testing.assert_array_equal(step.status, first.state.status)
    most = max(p.stored for p in points)
    heats = np.array([p.heat for p in points])
    np.testing.assert_allclose([p.work - p.stored for p in points], heats, atol=1e-12 * most)
    assert heats[-1] > 0.0 and (np.diff(heats) >= -1e-12 * most).all()


def test_small_implicit_steps_tend_to_the_path():
    """To first order: statuses change within steps."""
    rng = np.random.default_rng(3)
    faces, loads = random_faces(rng, 5, 0.4), random_loads(rng, 3)
    exact = np.array([p.state.stress for p in at_ends(FrictionPath(faces).follow(loads), 3)])
    errors = []
    for steps in (2, 16):
        state, found = faces.at_rest, []
        for load in loads:
            start = state.start_of(load)
            for k in range(1, steps + 1):
                state = faces.increment(state, start.towards(load, k / steps))
            found.append(state.stress)
        errors.append(np.abs(np.array(found) - exact).max() / np.abs(exact).max())
    assert 1e-12 < errors[1] < errors[0] / 4 and errors[1] < 0.01


def test_each_condition_is_checked():
    rng = np.random.default_rng(0)
    faces = random_faces(rng, 3, 0.4)
    one = np.array([1.0, 0.0, 0.0])
    state = replace(faces.at_rest, pressure=one, shear=0.0 * one)
    assert faces.violation(state, faces.at_rest) == 0.0
    faults = ({"gap": -one}, {"pressure": -one}, {"gap": one}, {"shear": one}, {"slip": one})
    backward = {"slip": -one, "shear": faces.mu * one}
    for fault in (*faults, backward):
        assert faces.violation(replace(state, **fault), faces.at_rest) > 1e-3
    sliding = replace(state, slip=one, shear=faces.mu * one)
    assert faces.violation(sliding, faces.at_rest) == 0.0


@pytest.mark.parametrize("springs", [None, 40.0])
def test_a_laminate_closes_its_parallelogram(springs):
    """min M (E11 - gap)^2 / 2 + G (gamma12 - slip)^2 / 2, with springs in series: stresses and heat by hand."""
    M, G, mu = 150.0, 45.0, 0.3
    if springs:
        M, G = (1 / (1 / x + 1 / springs) for x in (M, G))
    A = np.zeros((5, 5))
    A[np.ix_([0, 2], [0, 2])] = M * np.array([[1, -1], [-1, 1]])
    A[np.ix_([1, 4], [1, 4])] = G * np.array([[1, -1], [-1, 1]])
    A[3, 3] = 1.0
    faces = RubbingFaces(A, [False], mu)
    shears = [0.0, 0.02, *[-0.02, 0.02] * 5]
    strains = [np.array([-0.01, 0.0, shear]) for shear in shears]
    path = FrictionPath(faces)
    points = at_ends(path.follow([MixedLoad(e, np.zeros(3, bool)) for e in strains]), len(strains))
    stress, heat = rubbing_laminate(M, G, mu, -0.01, shears)
    np.testing.assert_allclose([p.state.stress[2] for p in points], stress, atol=1e-12)
    np.testing.assert_allclose([p.heat for p in points], heat, atol=1e-12)
    loop = 2 * mu * M * 0.01 * (0.04 - 2 * mu * M * 0.01 / G)
    assert heat[3] - heat[1] == pytest.approx(loop, rel=1e-12)
    assert faces.bonded.sum() == 0 and BONDED not in points[-1].state.status


def test_the_first_slip_of_a_fibre():
    for friction, known in FIRST_SLIP.items():
        load, angle = first_slip(EPOXY, GLASS, friction)
        assert load == pytest.approx(known.value[0], rel=1e-7)
        assert angle == pytest.approx(known.value[1], abs=known.error)
