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

MARKS = {"first_softening_": "v", "first_break_": "D", "": "*"}  # of landmarks
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
    """Draw stresses and interface states against the leading strain, with the landmarks.

    A panel between both shows a temperature that changes.  Selected points have their numbers.
    """
    points, case = document["path"], document["case"]
    component, components = path_curves.leading_component(document), path_curves.shown_stresses(document)
    strains, stress = (np.array([point[name] for point in points]) for name in ("strain", "stress"))
    strain = strains[:, component]
    style: dict[str, Any] = {"marker": "o", "markersize": 2.5} if len(points) <= 60 else {}
    warms = any(point.get("temperature") for point in points)
    picture = Figure(figsize=(7.2, 6.8 + 1.6 * warms), layout="constrained")
    upper, *middle, lower = picture.subplots(2 + warms, 1, sharex=True, height_ratios=(2.2, *[1] * warms, 1))
    _stress_curves(upper, document, strain, components, style)
    upper.set_ylabel(f"macroscopic stress {plot_helpers.stress_unit(case)}")
    lower.set_xlabel(f"macroscopic strain ${plot_helpers.SYMBOLS[voigt.voigt_names(strains.shape[1])[0][component]]}$")
    title = plot_helpers.title_of(case, f"plane {case['analysis']['plane']}")
    titles = title, document.get("unfinished"), *plot_helpers.bond_limits(case)
    upper.set_title("\n".join(filter(None, titles)))
    for axes in middle:
        axes.plot(strain, [point["temperature"] for point in points], color="0.3", linewidth=1.2, **style)
        axes.set_ylabel("change of temperature\n" r"$\Delta T$")
    _count_curves(lower, document, strain, style)
    # The panels of path_states.png show the same points.
    by_state = landmarks.kept_points(document)
    numbers = [by_state[state] for state in landmarks.landmark_states(document, 6, len(by_state))]
    peak, unit = landmarks.peak_of(document), case.get("output", {}).get("stress_unit", "")
    curve, ink = np.stack([strain, stress[:, component]], axis=1), plot_helpers.STRESS_INK[peak["stress_name"]]
    star: dict[str, Any] = {"markeredgecolor": "white", "zorder": 5, "linestyle": "none", "color": ink}
    for title, mark in MARKS.items():
        if f"{title}event" in peak:
            name = title.replace("_", " ").strip() or landmarks.name_of(document, peak)
            caption = f"{name} {peak[f'{title}stress']:.4g} {plot_helpers.plain(unit)}".rstrip()
            label = "\n".join(filter(None, [caption, landmarks.bond_of(peak, title).replace(" degrees", "°")]))
            place = peak[f"{title}strain"], peak[f"{title}stress"]
            upper.plot(*place, mark, markersize=11 if mark == "*" else 8, **star, label=label)
    for axes in (upper, *middle, lower):
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
        plot_helpers.finish_curves(axes)
    upper.margins(y=0.12)  # room for numbers
    text: dict[str, Any] = {"color": "0.3", "fontsize": 7, "ha": "center", "va": "center", "bbox": LEGIBLE}
    pointer: dict[str, Any] = {"arrowstyle": "-", "color": "0.3", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 2}
    for number, rise in zip(numbers, np.diff(curve[numbers, 1], prepend=0.0), strict=True):
        offset = (-6, 16) if rise >= 0.0 else (16, -12)  # clear of the curve at peaks and at the ends of drops
        upper.annotate(str(number), curve[number], offset, textcoords="offset points", arrowprops=pointer, **text)
    if "damaged_share" in points[0]:  # softening laws have damaged bonds that hold
        right = lower.twinx()
        right.plot(strain, [p["damaged_share"] for p in points], color="0.5", linestyle="--", linewidth=1.0)
        right.set_ylabel("damaged share of interfaces", color="0.4", fontsize=8)
        right.tick_params(colors="0.4", labelsize=8)
        right.spines["top"].set_visible(False)
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
        name, ink = plot_helpers.SYMBOLS[names[i]], plot_helpers.STRESS_INK[names[i]]
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


def _count_curves(axes: Axes, document: Document, strain: Array, style: Mapping[str, Any]) -> None:
    """Draw counts of bonded, open and closed nodes: thin at all equilibria, thick at a rising load."""
    points, rising = document["path"], _records(document)
    for kind, key in STATES.items():
        ink, label = drawn_cell.STATE_COLOURS[kind], drawn_cell.STATE_NAMES[kind]
        count = np.array([point[key] for point in points])
        if rising is None:
            axes.plot(strain, count, color=ink, linewidth=1.4, label=label, **style)
        else:  # after a break the next branch carries the load
            axes.plot(strain, count, color=ink, linewidth=0.6, alpha=0.5)
            axes.step(strain[rising], count[rising], where="pre", color=ink, linewidth=1.8, label=label)
    axes.set_ylabel("interface nodes")


def _records(document: Document) -> Array | None:
    """Return the numbers of the points that a rising load reaches on a proportional path, else None."""
    if not path_curves.is_proportional(document):
        return None
    load = np.array([point["load_factor"] for point in document["path"]])
    return np.flatnonzero(load >= np.maximum.accumulate(load))


def energies(document: Document) -> Figure | None:
    """Draw the energies per area as a stack over the path position.

    The position counts earlier legs and the load fraction on the leg.  On a proportional path the load rises;
    where bonds break, the cell drops to the next branch that carries the load, and breaks lose more energy.
    Returns None for results without energies.
    """
    points = document.get("path") or [{}]
    if "work" not in points[0]:
        return None
    case, legs = document["case"], path_curves.legs(document)
    names = ("work", "stored", "stored_in_springs", "dissipated", "fracture_energy", "friction_heat")
    rising, load = _records(document), np.array([point["load_factor"] for point in points])
    if rising is None:  # the stack needs a position that rises
        points = [points[k] for k in np.flatnonzero(load >= np.maximum.accumulate(load))]
    work, stored, springs, lost, fracture, heat = (_column(points, name, rising) for name in names)
    if rising is not None:
        lost = _column(points, "dissipated_strain_controlled", rising)
        work = stored + lost
    fracture = np.minimum(fracture, lost)
    rest = "lost in breaks" + (" beyond it" if fracture.any() else "")
    # The sum of the parts is the work, except for rounding.
    parts = {"stored in the bodies": stored - springs, "stored in springs": springs, "fracture energy": fracture}
    parts |= {rest: lost - fracture, "heat of friction": heat}
    threshold = path_curves.ZERO * np.abs(stored).max()
    parts = {name: values for name, values in parts.items() if np.abs(values).max() > threshold}
    place, words = _column(points, "load_factor", rising) * legs, "leg of the path" if legs > 1 else "share of the load"
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
    text = "energies along the path" if rising is None else f"energies, the {path_curves.what_rises(document)} rising"
    axes.set_title("\n".join(filter(None, [plot_helpers.title_of(case, text), document.get("unfinished")])))
    axes.spines[["top", "right"]].set_visible(False)
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], labels[::-1], frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return picture


def _column(points: Sequence[Mapping[str, Any]], name: str, rising: Array | None) -> Array:
    """Return the values of an entry along the path, from the unloaded cell onwards.

    Up to the first point, and between the points `rising` of a rising load, the response is proportional to the load:
    elastic energies grow with its square, and losses are constant.
    """
    values = np.array([float(point.get(name) or 0.0) for point in points])
    load = np.array([point["load_factor"] for point in points])
    power = {"load_factor": 1, "work": 2, "stored": 2, "stored_in_springs": 2}.get(name, 0)
    if rising is None:
        return np.append(values[0] * UNLOADED ** max(power, 1), values)
    values, load = values[rising], load[rising]
    start = np.append(0.0, load[:-1] / load[1:])
    steps = start[:, None] + (1.0 - start[:, None]) * np.linspace(0.0, 1.0, 9)
    return np.asarray(values[:, None] * steps**power).ravel()
