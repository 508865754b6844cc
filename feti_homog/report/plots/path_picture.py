"""path.png and energy.png: stresses, interface states and energies along a path."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from feti_homog.materials import voigt
from feti_homog.report.plots import drawn_cell, plot_helpers
from feti_homog.results import landmarks, path_curves
from feti_homog.typing import Array, Document

ARROWS = 6  # most arrows along a path
LEGIBLE = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5}  # background of numbers on curves
STATES = {drawn_cell.BONDED: "bonded", drawn_cell.OPEN: "open", drawn_cell.CLOSED: "closed"}
UNLOADED = np.linspace(0.0, 1.0, 16, endpoint=False)  # fractions of the first load, before the first point
# Colours of the parts of the energy.
AREAS = {
    "stored in the bodies": "#9db8de",
    "stored in springs": "#5d86c4",
    "fracture energy": "#d98a54",
    "lost in breaks beyond it": "#f0cfb3",
    "lost in breaks": "#d98a54",
    "heat of friction": "#b8455f",
}


def figure(document: Document) -> Figure:
    """Draw stresses against the leading strain, and the path against point numbers.

    The lower panels show stresses, and counts of bonded, open and closed nodes, against point numbers, because the
    upper curve folds back.  All three panels number the same selected points.
    """
    points, case = document["path"], document["case"]
    component, components = path_curves.leading_component(document), path_curves.shown_stresses(document)
    strains, stress = (np.array([point[name] for point in points]) for name in ("strain", "stress"))
    strain = strains[:, component]
    style: dict[str, Any] = {"marker": "o", "markersize": 2.5} if len(points) <= 60 else {}
    picture = Figure(figsize=(7.2, 8.0), layout="constrained")
    upper, middle, lower = picture.subplots(3, 1, height_ratios=(2.2, 1, 1))
    middle.sharex(lower)
    _stress_curves(upper, document, strain, components, style)
    upper.set_ylabel(f"macroscopic stress {plot_helpers.stress_unit(case)}")
    upper.set_xlabel(f"macroscopic strain ${plot_helpers.SYMBOLS[voigt.voigt_names(strains.shape[1])[0][component]]}$")
    upper.set_title(
        "\n".join([plot_helpers.title_of(case, f"plane {case['analysis']['plane']}"), *plot_helpers.bond_limits(case)])
    )
    for number in components:
        middle.plot(stress[:, number], color=plot_helpers.INK[number], linewidth=1.2, **style)
    if any(point.get("temperature") for point in points):
        changes = [point["temperature"] for point in points]
        _beside(middle, changes, r"change of temperature $\Delta T$", style)
    middle.set_ylabel(f"stress {plot_helpers.stress_unit(case)}")
    middle.tick_params(labelbottom=False)
    _count_curves(lower, points, style)
    # The panels of path_states.png show the same points.
    by_state = landmarks.kept_points(document)
    numbers = [by_state[state] for state in landmarks.landmark_states(document, 6, len(by_state))]
    curve = np.stack([strain, stress[:, component]], axis=1)
    peak, unit = landmarks.peak_of(document), case.get("output", {}).get("stress_unit", "")
    caption = f"{landmarks.name_of(document, peak)} {peak['stress']:.4g} {plot_helpers.plain(unit)}".rstrip()
    star: dict[str, Any] = {"markersize": 11, "markeredgecolor": "white", "zorder": 5, "linestyle": "none"}
    upper.plot(peak["strain"], peak["stress"], "*", color=plot_helpers.INK[component], **star, label=caption)
    for axes in (upper, middle, lower):
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
        plot_helpers.finish_curves(axes)
    upper.margins(y=0.12)  # room for numbers
    _number_points(upper, (middle, lower), curve, numbers, plot_helpers.INK[component])
    if "damaged_length" in points[0]:  # softening laws have damaged bonds that hold
        label = f"damaged length {plot_helpers.unit_label(case.get('output', {}).get('length_unit', ''))}".rstrip()
        _beside(lower, [sum(point["damaged_length"]) for point in points], label, style)
        lower.legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(1.12, 1.0))
    return picture


def _stress_curves(
    axes: Axes, document: Document, strain: Array, components: Sequence[int], style: Mapping[str, Any]
) -> None:
    """Draw the stress curves of a path.

    Thin lines show the first leg with its snap-back; thick lines show the response to a controlled load, on all legs.
    """
    points, first = document["path"], path_curves.first_leg(document)
    stress = np.array([point["stress"] for point in points])
    names = voigt.voigt_names(stress.shape[1])[1]
    rising = path_curves.load_controlled(points[:first]) if document["case"]["path"]["method"] == "events" else None
    along = stress.shape[1] + path_curves.leading_component(document)
    for i in components:
        name, ink = plot_helpers.SYMBOLS[names[i]], plot_helpers.INK[i]
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


def _beside(axes: Axes, values: Sequence[float], label: str, style: Mapping[str, Any]) -> None:
    """Draw values along a path against a second axis at the right."""
    right = axes.twinx()
    right.plot(values, color="0.5", linestyle="--", linewidth=1.0, **style)
    right.axhline(0.0, linestyle="none")  # extends the axis to zero
    right.set_ylabel(label, color="0.4", fontsize=8)
    right.tick_params(colors="0.4", labelsize=8)
    right.spines["top"].set_visible(False)


def _count_curves(axes: Axes, points: Sequence[Mapping[str, Any]], style: Mapping[str, Any]) -> None:
    """Draw counts of bonded, open and closed nodes."""
    for kind, key in STATES.items():
        ink = "0.2" if kind == drawn_cell.BONDED else drawn_cell.STATE_COLOURS[kind]
        label = drawn_cell.STATE_NAMES[kind]
        axes.plot([point[key] for point in points], color=ink, linewidth=1.4, label=label, **style)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_ylabel("interface nodes")
    axes.set_xlabel("number of the point, in the order of the path")


def _number_points(upper: Axes, below: Sequence[Axes], curve: Array, numbers: Sequence[int], ink: str) -> None:
    """Write point numbers along a curve (points, 2).

    The numbers have arrows in the colour `ink` to the curve, and lines in the panels below.
    """
    style: dict[str, Any] = {"color": "0.3", "fontsize": 7, "ha": "center", "va": "center"}
    pointer: dict[str, Any] = {"arrowstyle": "-", "color": "0.3", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 2}
    span, level = max(len(curve) - 1, 1), 0
    for number, rise in zip(numbers, np.diff(curve[numbers, 1], prepend=0.0), strict=True):
        offset = (-6, 16) if rise >= 0.0 else (16, -12)  # clear of the curve at peaks and at the ends of drops
        frame = style | {"textcoords": "offset points", "arrowprops": pointer, "bbox": LEGIBLE}
        upper.annotate(str(number), curve[number], offset, **frame)
    for place, number in enumerate(numbers):
        for axes in below:
            axes.axvline(number, color="0.7", linewidth=0.7, linestyle=":", zorder=0)
        level = level + 1 if place and number - numbers[place - 1] < 0.05 * span else 0
        above = (number, 1.05 + 0.1 * level)
        below[0].annotate(str(number), above, xycoords=below[0].get_xaxis_transform(), annotation_clip=False, **style)
    pointer = {"arrowstyle": "-|>", "color": ink, "linewidth": 0, "shrinkB": 0, "mutation_scale": 15}
    corners = np.vstack([np.zeros(2), curve])
    steps, extent = np.diff(corners, axis=0), np.ptp(corners, axis=0)
    length = np.linalg.norm(steps / np.where(extent > 0.0, extent, 1.0), axis=1)
    for k in np.argsort(-length, kind="stable")[:ARROWS]:
        if length[k] > 0.06:
            upper.annotate("", corners[k] + 0.52 * steps[k], corners[k], arrowprops=pointer)


def energies(document: Document) -> Figure | None:
    """Draw the energies per area as a stack over the path position.

    The position is the number of earlier legs plus the load fraction on the leg.  If the load falls along the path, the
    position is the point number, below 0 before the first point.  Returns None for results without energies.
    """
    points = document.get("path") or [{}]
    if "work" not in points[0]:
        return None
    case, legs = document["case"], path_curves.legs(document)
    names = ("work", "stored", "stored_in_springs", "dissipated", "fracture_energy", "friction_heat")
    work, stored, springs, lost, fracture, heat = (_column(points, name) for name in names)
    fracture = np.minimum(fracture, lost)
    rest = "lost in breaks" + (" beyond it" if fracture.any() else "")
    # The sum of the parts is the work, except for rounding.
    parts = {"stored in the bodies": stored - springs, "stored in springs": springs, "fracture energy": fracture}
    parts |= {rest: lost - fracture, "heat of friction": heat}
    threshold = path_curves.ZERO * np.abs(stored).max()
    parts = {name: values for name, values in parts.items() if np.abs(values).max() > threshold}
    place, words = _column(points, "load_factor", 1) * legs, "leg of the path" if legs > 1 else "share of the load"
    if (np.diff(place) < 0.0).any():
        place, legs = np.append(UNLOADED - 1.0, np.arange(float(len(points)))), 0
        words = "number of the point, in the order of the path"
    picture = Figure(figsize=(7.2, 4.2), layout="constrained")
    axes = picture.subplots()
    axes.stackplot(place, *parts.values(), labels=[*parts], colors=[AREAS[name] for name in parts])
    axes.plot(place, work, color="0.15", linewidth=1.2, label="work of the loads")
    for leg in range(1, legs):
        axes.axvline(leg, color="0.6", linewidth=0.6, linestyle=":")
    axes.set_xlim(place[0], place[-1])
    axes.set_ylim(bottom=min(0.0, float(work.min())))
    axes.set_xlabel(words)
    axes.set_ylabel(f"energy per area {plot_helpers.stress_unit(case)}")
    axes.set_title(plot_helpers.title_of(case, "energies along the path"))
    axes.spines[["top", "right"]].set_visible(False)
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], labels[::-1], frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return picture


def _column(points: Sequence[Mapping[str, Any]], name: str, power: int = 2) -> Array:
    """Return the values of an entry along the path, from the unloaded cell onwards.

    Up to the first point the response is linear, and the values grow with the load to the power `power`.
    """
    values = [float(point.get(name) or 0.0) for point in points]
    return np.append(values[0] * UNLOADED**power, values)
