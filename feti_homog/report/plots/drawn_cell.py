"""Draw the parts of cell pictures: triangles, frame with a colour bar, interface, load labels."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.spatial import cKDTree

from feti_homog.materials import voigt
from feti_homog.report.plots.decimation import SAME_PLACE, TRIANGLE_LIMIT, DrawnMesh, drawn_mesh, outline_edges
from feti_homog.report.plots.plot_helpers import PLAIN, SYMBOLS, Look, draw_segments, unit_label
from feti_homog.report.text.summary import reported
from feti_homog.results import path_curves
from feti_homog.typing import Array, Document

# States of an interface node: the status in result.h5, or DAMAGED for a damaged bond that holds.
BONDED, CLOSED, OPEN, DAMAGED = range(4)
STATE_NAMES = {BONDED: "bonded", DAMAGED: "damaged", CLOSED: "in contact", OPEN: "open"}
STATE_COLOURS = {BONDED: "black", CLOSED: "#E69F00", OPEN: "#0072B2"}
STATE_WIDTHS = {BONDED: 0.8, CLOSED: 2.6, OPEN: 2.0, DAMAGED: 2.0}
SIDE, MARGINS = 4.8, np.array([1.9, 1.4])  # inches: longer side of a cell in a picture, room for text and a bar
# An edge has the state of the end whose state comes later in this order.
ORDER = np.array(list(STATE_NAMES))


@dataclass(frozen=True)
class InterfaceEdges:
    """The drawn edges on both faces of the interfaces, with interface nodes at their ends."""

    edges: Array  # (e, 2) drawn nodes
    nodes: Array  # (e, 2) rows of /interface

    @classmethod
    def of(cls, file: Any, drawn: DrawnMesh, borders: Array) -> InterfaceEdges:
        """Find the interface edges among the body outlines `borders` (b, 2).

        All periodic images of an interface node share one row in /interface.
        """
        points, period = file["interface/points"][:], np.array([file.attrs["width"], file.attrs["height"]])
        if not len(points):
            return cls(borders[:0], borders[:0])
        tolerance = SAME_PLACE * float(period[0])
        tree = cKDTree(_wrapped(points, period, tolerance), boxsize=period * (1.0 + 1e-12))
        ends = _wrapped(drawn.points[borders.ravel()], period, tolerance)
        distance, nearest = tree.query(ends, distance_upper_bound=2 * tolerance)
        is_present = np.isfinite(distance).reshape(-1, 2).all(axis=1)
        return cls(borders[is_present], nearest.reshape(-1, 2)[is_present])

    def state(self, status: Array) -> Array:
        """Return edge states (e,) for node states `status` (k,): of the two ends, the state later in STATE_NAMES."""
        return np.asarray(ORDER[np.argsort(ORDER)[status[self.nodes]].max(axis=1, initial=0)])

    def mark(self, axes: Axes, points: Array, state: Any, magnified: float = 1.0) -> list[Line2D]:
        """Draw the interface edges in a state, with nodes at `points` (p, 2) and `magnified` widths.

        Returns legend lines of drawn states.  Colours of damaged edges show the larger damage of their ends in tenths.
        """
        states = self.state(states_of_nodes(state))
        damage = state["damage"][:][self.nodes].max(axis=1, initial=0.0)
        present = [kind for kind in STATE_NAMES if (states == kind).any()]
        for kind in present:
            segments = points[self.edges[states == kind]]
            cap: Literal["butt", "round"] = "butt" if kind == BONDED else "round"
            if kind != BONDED:
                # A white edge shows on every colour; magenta and orange vanish on red.
                draw_segments(axes, segments, "white", magnified * (STATE_WIDTHS[kind] + 1.6), cap)
            tenths = np.ceil(10.0 * damage[states == kind]) if kind == DAMAGED else np.ones(len(segments))
            for tenth in np.unique(tenths):
                ink = damage_colour(tenth / 10.0) if kind == DAMAGED else STATE_COLOURS[kind]
                draw_segments(axes, segments[tenths == tenth], ink, magnified * STATE_WIDTHS[kind], cap)
        return state_legend(present)


@dataclass(frozen=True)
class DrawnCell:
    """An open result.h5 with drawn triangles, body outlines and interface."""

    file: Any
    drawn: DrawnMesh
    borders: Array  # (e, 2) drawn nodes
    interface: InterfaceEdges

    @classmethod
    def of(cls, file: Any, limit: int = TRIANGLE_LIMIT) -> DrawnCell:
        """Read the cell of an open result.h5, coarsened to `limit` triangles if its refinement allows."""
        drawn = drawn_mesh(file, limit)
        borders = outline_edges(drawn, drawn.body)
        return cls(file, drawn, borders, InterfaceEdges.of(file, drawn, borders))


def states_of_nodes(state: Any) -> Array:
    """Return the interface node states (k,) in a state of result.h5.  Damaged bonds that hold are DAMAGED."""
    status = state["status"][:]
    return np.asarray(np.where((status == BONDED) & (state["damage"][:] > 0.0), DAMAGED, status))


def damage_colour(damage: float) -> Any:
    """Return the colour for a damage value between 0 and 1."""
    return mpl.colormaps["BuPu"](0.35 + 0.65 * damage)


def state_legend(kinds: Collection[int]) -> list[Line2D]:
    """Return legend lines of interface states, with lines for three damage values."""
    lines = [(STATE_NAMES[k], STATE_COLOURS[k], STATE_WIDTHS[k]) for k in kinds if k != DAMAGED]
    if DAMAGED in kinds:
        lines += [(f"damage {d:g}", damage_colour(d), STATE_WIDTHS[DAMAGED]) for d in (0.1, 0.5, 1.0)]
    return [Line2D([], [], color=ink, linewidth=width, label=name) for name, ink, width in lines]


def _wrapped(points: Array, period: Array, tolerance: float) -> Array:
    """Move points by whole periods into [0, period).  Coordinates within `tolerance` below the period become 0."""
    inside = np.mod(points, period)
    inside[inside > period - tolerance] = 0.0
    return np.asarray(inside)


def figure_of(attributes: Any, look: Look = PLAIN) -> tuple[Figure, Axes]:
    """Return a figure with axes for the cell, and room for text and a colour bar."""
    sides = np.array([attributes["width"], attributes["height"]])
    width, height = SIDE * sides / sides.max()
    figure = look.figure(width + MARGINS[0], max(height, width / 4) + MARGINS[1], "compressed")
    return figure, figure.subplots()


def label_cell_axes(axes: Axes, attributes: Any) -> None:
    unit = unit_label(attributes["length_unit"]) or "(cell units)"
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.margins(0.03)
    axes.set(xlabel=f"$x_1$ {unit}", ylabel=f"$x_2$ {unit}")


def bar_beside(axes: Axes, shapes: Any, extend: str) -> Any:
    """Add a colour bar for `shapes` to the right of the axes; return the bar.

    The bar is as high as the cell, and at least 1/4 of the longer cell side; its width is 1/25 of the longer side.
    """
    figure: Any = axes.figure
    sides: Any = axes.dataLim.size
    width, height = np.maximum(sides.max() / sides * (0.04, 0.25), (0.0, 1.0)).tolist()
    place = axes.inset_axes((1.0 + 0.75 * width, 0.5 * (1.0 - height), width, height))
    return figure.colorbar(shapes, cax=place, extend=extend)


@dataclass(frozen=True)
class LoadLabels:
    """The labels of loads for the states of a result.

    Attributes:
        leading: index of the leading strain of a path; None for other analyses.
        least_stress: stresses up to this size are rounding errors.
        given: load of analysis "load", by name.
    """

    leading: int | None = None
    least_stress: float = 0.0
    given: Mapping[str, float] | None = None

    @classmethod
    def of(cls, document: Document) -> LoadLabels:
        """Create the load labels from the document of a result.json."""
        analysis = reported(document)
        if analysis.is_followed:
            return cls(path_curves.leading_component(document), path_curves.noise(document))
        return cls(given=document["case"][analysis.name]["to"] if analysis.picture else None)

    def words(self, attributes: Any) -> list[str]:
        """Return the strains above FAINT and the temperature of a state, unless 0, as formulas; or ["no strain"].

        A path with many strains shows the leading strain and its stress; analysis `load` shows the given components.
        """
        if self.given is not None:
            return [_formula(name, value) for name, value in self.given.items()]
        strain, temperature = np.asarray(attributes["strain"]), float(attributes.get("temperature", 0.0))
        strains, stresses = voigt.voigt_names(len(strain))
        loads = [(strains[k], float(strain[k])) for k in path_curves.components_above(path_curves.FAINT, strain[None])]
        if self.leading is not None and len(loads) > 2:
            k, stress = self.leading, float(attributes["stress"][self.leading])
            visible_stress = stress if abs(stress) > self.least_stress else 0.0
            loads = [(strains[k], float(strain[k])), (stresses[k], visible_stress)]
        if temperature != 0.0:
            loads.append(("temperature", temperature))
        return [_formula(name, value) for name, value in loads] or ["no strain"]

    def label(self, attributes: Any, in_line: int = 4) -> str:
        """Join the formulas of a state to a label, with `in_line` formulas per line."""
        formulas = self.words(attributes)
        return ",\n".join(", ".join(formulas[k : k + in_line]) for k in range(0, len(formulas), in_line))


def _formula(name: str, value: float) -> str:
    mantissa, _, exponent = f"{value:.4g}".partition("e")
    power = rf"{{\cdot}}10^{{{int(exponent)}}}" if exponent else ""
    return f"${SYMBOLS[name]}={{{mantissa}}}{power}$"
