"""Arcs on the interface: their tips and the nodes within them, counted by hand and by a search over full turns."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_matrix

from feti_homog.case.interface_section import Arc
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN
from feti_homog.interface.debonded_arcs import InterfaceChains, angles, closing_work, debonded, moved_tips, tips

ROUND = np.arange(0.0, 360.0, 10.0)


def open_at(*arcs, opening=None, fibre=1):
    """Return the directions, of 36 around a fibre, that are within the arcs."""
    return ROUND[debonded(arcs, opening, np.full(36, fibre), ROUND)].tolist()


def test_tips_are_half_an_opening_off_the_centre_and_one_where_they_coincide():
    arcs = [Arc(fibre="all", centre=0.0, angle=60.0), Arc(fibre=(2,), centre=180.0, angle=90.0)]
    assert tips(arcs, (), 3) == {0: [30.0, 330.0], 1: [30.0, 135.0, 225.0, 330.0], 2: [30.0, 330.0]}
    arcs = [Arc(fibre=(1, 3), centre=-90.0)]
    marks = [180.0, 225.0, 315.0, 0.0]
    assert tips(arcs, (0.0, 90.0, 180.0, 360.0), 3) == {0: sorted(marks), 2: sorted(marks)}
    arcs = [Arc(fibre="all", centre=10.0, angle=20.0), Arc(fibre="all", centre=-350.0 + 20.0, angle=20.0)]
    assert tips(arcs, (), 1) == {0: [0.0, 20.0, 40.0]}
    assert tips([Arc(fibre="all", centre=0.1 + 0.2, angle=0.2)], (), 1) == {0: [0.2, 0.4]}


def test_nodes_within_arcs_debond_and_tips_stay_bonded():
    assert open_at(Arc(fibre="all", angle=60.0)) == [0, 10, 20, 340, 350]
    assert open_at(Arc(fibre="all", angle=60.1)) == [0, 10, 20, 30, 330, 340, 350]
    assert open_at() == []
    assert open_at(Arc(fibre="all", centre=0.0, angle=359.0)) == [a for a in ROUND if a != 180]
    arc = Arc(fibre=(2, 4), angle=30.0)
    assert [open_at(arc, fibre=f) for f in (1, 2, 3, 4)] == [[], [0, 10, 350], [], [0, 10, 350]]
    assert open_at(Arc(fibre="all", centre=10.0, angle=20.0), Arc(fibre="all", centre=30.0, angle=20.0)) == [10, 30]
    near = 30.0 + np.array([-1e-3, -1e-7, 0.0, 1e-7])
    arcs, fibre = [Arc(fibre="all", angle=60.0)], np.ones(4, int)
    assert debonded(arcs, None, fibre, near).tolist() == [True, False, False, False]


def test_opening_takes_the_place_of_the_angle():
    arc = Arc(fibre=(1,), centre=90.0)
    assert open_at(arc, opening=40.0) == [80, 90, 100]
    assert open_at(arc, opening=0.0) == []
    assert open_at(arc, opening=360.0) == ROUND.tolist()
    assert open_at(arc, Arc(fibre=(1,), angle=20.0), opening=40.0) == [0, 80, 90, 100]


def test_an_arc_ends_where_the_mesh_has_its_tips():
    """Vertices at 29.99 and -30.02 in place of 30 and -30 of fibre 1; those of fibre 2 are where they should be."""
    fibre = np.array([1, 1, 1, 1, 2, 2])
    direction = np.array([29.99, -30.02, 29.98, -30.01, 30.0, 330.0])
    marks = tips([Arc(fibre="all", angle=60.0)], (), 2)
    moved = moved_tips(marks, fibre, direction, 0.05)
    assert moved == {(1, 30.0): pytest.approx(29.99), (1, 330.0): pytest.approx(329.99)}
    inside = debonded([Arc(fibre="all", angle=60.0)], None, fibre, direction, moved)
    assert inside.tolist() == [False, False, True, False, False, False]
    assert moved_tips(marks, fibre, direction, 0.005) == {}


def test_a_fibre_without_a_centre_opens_as_a_whole_only():
    nowhere = np.full(36, np.nan)
    assert not debonded([Arc(fibre="all", angle=359.0)], None, np.ones(36, int), nowhere).any()
    assert debonded([Arc(fibre="all", angle=360.0)], None, np.ones(36, int), nowhere).all()


def chains(edges, n):
    a, b = np.array(edges).T
    return InterfaceChains(coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(n, n)).tocsr())


def ring(n, order):
    """n nodes around a fibre, numbered in any order."""
    return chains(list(zip(order, np.roll(order, -1), strict=True)), n)


def states(n, **chosen):
    status = np.full(n, BONDED, np.int8)
    for kind, nodes in chosen.items():
        status[nodes] = {"open": OPEN, "closed": CLOSED}[kind]
    return status


def test_a_debonded_arc_has_two_tips():
    order = np.random.default_rng(1).permutation(12)
    tips = ring(12, order).tips(states(12, open=order[[3, 4]], closed=order[5]))
    found = {tuple(map(int, row)) for row in zip(tips.node, tips.behind, tips.ahead, strict=True)}
    assert found == {tuple(map(int, order[[2, 3, 1]])), tuple(map(int, order[[6, 5, 7]]))}


@pytest.mark.parametrize("debonded", [[], range(8), [0, 2, 4, 6], [0, 1, 2, 3, 4, 5, 6]])
def test_nothing_everything_and_single_bonds_have_no_tips(debonded):
    assert len(ring(8, np.arange(8)).tips(states(8, open=list(debonded))).node) == 0


def test_the_ends_of_chains_are_no_tips():
    line = chains([(0, 1), (1, 2), (2, 3), (3, 4)], 6)
    tips = line.tips(states(6, open=[0, 4]))
    assert tips.node.tolist() == [1, 3] and tips.behind.tolist() == [0, 4] and tips.ahead.tolist() == [2, 2]
    onward = line.onward(tips.node, tips.ahead, 4)
    assert onward.tolist() == [[1, 2, 3, 4, -1], [3, 2, 1, 0, -1]]


@pytest.mark.parametrize("growth", [1.0, 1.4])
@pytest.mark.parametrize("length", [1.0, 0.93])
def test_closing_work_is_that_of_the_field_of_a_crack(growth, length):
    """t = K / sqrt(2 pi s) and w = c K sqrt(2 s / pi): 1 / (2 a) int t(s) w(a - s) ds = c K^2 / 4, for any a."""
    nodes = np.concatenate([[0.0], np.cumsum(growth ** np.arange(400 if growth == 1.0 else 16))])
    nodes *= 1.2 / nodes[-1]
    K = np.array([2.0, -3.0])
    w = 0.5 * K * np.sqrt(2 * nodes / np.pi)[:, None]
    # Forces that linear shape functions make of the traction: int N_k s^-1/2 ds, exact.
    a, b = nodes[:-1], nodes[1:]
    whole, first = 2 * (np.sqrt(b) - np.sqrt(a)), 2 / 3 * (b**1.5 - a**1.5)
    lumps = np.zeros(len(nodes))
    lumps[:-1] += (b * whole - first) / (b - a)
    lumps[1:] += (first - a * whole) / (b - a)
    force = K / np.sqrt(2 * np.pi) * lumps[:, None]
    assert closing_work(length, nodes, force, nodes, w) == pytest.approx(0.5 * K**2 / 4, rel=0.02)


def test_closing_work_of_one_element_is_the_virtual_crack_closure():
    force, jump = np.array([[3.0, -1.0], [9.0, 9.0]]), np.array([[0.0, 0.0], [0.5, -0.25]])
    at = np.array([0.0, 0.2])
    assert closing_work(0.2, at, force, at, jump).tolist() == pytest.approx([3.0 * 0.5 / 0.4, 0.25 / 0.4])
    # Quadratic elements: the vertex, and the node within the element.
    at, force = np.array([0.0, 0.1, 0.2]), np.array([[3.0, 0.0], [2.0, 0.0], [9.0, 9.0]])
    jump = np.array([[0.0, 0.0], [0.4, 0.0], [0.5, 0.0]])
    assert closing_work(0.2, at, force, at, jump)[0] == pytest.approx((3.0 * 0.5 + 2.0 * 0.4) / 0.4)


def test_faces_that_overlap_or_touch_take_no_work():
    at = np.array([0.0, 0.2])
    work = closing_work(0.2, at, np.array([[-3.0, 1.0], [0.0, 0.0]]), at, np.array([[0.0, 0.0], [0.0, 0.5]]))
    assert work.tolist() == pytest.approx([0.0, 0.5 / 0.4])


FIBRES = 3
HALVES = st.integers(-1440, 1440).map(lambda n: n / 2)
OPENINGS = st.integers(0, 360).map(float)
ONE_FIBRE_OR_MORE = st.lists(st.integers(1, FIBRES), min_size=1, max_size=FIBRES, unique=True).map(tuple)
ARCS = st.lists(
    st.builds(Arc, fibre=st.just("all") | ONE_FIBRE_OR_MORE, centre=HALVES, angle=st.none() | OPENINGS), max_size=4
)
NODES = st.lists(st.tuples(st.integers(1, FIBRES), HALVES), max_size=20)


def is_within(arc, opening, fibre, angle):
    """Return whether a node is within the open arc, after any number of full turns."""
    if arc.fibre != "all" and fibre not in arc.fibre:
        return False
    whole = opening if arc.angle is None else arc.angle
    return whole >= 360 or any(abs(angle + 360 * turns - arc.centre) < whole / 2 for turns in range(-5, 6))


def arrays(nodes):
    """Fibres (k,) and directions (k,) of nodes."""
    return np.array([fibre for fibre, _ in nodes], int), np.array([angle for _, angle in nodes], float)


@given(ARCS, OPENINGS, NODES)
def test_nodes_are_debonded_that_lie_within_an_arc_after_any_turns(arcs, opening, nodes):
    expected = [any(is_within(arc, opening, *node) for arc in arcs) for node in nodes]
    assert debonded(arcs, opening, *arrays(nodes)).tolist() == expected


@given(ARCS, st.lists(OPENINGS, max_size=3))
def test_tips_are_the_ends_of_all_openings_on_the_circle(arcs, values):
    expected: dict[int, set[float]] = {}
    for arc in arcs:
        for opening in values if arc.angle is None else [arc.angle]:
            for fibre in range(1, FIBRES + 1) if arc.fibre == "all" else arc.fibre:
                if 0 < opening < 360:
                    ends = {(arc.centre + side * opening / 2) % 360 for side in (-1, 1)}
                    expected.setdefault(fibre - 1, set()).update(ends)
    assert tips(arcs, values, FIBRES) == {fibre: sorted(expected[fibre]) for fibre in sorted(expected)}


@given(
    st.lists(st.tuples(st.integers(0, FIBRES - 1), HALVES, st.integers(-2, 2), st.integers(-2, 2)), min_size=1),
    st.lists(st.tuples(st.floats(0, 1), st.floats(0, 2)), min_size=FIBRES, max_size=FIBRES),
)
def test_directions_do_not_depend_on_the_image_of_a_point(nodes, centres):
    period, centres = np.array([1.0, 2.0]), np.array(centres)
    fibre, angle, across, up = (np.array(column) for column in zip(*nodes, strict=True))
    arm = 0.3 * np.stack([np.cos(np.radians(angle)), np.sin(np.radians(angle))], axis=1)
    found = angles(centres[fibre] + arm + np.stack([across, up], axis=1) * period, fibre, centres, period)
    assert np.abs((found - angle + 180) % 360 - 180).max() < 1e-9
