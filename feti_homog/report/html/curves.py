"""Interactive curves of a result, by Bokeh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool
from bokeh.plotting import figure

from feti_homog.materials.voigt import STRESSES, voigt_names
from feti_homog.report.plots.interface_marks import BONDED, CLOSED, OPEN, STATE_COLOURS, STATE_NAMES
from feti_homog.report.plots.path_picture import AREAS
from feti_homog.report.plots.plot_helpers import INK
from feti_homog.report.text.analyses import reported
from feti_homog.report.text.point_tables import shown_entries
from feti_homog.results import path_curves
from feti_homog.typing import Array, Document

COUNTS = {BONDED: "bonded", OPEN: "open", CLOSED: "closed"}
MARKERS = "shown"  # name of the sources whose point the viewer of states moves
DIRECTIONS = 181
EQUILIBRIA = 0.4  # opacity

Curves = Mapping[str, Array]


def figures(document: Document) -> dict[str, Any]:
    """Return the figures of a result by name; none for a stiffness with debonded faces, which is not linear."""
    unit = document["case"]["output"].get("stress_unit", "") or "unit of the moduli"
    name = reported(document).name
    return FIGURES[name](document, unit) if name in FIGURES else {}


def _stiffness(document: Document, unit: str) -> dict[str, Any]:
    linear = document.get("moduli") is not None
    return {"young": _young(np.array(document["effective_stiffness"]), unit)} if linear else {}


def _path(document: Document, unit: str) -> dict[str, Any]:
    points = document["path"]
    component, shown = path_curves.leading_component(document), path_curves.shown_stresses(document)
    strains, stresses = (np.array([point[name] for point in points]) for name in ("strain", "stress"))
    strain, (strain_names, names) = strains[:, component], voigt_names(strains.shape[1])
    stress = {names[k]: stresses[:, k] for k in shown}
    number = np.arange(len(points))
    first = _figure(
        "Stress against strain", f"macroscopic strain {strain_names[component]}", f"macroscopic stress ({unit})"
    )
    _draw(first, strain, stress, number)
    if path_curves.is_proportional(document):
        # Equilibria, with their snap-back, are behind the response to a rising load.
        for line in first.renderers:
            line.glyph.line_alpha = EQUILIBRIA
        rising = path_curves.load_controlled(points)
        for k, ink in zip(shown, INK, strict=False):
            label = f"{names[k]}, rising {path_curves.what_rises(document)}"
            x, y = rising[:, len(names) + component], rising[:, k]
            first.line(x, y, color=ink, line_width=2.5, legend_label=label)
    second = _figure("Stress along the path", "number of the point", f"macroscopic stress ({unit})")
    _draw(second, number, stress, number)
    found = {"curve": _finished(first), "along": _finished(second), "counts": _counts(points, number, second.x_range)}
    if "damaged_length" in points[0]:
        length = document["case"]["output"].get("length_unit", "") or "unit of the cell"
        third = _figure("Damaged bonds that hold", "number of the point", f"damaged length ({length})")
        third.x_range = second.x_range
        _draw(third, number, {"damaged": np.array([sum(point["damaged_length"]) for point in points])}, number)
        found["damaged"] = _finished(third)
    return found | _energies(document, unit)


def _energies(document: Document, unit: str) -> dict[str, Any]:
    """Return the energies along a path, stacked, with the work of the loads."""
    stack = path_curves.energies(document)
    if stack is None:
        return {}
    drawn, names = _figure("Energies along the path", stack.words, f"energy per area ({unit})"), list(stack.parts)
    source = ColumnDataSource({"x": stack.place, "work": stack.work, **stack.parts})
    drawn.varea_stack(names, x="x", source=source, color=[AREAS[name] for name in names], legend_label=names)
    line = drawn.line("x", "work", source=source, color="#262626", line_width=1.5, legend_label="work of the loads")
    tooltips = [(name, f"@{{{name}}}{{0.000000}}") for name in ("work", *names)]
    drawn.add_tools(HoverTool(renderers=[line], tooltips=tooltips, mode="vline"))
    return {"energy": _finished(drawn)}


def _angle(document: Document, unit: str) -> dict[str, Any]:
    points = document["angle"]
    angles, number = np.array([point["angle"] for point in points]), np.arange(len(points))
    if points[0].get("stiffness") is not None:
        stiffness = np.array([point["stiffness"] for point in points])
        curves = {name: stiffness[:, i, j] for name, (i, j) in shown_entries(points).items()}
        what = "effective stiffness"
    else:
        stress = np.array([point["stress"] for point in points])
        curves, what = dict(zip(STRESSES, stress.T, strict=True)), "macroscopic stress"
    words = "debonding angle (degrees)"
    first = _figure(f"{what.capitalize()} against the debonding angle", words, f"{what} ({unit})")
    _draw(first, angles, curves, number)
    second = _counts(points, angles, first.x_range)
    second.xaxis.axis_label = words
    return {"curve": _finished(first), "counts": second}


def _young(stiffness: Array, unit: str) -> Any:
    """1 / E = s . C^-1 s, s the unit tension [cos^2, sin^2, cos sin] in each direction."""
    angle = np.linspace(0.0, 180.0, DIRECTIONS)
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    tension = np.stack([c * c, s * s, c * s])
    young = 1.0 / (tension * np.linalg.solve(stiffness, tension)).sum(axis=0)
    drawn = _figure("Young's modulus of the plane state", "direction from x1 (degrees)", f"E ({unit})")
    drawn.line(angle, young, color=INK[0], line_width=2, legend_label="E")
    least, most = float(young.min()), float(young.max())
    room = max(0.2 * (most - least), 0.02 * most)
    drawn.y_range.start, drawn.y_range.end = least - room, most + room
    drawn.add_tools(HoverTool(tooltips=[("direction", "@x{0}°"), ("E", "@y{0.0000}")], mode="vline"))
    return _finished(drawn)


def _figure(title: str, x: str, y: str) -> Any:
    return figure(
        name=title, title=title, x_axis_label=x, y_axis_label=y, height=360, sizing_mode="stretch_width",
        tools="pan,wheel_zoom,box_zoom,reset,save", toolbar_location="above",
    )  # fmt: skip


def _draw(drawn: Any, x: Array, curves: Curves, number: Array) -> None:
    """Curves with the number of each point, and a ring at the point that the viewer shows."""
    rings = []
    for (name, values), ink in zip(curves.items(), INK, strict=False):
        source = ColumnDataSource({"x": x, "y": values, "number": number})
        drawn.line("x", "y", source=source, color=ink, line_width=1.6, legend_label=name)
        rings.append(drawn.scatter("x", "y", source=source, color=ink, size=4, legend_label=name))
        ring = ColumnDataSource({"x": x[:1], "y": values[:1]}, name=MARKERS, tags=[x.tolist(), values.tolist()])
        drawn.scatter("x", "y", source=ring, size=13, fill_alpha=0.0, line_color=ink, line_width=2)
    tooltips = [("point", "@number"), (drawn.xaxis[0].axis_label, "@x{0.000000}"), ("value", "@y{0.000000}")]
    drawn.add_tools(HoverTool(renderers=rings, tooltips=tooltips))


def _counts(points: Sequence[Document], x: Array, x_range: Any) -> Any:
    """Bonded, open and closed nodes."""
    drawn = _figure("States of the interface nodes", "number of the point", "interface nodes")
    drawn.x_range = x_range
    for kind, key in COUNTS.items():
        ink = "#333333" if kind == BONDED else STATE_COLOURS[kind]
        values = np.array([point[key] for point in points])
        drawn.line(x, values, color=ink, line_width=2, legend_label=STATE_NAMES[kind])
        ring = ColumnDataSource({"x": x[:1], "y": values[:1]}, name=MARKERS, tags=[x.tolist(), values.tolist()])
        drawn.scatter("x", "y", source=ring, size=10, fill_color="white", line_color=ink, line_width=2)
    drawn.add_tools(HoverTool(tooltips=[("point", "$index"), ("nodes", "@y")]))
    return _finished(drawn)


def _finished(drawn: Any) -> Any:
    drawn.toolbar.logo = None
    drawn.legend.click_policy = "hide"
    drawn.legend.border_line_color = None
    drawn.legend.label_text_font_size = "12px"
    drawn.add_layout(drawn.legend[0], "right")
    drawn.grid.grid_line_color = "#ececec"
    drawn.outline_line_color = None
    drawn.title.text_font_size = "14px"
    return drawn


FIGURES = {"stiffness": _stiffness, "angle": _angle, "path": _path}
