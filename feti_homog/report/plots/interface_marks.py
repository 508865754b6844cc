"""A cell as pictures show it, and its interface: which drawn edges are bonded, damaged, in contact or open."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from scipy.spatial import cKDTree

from feti_homog.report.plots.decimation import TRIANGLE_LIMIT, DrawnMesh, drawn_mesh, outline_edges
from feti_homog.report.plots.plot_helpers import draw_segments
from feti_homog.typing import Array

BONDED, CLOSED, OPEN, DAMAGED = 0, 1, 2, 3
STATE_NAMES = {BONDED: "bonded", DAMAGED: "damaged", CLOSED: "in contact", OPEN: "open"}
STATE_COLOURS = {BONDED: "black", CLOSED: "#ff7f0e", OPEN: "#00a14b", DAMAGED: "#9467bd"}
STATE_WIDTHS = {BONDED: 0.8, CLOSED: 2.6, OPEN: 2.0, DAMAGED: 2.0}
# The state of an edge is the one of its ends that comes last here.
ORDER = np.array(list(STATE_NAMES))
HALO = 1.6  # points
SAME_PLACE = 1e-6  # of the width of the cell


@dataclass(frozen=True)
class InterfaceEdges:
    """The drawn edges on fibre-matrix interfaces, those of either face, and the interface nodes at their ends."""

    edges: Array  # (e, 2) drawn nodes
    nodes: Array  # (e, 2) rows of /interface

    @classmethod
    def of(cls, file: Any, drawn: DrawnMesh, borders: Array) -> InterfaceEdges:
        """Return those among the outlines of the bodies; /interface has one node for all its periodic images."""
        points, period = file["interface/points"][:], np.array([file.attrs["width"], file.attrs["height"]])
        if not len(points):
            return cls(borders[:0], borders[:0])
        near = SAME_PLACE * float(period[0])
        tree = cKDTree(_wrapped(points, period, near), boxsize=period * (1.0 + 1e-12))
        ends = _wrapped(drawn.points[borders.ravel()], period, near)
        distance, nearest = tree.query(ends, distance_upper_bound=2 * near)
        there = np.isfinite(distance).reshape(-1, 2).all(axis=1)
        return cls(borders[there], nearest.reshape(-1, 2)[there])

    def state(self, status: Array) -> Array:
        """(e,) states of the edges for those of the nodes: open if an end is, else in contact or damaged if one is."""
        states: Array = ORDER[np.argsort(ORDER)[status[self.nodes]].max(axis=1, initial=0)]
        return states

    def mark(self, axes: Axes, points: Array, status: Array, magnified: float = 1.0) -> list[Line2D]:
        """Draw the edges at the places (p, 2) of the drawn nodes; returns a legend of the states that there are."""
        states = self.state(status)
        found = [kind for kind in STATE_NAMES if (states == kind).any()]
        for kind in found:
            segments = points[self.edges[states == kind]]
            cap: Literal["butt", "round"] = "butt" if kind == BONDED else "round"
            if kind != BONDED:
                # Seen on every colour: magenta and orange are not, on red.
                draw_segments(axes, segments, "white", magnified * (STATE_WIDTHS[kind] + HALO), cap)
            draw_segments(axes, segments, STATE_COLOURS[kind], magnified * STATE_WIDTHS[kind], cap)
        return state_legend(found)


@dataclass(frozen=True)
class DrawnCell:
    """An open result.h5 with its drawn triangles, the outlines of its bodies, and its interface."""

    file: Any
    drawn: DrawnMesh
    borders: Array  # (e, 2) drawn nodes
    interface: InterfaceEdges

    @classmethod
    def of(cls, file: Any, limit: int = TRIANGLE_LIMIT) -> DrawnCell:
        """Return that of a file, in about so many triangles at most."""
        drawn = drawn_mesh(file, limit)
        borders = outline_edges(drawn, drawn.body)
        return cls(file, drawn, borders, InterfaceEdges.of(file, drawn, borders))


def states_of_nodes(state: Any) -> Array:
    """(k,) states of the interface nodes in a group of result.h5: their status, DAMAGED of damaged bonds that hold."""
    status = state["status"][:]
    damage = state["damage"][:] if "damage" in state else np.zeros(len(status))
    nodes: Array = np.where((status == BONDED) & (damage > 0.0), DAMAGED, status)
    return nodes


def state_legend(kinds: list[int]) -> list[Line2D]:
    return [Line2D([], [], color=STATE_COLOURS[k], linewidth=STATE_WIDTHS[k], label=STATE_NAMES[k]) for k in kinds]


def _wrapped(points: Array, period: Array, near: float) -> Array:
    """Return the points' images in [0, period), those within `near` of the upper ends at 0."""
    inside = np.mod(points, period)
    inside[inside > period - near] = 0.0
    wrapped: Array = inside
    return wrapped
