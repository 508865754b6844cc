"""The curves of result.json: the response against the debonding angle, and along a path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, MultipleLocator

from feti_homog.materials.voigt import STRESSES, voigt_names
from feti_homog.report.plots import envelope_plot
from feti_homog.report.plots.free_places import free_offsets
from feti_homog.report.plots.interface_marks import BONDED, CLOSED, OPEN, STATE_COLOURS, STATE_NAMES
from feti_homog.report.plots.plot_helpers import bond_limits, interfaces_of, plain, save, strain_symbols, unit_label
from feti_homog.report.text.analyses import reported
from feti_homog.report.text.point_tables import shown_entries
from feti_homog.results import kept_points, path_curves
from feti_homog.results.path_peak import peak_of
from feti_homog.typing import Array

Document = Mapping[str, Any]

INK = ("#1f4e9c", "#c44e00", "#2a7f3f", "#7a3e9d", "#8a6d00", "#0f7c8c", "#8c1d40")
MARKS = ("o", "s", "^", "D", "v", "P", "X")
NUMBERED_POINTS = 6  # of a path
ARROWS, SHORTEST_ARROW = 6, 0.06  # that show its direction: how many, and on steps of which share of the picture
NEAR = 0.05  # of all points: numbers of points that are nearer stand above each other
MARKED_POINTS = 60  # points of a path up to which each has a mark
STATES = {BONDED: "bonded", OPEN: "open", CLOSED: "closed"}


def plot(directory: Path, document: Document) -> list[Path]:
    """angle.png, path.png or envelope.png beside result.json, if the document has such points."""
    name = reported(document).name
    return [save(CURVES[name](document), directory / f"{name}.png")] if name in CURVES else []


def _angle(document: Document) -> Figure:
    """Stiffnesses or stresses against the debonding angle."""
    points, case = document["angle"], document["case"]
    stiff = "stiffness" in points[0]
    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    angles = [point["angle"] for point in points]
    for (name, column), ink, mark in zip(_angle_columns(points, stiff), INK, MARKS, strict=False):
        axes.plot(angles, column, color=ink, marker=mark, markersize=4, linewidth=1.5, label=f"${name}$")
    axes.set_xlabel("debonding angle (degrees)")
    axes.set_ylabel(f"{'effective stiffness' if stiff else 'macroscopic stress'} {_stress_unit(case)}")
    axes.xaxis.set_major_locator(MultipleLocator(60 if angles[-1] > 180 else 30))
    contact = "contact" if all(bond["contact"] for bond in interfaces_of(case)) else "no contact"
    load = "" if stiff else f", $E = [{', '.join(f'{e:g}' for e in points[0]['strain'])}]$"
    axes.set_title(f"{plain(case.get('name', ''))}: plane {case['analysis']['plane']}, {contact}{load}".lstrip(": "))
    _finish(axes)
    if stiff:
        axes.set_ylim(bottom=0.0)
    return figure


def _angle_columns(points: Sequence[Mapping[str, Any]], stiff: bool) -> list[tuple[str, Array]]:
    """Each curve's name and its values (points,)."""
    if not stiff:
        stress = np.array([point["stress"] for point in points])
        return list(zip(map(_symbol, STRESSES), stress.T, strict=True))
    stiffness = np.array([point["stiffness"] for point in points])
    return [(f"C_{{{i + 1}{j + 1}}}", stiffness[:, i, j]) for i, j in shown_entries(points).values()]


def _symbol(stress: str) -> str:
    """Return the macroscopic stress of this name."""
    return rf"\Sigma_{{{stress[1:]}}}"


def _path(document: Document) -> Figure:
    """Stresses against the leading strain.

    Below, they and the numbers of bonded, open and closed nodes against the number of the point, for the first folds
    back. Some points are numbered in all three.
    """
    points, case = document["path"], document["case"]
    component, shown = path_curves.leading_component(document), path_curves.shown_stresses(document)
    strains, stress = (np.array([point[name] for point in points]) for name in ("strain", "stress"))
    strain = strains[:, component]
    style: dict[str, Any] = {"marker": "o", "markersize": 2.5} if len(points) <= MARKED_POINTS else {}
    figure = Figure(figsize=(7.2, 8.0), layout="constrained")
    upper, middle, lower = figure.subplots(3, 1, height_ratios=(2.2, 1, 1))
    middle.sharex(lower)
    _stress_curves(upper, document, strain, shown, style)
    upper.set_ylabel(f"macroscopic stress {_stress_unit(case)}")
    upper.set_xlabel(f"macroscopic strain ${strain_symbols(strains.shape[1])[component]}$")
    upper.set_title(_path_title(case))
    for number in shown:
        middle.plot(stress[:, number], color=INK[number], linewidth=1.2, **style)
    _temperature(middle, points, style)
    middle.set_ylabel(f"stress {_stress_unit(case)}")
    middle.tick_params(labelbottom=False)
    _count_curves(lower, points, style)
    lower.set_xlabel("number of the point, in the order of the path")
    # The panels of path_states.png show the same points.
    kept = kept_points.kept_points(document)
    numbers = [kept[state] for state in kept_points.landmark_states(document, NUMBERED_POINTS, len(kept))]
    curve = np.stack([strain, stress[:, component]], axis=1)
    _mark_peak(upper, document, INK[component])
    for axes in (upper, middle, lower):
        _finish(axes)
    _number_points(upper, (middle, lower), curve, numbers, INK[component])
    _damaged_length(lower, document, style)
    return figure


def _mark_peak(axes: Axes, document: Document, ink: str) -> None:
    """Mark the peak, with its stress in words."""
    peak, unit = peak_of(document), document["case"].get("output", {}).get("stress_unit", "")
    words = f"peak {peak['stress']:.4g} {plain(unit)}".rstrip()
    axes.plot(peak["strain"], peak["stress"], "*", color=ink, markersize=11, markeredgecolor="white", zorder=5,
              linestyle="none", label=words)  # fmt: skip


def _stress_curves(
    axes: Axes, document: Document, strain: Array, shown: Sequence[int], style: Mapping[str, Any]
) -> None:
    """Draw the first leg with its snap-back, and thick the response to a controlled load on all legs."""
    points, first = document["path"], path_curves.first_leg(document)
    stress = np.array([point["stress"] for point in points])
    names = voigt_names(stress.shape[1])[1]
    rising = path_curves.load_controlled(points[:first]) if document["case"]["path"]["method"] == "events" else None
    along = stress.shape[1] + path_curves.leading_component(document)
    for i in shown:
        name, ink = _symbol(names[i]), INK[i]
        thin: dict[str, Any] = {"label": f"${name}$", "linewidth": 1.4} if rising is None else {"linewidth": 0.8}
        from_zero = np.append(0.0, strain[:first]), np.append(0.0, stress[:first, i])
        axes.plot(*from_zero, color=ink, alpha=0.8, **thin, **style)
        if first < len(points):
            axes.plot(strain[first - 1 :], stress[first - 1 :, i], color=ink, linewidth=2.0, marker="o", ms=3.5)
        if rising is not None:
            axes.plot(rising[:, along], rising[:, i], color=ink, linewidth=2.0, label=f"${name}$")
    if rising is not None:
        of_some = "\nof the first leg" if first < len(points) else ""
        axes.plot([], [], color="0.3", linewidth=0.8, **style, label=f"all equilibria{of_some}")
        axes.plot([], [], color="0.3", linewidth=2.0, label=f"rising {path_curves.what_rises(document)}")
    if first < len(points):
        axes.plot([], [], color="0.3", linewidth=2.0, marker="o", ms=3.5, label="later legs")
    axes.xaxis.set_major_locator(MaxNLocator(7))


def _temperature(axes: Axes, points: Sequence[Mapping[str, Any]], style: Mapping[str, Any]) -> None:
    """Draw the change of temperature along a path, if there is any, on its own axis."""
    if any(point.get("temperature") for point in points):
        _beside(axes, [point["temperature"] for point in points], r"change of temperature $\Delta T$", style)


def _damaged_length(axes: Axes, document: Document, style: Mapping[str, Any]) -> None:
    """Draw the length of bonds that are damaged but hold, of laws that soften, on its own axis."""
    if "damaged_length" in document["path"][0]:
        unit = unit_label(document["case"].get("output", {}).get("length_unit", ""))
        lengths = [sum(point["damaged_length"]) for point in document["path"]]
        _beside(axes, lengths, f"damaged length {unit}".rstrip(), style)
        axes.legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(1.12, 1.0))


def _beside(axes: Axes, values: Sequence[float], label: str, style: Mapping[str, Any]) -> None:
    """Draw values along a path on an axis at the right."""
    beside = axes.twinx()
    beside.plot(values, color="0.5", linestyle="--", linewidth=1.0, **style)
    beside.axhline(0.0, linestyle="none")  # from which they are measured
    beside.set_ylabel(label, color="0.4", fontsize=8)
    beside.tick_params(colors="0.4", labelsize=8)
    beside.spines["top"].set_visible(False)


def _count_curves(axes: Axes, points: Sequence[Mapping[str, Any]], style: Mapping[str, Any]) -> None:
    """Numbers of bonded, open and closed nodes."""
    for kind, key in STATES.items():
        ink = "0.2" if kind == BONDED else STATE_COLOURS[kind]
        axes.plot([point[key] for point in points], color=ink, linewidth=1.4, label=STATE_NAMES[kind], **style)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_ylabel("interface nodes")


def _number_points(upper: Axes, below: Sequence[Axes], curve: Array, numbers: Sequence[int], ink: str) -> None:
    """Draw the numbers of some points of a curve (points, 2), arrows in its ink, and lines at their numbers below."""
    style: dict[str, Any] = {"color": "0.3", "fontsize": 7, "ha": "center", "va": "center"}
    pointer: dict[str, Any] = {"arrowstyle": "-", "color": "0.3", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 2}
    span, level = max(len(curve) - 1, 1), 0
    for number, offset in zip(numbers, free_offsets(upper, curve[numbers]), strict=True):
        upper.annotate(str(number), curve[number], offset, textcoords="offset points", arrowprops=pointer, **style)
    for place, number in enumerate(numbers):
        for axes in below:
            axes.axvline(number, color="0.7", linewidth=0.7, linestyle=":", zorder=0)
        level = level + 1 if place and number - numbers[place - 1] < NEAR * span else 0
        above = (number, 1.05 + 0.1 * level)
        below[0].annotate(str(number), above, xycoords=below[0].get_xaxis_transform(), annotation_clip=False, **style)
    pointer = {"arrowstyle": "-|>", "color": ink, "linewidth": 0, "shrinkB": 0, "mutation_scale": 15}
    for (x0, y0), (x1, y1) in _direction_marks(curve):
        upper.annotate("", (x1, y1), (x0, y0), arrowprops=pointer)


def _direction_marks(curve: Array) -> list[tuple[Array, Array]]:
    """Return starts and ends of arrows on a curve (points, 2): in the middles of its longest steps, and few."""
    steps = np.diff(np.vstack([np.zeros(2), curve]), axis=0)
    extent = np.ptp(np.vstack([np.zeros(2), curve]), axis=0)
    length = np.linalg.norm(steps / np.where(extent > 0.0, extent, 1.0), axis=1)
    longest = np.argsort(-length, kind="stable")[:ARROWS]
    starts = np.vstack([np.zeros(2), curve[:-1]])
    middles = starts + 0.5 * steps
    return [(starts[k], middles[k] + 0.02 * steps[k]) for k in sorted(longest) if length[k] > SHORTEST_ARROW]


def _path_title(case: Mapping[str, Any]) -> str:
    """Return the title: the case and its laws, a line per interface if there are several."""
    title = f"{plain(case.get('name', ''))}: plane {case['analysis']['plane']}".lstrip(": ")
    return "\n".join([title, *bond_limits(case)])


def _stress_unit(case: Mapping[str, Any]) -> str:
    return unit_label(case.get("output", {}).get("stress_unit", "")) or "(unit of the moduli)"


def _finish(axes: Axes) -> None:
    axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(1.0, 1.0))


CURVES = {"angle": _angle, "path": _path, "envelope": envelope_plot.figure}
