"""The curves of result.json: the response against the debonding angle, and along a path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from feti_homog.output.plots.canvas import STRAINS, save, unit_label
from feti_homog.output.plots.interface_marks import BONDED, CLOSED, COLOURS, OPEN, WORDS
from feti_homog.output.text import point_tables
from feti_homog.typing import Array

MACROSCOPIC = (r"\Sigma_{11}", r"\Sigma_{22}", r"\Sigma_{12}")
INK = ("#1f4e9c", "#c44e00", "#2a7f3f", "#7a3e9d")
MARKS = ("o", "s", "^", "D")
FEW = 60  # points up to which they are marked
STATES = {BONDED: "bonded", OPEN: "open", CLOSED: "closed"}


def plot(directory: Path, document: Mapping[str, Any]) -> list[Path]:
    """angle.png or path.png beside result.json, if the document has such points."""
    if document.get("angle"):
        return [save(_angle(document), directory / "angle.png")]
    if document.get("path"):
        return [save(_path(document), directory / "path.png")]
    return []


def _angle(document: Mapping[str, Any]) -> Figure:
    points, case = document["angle"], document["case"]
    figure = Figure(figsize=(5.6, 4.2), layout="constrained")
    axes = figure.subplots()
    angles = [point["angle"] for point in points]
    stiff = "stiffness" in points[0]
    names = [f"L_{{{i + 1}{j + 1}}}" for i, j in point_tables.ENTRIES.values()] if stiff else MACROSCOPIC
    entries = tuple(zip(*point_tables.ENTRIES.values(), strict=True))
    values = np.array([np.array(p["stiffness"])[entries] if stiff else p["stress"] for p in points])
    for name, column, ink, mark in zip(names, values.T, INK, MARKS, strict=False):
        axes.plot(angles, column, color=ink, marker=mark, markersize=4, linewidth=1.5, label=f"${name}$")
    axes.set_xlabel("debonding angle (degrees)")
    axes.set_ylabel("effective stiffness " * stiff + "macroscopic stress " * (not stiff) + _stress_unit(case))
    axes.xaxis.set_major_locator(MultipleLocator(60 if angles[-1] > 180 else 30))
    contact = "contact" if case["interface"]["contact"] else "no contact"
    load = "" if stiff else f", $E = [{', '.join(f'{e:g}' for e in points[0]['strain'])}]$"
    axes.set_title(f"{case.get('name', '')}: plane {case['analysis']['plane']}, {contact}{load}".lstrip(": "))
    _finish(axes)
    if stiff:
        axes.set_ylim(bottom=0.0)
    return figure


def _path(document: Mapping[str, Any]) -> Figure:
    """Stresses against the leading strain, over the numbers of bonded, open and closed nodes."""
    points, case = document["path"], document["case"]
    which = point_tables.leading(points)
    strain = np.array([point["strain"] for point in points])[:, which]
    stress = np.array([point["stress"] for point in points])
    figure = Figure(figsize=(5.8, 5.6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1))
    few = len(points) <= FEW
    style: dict[str, Any] = {"marker": "o", "markersize": 2.5} if few else {}
    held = strain_controlled(points, which) if _has_envelope(case) else None
    legs = len(case["path"].get("waypoints", [0]))
    first = len(points) if case["path"]["method"] == "increments" else _first_leg(points, legs)
    for i, (name, ink) in enumerate(zip(MACROSCOPIC, INK, strict=False)):
        width = 0.8 if held is not None else 1.4
        upper.plot(
            np.append(0.0, strain[:first]), np.append(0.0, stress[:first, i]), color=ink, linewidth=width, alpha=0.8,
            label=None if held is not None else f"${name}$", **style,
        )  # fmt: skip
        if first < len(points):
            upper.plot(strain[first - 1 :], stress[first - 1 :, i], color=ink, linewidth=0.8, marker="o", ms=2)
        if held is not None:
            upper.plot(held[:, 3], held[:, i], color=ink, linewidth=2.0, label=f"${name}$")
    if held is not None:
        upper.plot([], [], color="0.3", linewidth=0.8, **style, label="all equilibria")
        upper.plot([], [], color="0.3", linewidth=2.0, label="rising strain")
    if first < len(points):
        upper.plot([], [], color="0.3", linewidth=0.8, marker="o", ms=2, label="later legs")
    upper.set_ylabel(f"macroscopic stress {_stress_unit(case)}")
    upper.set_title(f"{case.get('name', '')}: plane {case['analysis']['plane']}, {_strengths(case)}".lstrip(": "))
    for kind, key in STATES.items():
        ink = "0.2" if kind == BONDED else COLOURS[kind]
        number = [point[key] for point in points]
        lower.plot(strain[:first], number[:first], color=ink, linewidth=1.4, label=WORDS[kind], **style)
        if first < len(points):
            lower.plot(strain[first - 1 :], number[first - 1 :], ":", color=ink, linewidth=0.8, marker="o", ms=2.5)
    lower.set_ylabel("interface nodes")
    lower.set_xlabel(f"macroscopic strain ${STRAINS[which]}$")
    for axes in (upper, lower):
        _finish(axes)
    return figure


def straight(document: Mapping[str, Any]) -> Array | None:
    """(v, 4) S11, S22, S12 and the leading strain's size along a path with one waypoint, the strain only rising.

    None of any other result.
    """
    points, case = document.get("path"), document["case"]
    if not points or len(case["path"].get("waypoints", [0])) != 1:
        return None
    which = point_tables.leading(points)
    if case["path"]["method"] == "events":
        held = strain_controlled(points, which)
    else:
        held = np.array([[0.0] * 4, *([*point["stress"], point["strain"][which]] for point in points)])
    return held * [1.0, 1.0, 1.0, np.sign(held[-1, 3])]


def strain_controlled(points: Sequence[Mapping[str, Any]], which: int) -> Array:
    """(v, 4) S11, S22, S12 and the strain `which` along a straight path when the strain only rises.

    At a load where bonds break, all break whose load is lower once the first are gone: the stress falls at
    constant strain to the next branch that holds, and each branch is a ray through zero.
    """
    load = np.array([point["load_factor"] for point in points])
    values = np.array([[*point["stress"], point["strain"][which]] for point in points])
    records = np.flatnonzero(load >= np.maximum.accumulate(load))
    vertices = [np.zeros(4), values[records[0]]]
    for before, after in pairwise(records):
        vertices += [values[after] * load[before] / load[after], values[after]]
    return np.array(vertices)


def _first_leg(points: Sequence[Mapping[str, Any]], legs: int) -> int:
    """How many points are on the first leg."""
    return next((n for n, point in enumerate(points) if point["load_factor"] > (1.0 + 1e-9) / legs), len(points))


def _has_envelope(case: Mapping[str, Any]) -> bool:
    """Whether every point is on a ray of its own: events, and one way-point."""
    path = case["path"]
    return path["method"] == "events" and len(path.get("waypoints", [0])) == 1


def _strengths(case: Mapping[str, Any]) -> str:
    bond, unit = case.get("interface", {}), case.get("output", {}).get("stress_unit", "")
    limits = ((r"R^\mathrm{n}", "normal_strength"), (r"R^\mathrm{t}", "tangential_strength"))
    words = [f"${name} = {bond[key]:g}$ {unit}".rstrip() for name, key in limits if bond.get(key)]
    return ", ".join(words) or "no debonding by load"


def _stress_unit(case: Mapping[str, Any]) -> str:
    return unit_label(case.get("output", {}).get("stress_unit", "")) or "(unit of the moduli)"


def _finish(axes: Axes) -> None:
    axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=9)
