"""Numbers of points beside curves: they hide no curve, no other number, and stay within their axes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from matplotlib.figure import Figure

from feti_homog.report.plots.path_picture import free_offsets

SAWTOOTH = np.array([[0, 0], [1, 9], [1, 5], [2, 10], [2, 3], [3, 4]])
"""Peaks below the upper side, and points at the foot of a drop."""


def boxes(axes, points):
    """Centres of the numbers, and pixels of half of their width and height."""
    pixel = axes.get_figure().dpi / 72
    offsets = np.array(free_offsets(axes, points))
    return axes.transData.transform(points) + offsets * pixel, np.array([11.0, 4.0]) * pixel


@pytest.mark.parametrize("numbered", [[1, 2, 3, 4, 5], [3], [4], [0, 5]])
def test_numbers_hide_nothing(numbered):
    axes = Figure(figsize=(6, 4), layout="constrained").subplots()
    axes.plot(*SAWTOOTH.T)
    centres, half = boxes(axes, SAWTOOTH[numbered])
    ends = axes.transData.transform(SAWTOOTH)
    shares = np.linspace(0, 1, 500)[:, None]
    curve = np.vstack([a + shares * (b - a) for a, b in itertools.pairwise(ends)])
    for k, centre in enumerate(centres):
        assert not (np.abs(curve - centre) < half).all(axis=1).any()
        assert axes.get_window_extent().contains(*(centre - half)) and axes.get_window_extent().contains(
            *(centre + half)
        )
        assert not (np.abs(np.delete(centres, k, axis=0) - centre) < half).all(axis=1).any()


def test_limits_stay_where_numbers_were_placed():
    axes = Figure().subplots()
    axes.plot([0, 1], [0, 1])
    free_offsets(axes, np.array([[1.0, 1.0]]))
    before = axes.get_ylim()
    axes.plot([0, 1], [0, 100])
    assert axes.get_ylim() == before
