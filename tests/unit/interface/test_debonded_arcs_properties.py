"""Debonded arcs against a brute-force search over full turns, on angles that binary numbers hold exactly."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from feti_homog.case.interface_section import Arc
from feti_homog.interface.debonded_arcs import angles, debonded, tips

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


@given(ARCS, OPENINGS, NODES, HALVES)
def test_turning_arcs_and_nodes_together_changes_nothing(arcs, opening, nodes, turn):
    fibre, angle = arrays(nodes)
    turned = [Arc(fibre=arc.fibre, centre=arc.centre + turn, angle=arc.angle) for arc in arcs]
    assert debonded(turned, opening, fibre, angle + turn).tolist() == debonded(arcs, opening, fibre, angle).tolist()


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


@given(ARCS, OPENINGS)
def test_the_status_changes_at_tips_only(arcs, opening):
    marks = tips(arcs, [opening], FIBRES)
    circle = np.arange(0, 360, 0.25)
    for fibre in range(FIBRES):
        status = debonded(arcs, opening, np.full(len(circle), fibre + 1), circle)
        before = np.flatnonzero(status != np.roll(status, -1))
        assert np.isin(circle[[before, (before + 1) % len(circle)]], marks.get(fibre, [])).any(axis=0).all()


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
