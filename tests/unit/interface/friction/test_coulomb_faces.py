"""The statuses of debonded faces with friction against brute force over all of them, and whole paths of dense cells."""

from collections import Counter
from itertools import product

import numpy as np
import pytest
from reference.condensed_cell import MixedLoad
from reference.friction import RubbingFaces
from reference.friction_path import FrictionPath

from feti_homog.errors import NotCarriedError
from feti_homog.interface.friction.coulomb_faces import FREE, INDEFINITE, SEARCHED, CoulombFaces, StuckError
from feti_homog.interface.friction.face_system import Prescribed
from feti_homog.interface.friction.status_search import STATUSES, StatusSearch
from feti_homog.interface.friction.status_system import BACKWARD, FORWARD, OPEN_FACE, STICK, StatusSystem

BY_STRAIN = np.zeros(2, bool)


def random_faces(rng, most_friction):
    """Return compliance, loads, friction, gaps and slips of up to three nodes."""
    return random_nodes(rng, int(rng.integers(1, 4)), most_friction)


def random_nodes(rng, n, most_friction):
    root = rng.standard_normal((2 * n, 2 * n + int(rng.integers(0, 3))))
    gap, slip = (own * (rng.random() < 0.5) for own in (0.3 * rng.random(n), 0.2 * rng.standard_normal(n)))
    return root @ root.T, rng.standard_normal((2 * n, 1)), rng.uniform(0.0, most_friction, n), gap, slip


def admissible(compliance, load, friction, gap, slip):
    """Jumps (2n,) of all admissible statuses, one after the other, from the compliance."""
    n, found = len(friction), []
    jump = load[:, 0] + np.stack([gap, 0.0 * gap], axis=1).ravel()
    for statuses in product((STICK, FORWARD, OPEN_FACE, BACKWARD), repeat=n):
        A, b, s = np.zeros((2 * n, 2 * n)), np.zeros(2 * n), np.array(statuses)
        for i, status in enumerate(statuses):
            rows = slice(2 * i, 2 * i + 2)
            A[rows], b[rows] = compliance[rows], jump[rows] - [0.0, slip[i]]
            if status == OPEN_FACE:
                A[rows], b[rows] = np.eye(2 * n)[rows], 0.0
            elif status != STICK:
                A[2 * i + 1], b[2 * i + 1] = np.eye(2 * n)[2 * i + 1] + status * friction[i] * np.eye(2 * n)[2 * i], 0.0
        force = np.linalg.solve(A, b)
        g = jump - compliance @ force
        rooms = [g[::2], -force[::2], -friction * force[::2] - np.abs(force[1::2])]
        rooms.append(np.where(np.abs(s) == 1, s * (g[1::2] - slip), 0.0))
        if np.min(rooms) > -1e-9:
            found.append(g)
    return found


def faces_of(compliance, load, friction, gap):
    """Faces with the jumps d E - F f, d (2n, 1) `load`; the initial gaps (n,) are one more load, of the value 1."""
    apart = np.zeros_like(load)
    apart[::2].flat = gap
    d = np.hstack([load, apart])
    K = np.linalg.inv(compliance)
    return CoulombFaces(np.block([[K, -K @ d], [-d.T @ K, d.T @ K @ d]]), friction)


def prescribed(compliance, load, friction, gap, slip):
    """Return faces of random nodes and what is prescribed."""
    faces, n = faces_of(compliance, load, friction, gap), len(friction)
    return faces, Prescribed(BY_STRAIN, faces.size[2 * n :], slip * faces.size[1 : 2 * n : 2])


def assert_is_one_of(expected, faces, x, load):
    last = 2 * faces.nodes
    assert min(np.abs(x[:last] / faces.size[:last] - g).max() / np.abs(load).max() for g in expected) < 1e-7


@pytest.mark.parametrize("most_friction", [0.4, 3.0])
def test_statuses_are_those_of_brute_force(most_friction):
    rng = np.random.default_rng(7)
    for _ in range(150):
        nodes = random_faces(rng, most_friction)
        faces, given = prescribed(*nodes)
        first, start = np.zeros(faces.nodes, np.int8), np.zeros(len(faces.S))
        _, x = faces.search(first, faces.all_allowed(), given, start)
        assert_is_one_of(admissible(*nodes), faces, x, nodes[1])


def test_each_search_finds_statuses_or_none():
    """Search 300 states of three nodes with mu up to 6: Lemke's method finds resisting statuses for each."""
    rng, found = np.random.default_rng(12), {"by_pivots": 0, "by_lemke": 0}
    for _ in range(300):
        nodes = random_nodes(rng, 3, 6.0)
        faces, given = prescribed(*nodes)
        search = StatusSearch(faces, faces.all_allowed(), given, np.zeros(len(faces.S)))
        pivoted = search.by_pivots(np.zeros(3, np.int8))[0]
        for name, answer in (("by_pivots", pivoted), ("by_lemke", search.by_lemke())):
            if answer is not None:
                found[name] += 1
                assert_is_one_of(admissible(*nodes), faces, answer[1], nodes[1])
                assert name == "by_pivots" or faces.sign(answer[0], BY_STRAIN) > 0
    assert found["by_lemke"] == 300 > found["by_pivots"], found


def follow(faces, area, loads):
    """Points of a path: load factor, strain and stress (m,), the heat up to each, and scaled x."""
    n, (status, x, heat) = faces.nodes, (np.zeros(faces.nodes, np.int8), np.zeros(len(faces.S)), 0.0)
    points = []
    for leg, load in enumerate(loads):
        E, Sigma = x[2 * n :] / faces.size[2 * n :], (faces.S @ x)[2 * n :] * faces.size[2 * n :] / area
        start = np.where(load.by_stress, Sigma, E)
        unit = np.where(load.by_stress, area / faces.size[2 * n :], faces.size[2 * n :])
        share = 0.0
        while share < 1.0:
            status, rate = faces.rates(status, x, load.by_stress, unit * (load.values - start))
            way = min(faces.next_change(status, x, rate), 1.0 - share)
            heat += faces.heat(status, x, x + way * rate) / area
            share, x = share + way if way < 1.0 - share else 1.0, x + way * rate
            y = (faces.S @ x) * faces.size
            points.append(((leg + share) / len(loads), x[2 * n :] / faces.size[2 * n :], y[2 * n :] / area, heat, x))
    return points


@pytest.mark.parametrize("seed", range(8))
def test_paths_with_reversals_are_those_of_slow_ones(seed):
    rng = np.random.default_rng(seed)
    nodes = 2 + seed % 4
    B = rng.normal(size=(2 * nodes + 7, 2 * nodes + 3))
    A, friction = B.T @ B / len(B), rng.uniform(0.0, 0.4, nodes)
    loads = [MixedLoad(rng.normal(size=3), rng.random(3) < 0.3) for _ in range(4)]
    expected = FrictionPath(RubbingFaces(A, np.zeros(nodes, bool), friction)).follow(loads)
    found = follow(CoulombFaces(A, friction), 1.0, loads)
    assert len(found) == len(expected)
    most = max(np.abs(p.state.stress).max() for p in expected)
    for (factor, strain, stress, heat, _), point in zip(found, expected, strict=True):
        assert factor == pytest.approx(point.load_factor, rel=1e-8)
        np.testing.assert_allclose(stress, point.state.stress, atol=1e-8 * most)
        np.testing.assert_allclose(strain, point.state.strain, atol=1e-8)
        assert heat == pytest.approx(point.heat, abs=1e-8)


def is_admissible(search, status):
    x, balanced = search.faces.linear(status, search.load, search.start)
    return (
        balanced and search.faces.is_balanced(status, search.load, x) and (search._improved(status, x) == status).all()
    )


@pytest.mark.slow
def test_paths_of_much_friction_end_where_no_statuses_go_on():
    """Random paths with mu up to 3: those that stop do where trials of all find no rates, or none that are resisted.

    Of those that are admissible with a negative determinant, a pinched fibre has others that jam it.
    """
    rng, words = np.random.default_rng(0), Counter()
    for _ in range(60):
        nodes = int(rng.integers(1, 6))
        B = rng.normal(size=(2 * nodes + 4, 2 * nodes + 3))
        faces = CoulombFaces(B.T @ B / len(B), rng.uniform(0.0, 3.0, nodes))
        asked, rates = [], faces.rates
        faces.rates = lambda *state, asked=asked, rates=rates: asked.append(state) or rates(*state)
        try:
            follow(faces, 1.0, [MixedLoad(rng.normal(size=3), rng.random(3) < 0.3) for _ in range(4)])
        except StuckError as error:
            status, x, by_stress, rate = asked[-1]
            search = StatusSearch(
                faces, faces._at_limits(status, x, faces.noise(x)), Prescribed(by_stress, rate, 0.0 * status), 0.0 * x
            )
            several = [np.array(STATUSES)[own] for own in search.allowed]
            trials = [np.array(own, np.int8) for own in product(*several)]
            signs = [faces.sign(trial, by_stress) for trial in trials if is_admissible(search, trial)]
            assert not signs if str(error) == SEARCHED else signs and max(signs) <= 0
            words[str(error)] += 1
    assert words[SEARCHED] > 5 and set(words) <= {SEARCHED, INDEFINITE}


@pytest.mark.parametrize("guess", [(STICK, FORWARD), (BACKWARD, STICK)])
def test_a_fibre_that_two_faces_pinch_is_jammed(guess):
    """Rigid but for the chord between the nodes, 10 degrees off their normals; one that slides is admissible, too."""
    a = np.radians(10.0)
    chord = np.array([np.cos(a), np.sin(a), np.cos(a), -np.sin(a), 1.0])
    faces = CoulombFaces(np.outer(chord, chord), np.full(2, 0.4))
    given = Prescribed(np.zeros(1, bool), faces.size[4:], np.zeros(2))
    status, x = faces.step(np.array(guess, np.int8), given, np.zeros(5))
    assert (status == STICK).all() and (faces.S @ x * faces.size)[4] == pytest.approx(1.0)


def test_what_nothing_resists_stays_whatever_the_rounding():
    """Three open nodes that move together, by stiffnesses that differ in the last digit."""
    rng, n, v = np.random.default_rng(3), 3, 2
    B, motion = rng.normal(size=(12, 2 * n + v)), np.append(rng.normal(size=2 * n), np.zeros(v))
    B -= np.outer(B @ motion, motion) / (motion @ motion)
    S = B.T @ B
    noise = rng.normal(size=S.shape)
    free = np.append(np.ones(2 * n, bool), np.zeros(v, bool))
    start, found = np.append(motion[: 2 * n], rng.normal(size=v)), []
    for stiffness in (S, S * (1.0 + 1e-16 * (noise + noise.T))):
        system = StatusSystem(stiffness, free, np.zeros(len(S)))
        assert system.sign == 0
        found.append(system.solve(start, np.zeros(len(S)))[0])
    assert np.abs(found[1] - found[0]).max() < 1e-12
    assert abs(motion @ (found[0] - start)) < 1e-12 and np.abs(S @ found[0])[free].max() < 1e-12


@pytest.mark.parametrize("share", [1e-6, 1e-12])
def test_a_fibre_that_bears_little_slips_as_one_that_bears_much(share):
    """Two groups of nodes that nothing couples, of which the second has a share of the loads of the first."""
    rng = np.random.default_rng(5)
    parts, v = [], 3
    for nodes in (4, 3):
        B = rng.normal(size=(2 * nodes + 7, 2 * nodes + v))
        parts.append(B.T @ B / len(B))
    loads = [MixedLoad(rng.normal(size=v), np.zeros(v, bool)) for _ in range(5)]
    friction = rng.uniform(0.1, 0.4, 7)
    both = np.zeros((14 + v, 14 + v))
    for part, factor, at in ((parts[0], 1.0, np.r_[0:8]), (parts[1], share, np.r_[8:14])):
        k = len(at)
        both[np.ix_(at, at)] = part[:k, :k]
        both[np.ix_(at, np.r_[14:17])] = factor * part[:k, k:]
        both[np.ix_(np.r_[14:17], at)] = factor * part[k:, :k]
        both[14:, 14:] += factor**2 * part[k:, k:]
    ends = []
    for stiffness, own in ((both, slice(0, 7)), (parts[1], slice(4, 7))):
        faces, found = CoulombFaces(stiffness, friction[own]), []
        for *_, x in follow(faces, 1.0, loads):
            found.append(x / faces.size)
        ends.append(found)
    slips, alone = ends[0][-1][8:14], ends[1][-1][:6]
    assert np.abs(alone).max() > 0.1
    np.testing.assert_allclose(slips / share, alone, atol=1e-9 * np.abs(alone).max())


@pytest.mark.parametrize("force", [1e-13, 1e-6, 1.0])
def test_what_holds_a_free_motion_carries_no_force(force):
    """Two nodes that slide together, which nothing but a force that rounding leaves may act on."""
    S = np.array([[1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, -1.0, 0.0], [0.0, 0.0, 1.0, 0.0, 0.0],
                  [0.0, -1.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0]])  # fmt: skip
    free = np.array([False, True, False, True, False])
    given = np.array([0.0, 1.0, 0.0, -1.0 + force, 0.0])
    x, balanced = StatusSystem(S, free, np.zeros(5)).solve(np.zeros(5), given)
    assert balanced == (force < 1e-9)
    if balanced:
        np.testing.assert_allclose(x[[1, 3]], [0.5, -0.5], rtol=1e-9)


def test_faces_that_slide_freely_are_told_from_those_for_which_nothing_is_found():
    """One node under a pressure of 1 and a shear: it sticks up to mu, and beyond nothing carries it."""
    faces, by_stress = (CoulombFaces(np.eye(4) - np.eye(4)[[2, 3, 0, 1]], np.array([0.5])), [True] * 2)
    for shear, carried in ((0.4, True), (0.6, False)):
        given = Prescribed(np.array(by_stress), np.array([-1.0, shear]), np.zeros(1))
        if carried:
            faces.step(np.zeros(1, np.int8), given, np.zeros(4))
        else:
            with pytest.raises(NotCarriedError, match=FREE) as error:
                faces.step(np.zeros(1, np.int8), given, np.zeros(4))
            assert not isinstance(error.value, StuckError)
