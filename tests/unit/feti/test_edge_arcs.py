"""Normals along arcs: against the ellipse itself, and against straight lines."""

import numpy as np
import pytest

from feti_homog.feti.decomposition.shared_entities import along
from feti_homog.microstructure.shapes.ellipses import Ellipses

A, B = 0.5, 0.2


def tangents(angle, turn):
    """(k, 2) dx / ds at the angles (k,) of the ellipse of semi-axes A and B."""
    return np.stack([-A * turn * np.sin(angle), B * turn * np.cos(angle)], axis=1)


def test_between_the_ends_of_an_arc_is_what_the_ellipse_has():
    start, turn, place = 0.3, 0.4, np.linspace(0, 1, 7)
    ends = np.repeat(np.stack([tangents(np.array([start + s * turn]), turn)[0] for s in (0, 1)])[None], 7, axis=0)
    found = along(ends, np.full(7, turn), place)
    assert found == pytest.approx(tangents(start + place * turn, turn), abs=1e-15)
    own = Ellipses.of(np.zeros((7, 2)), np.full(7, A), np.full(7, B), np.zeros(7))
    normal = np.stack([found[:, 1], -found[:, 0]], axis=1) / np.hypot(*found.T)[:, None]
    assert normal == pytest.approx(own.normal(start + place * turn), abs=1e-14)


def test_along_straight_edges_nothing_turns():
    ends = np.repeat(np.random.default_rng(0).normal(size=(5, 1, 2)), 2, axis=1)
    place = np.linspace(0, 1, 5)
    assert along(ends, np.zeros(5), place) == pytest.approx(ends[:, 0], rel=1e-15)
