"""Draw path.png and energy.png: stresses, interface states and energies along a path."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.spatial.distance import cdist

from feti_homog.materials import voigt
from feti_homog.report.plots import drawn_cell, plot_helpers
from feti_homog.results import landmarks, path_curves
from feti_homog.typing import Array, Document

MARKS = {"first_softening_": "v", "first_break_": "D", "": "*"}  # markers of landmarks
LEGIBLE = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5}  # background of numbers on curves
STATES = {drawn_cell.BONDED: "bonded", drawn_cell.OPEN: "open", drawn_cell.CLOSED: "closed"}
ROUND = (1, 2, 5, 10)  # steps of ticks
STEPS = np.linspace(0.0, 1.0, 17)  # fractions of the way from one point to the next
# Colours of the parts of the energy.
AREAS = {
    "stored in the bodies": "#9db8de",
    "stored in springs": "#5d86c4",
    "fracture energy": "#d98a54",
    "other losses in breaks": "#f0cfb3",
    "lost in breaks": "#d98a54",
    "heat of friction": "#b8455f",
}


def figure(document: Document, look: plot_helpers.Look = plot_helpers.PLAIN) -> Figure:
    """Draw stresses and interface states against the leading strain, with the landmarks.

    A panel between the two shows the change of temperature, if any.  Selected points carry their numbers.
    """
    points, case = document["path"], document["case"]
    component, components = path_curves.leading_component(document), path_curves.shown_stresses(document)
    strains, stress = (np.array([point[name] for point in points]) for name in ("strain", "stress"))
    strain = strains[:, component]
    style: dict[str, Any] = {"marker": "o", "markersize": 2.5} if len(points) <= 60 else {}
    warms = any(point.get("temperature") for point in points)
    picture = look.figure(7.2, 7.2 + 1.6 * warms)
    narrow = picture.get_figwidth() < plot_helpers.NARROW
    upper, *middle, lower = picture.subplots(2 + warms, 1, sharex=True, height_ratios=(2.2, *[1] * warms, 1))
    _stress_curves(upper, document, strain, components, style)
    upper.set_ylabel(f"stress\n{plot_helpers.stress_unit(case)}")
    lower.set_xlabel(f"macroscopic strain ${plot_helpers.SYMBOLS[voigt.voigt_names(strains.shape[1])[0][component]]}$")
    title = plot_helpers.title_of(case, f"plane {case['analysis']['plane']}")
    upper.set_title("\n".join(filter(None, (title, document.get("unfinished"), *plot_helpers.bond_limits(case)))))
    for axes in middle:
        axes.plot([0.0, *strain], [0.0, *(point["temperature"] for point in points)], color="0.3", lw=1.2, **style)
        axes.set_ylabel("change of temperature\n" r"$\Delta T$")
    _count_curves(lower, document, strain, style)
    lower.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.1, ncols=2 if narrow else 4)
    # The panels of path_states.png show the same points.
    by_state = landmarks.kept_points(document)
    numbers = [by_state[state] for state in landmarks.landmark_states(document, 6, len(by_state))]
    peak = landmarks.peak_of(document)
    unit = "" if narrow else plot_helpers.plain(case.get("output", {}).get("stress_unit", ""))
    curve, ink = np.stack([strain, stress[:, component]], axis=1), plot_helpers.STRESS_INK[peak["stress_name"]]
    star: dict[str, Any] = {"markeredgecolor": "white", "linestyle": "none", "color": ink}
    largest = landmarks.name_of(document, peak)
    largest += ", no peak yet," * (largest == landmarks.LARGEST and peak["event"] == len(points) - 1)
    for event in {peak[f"{title}event"]: None for title in MARKS if f"{title}event" in peak}:
        titles = [title for title in MARKS if peak.get(f"{title}event") == event]
        names = [title.replace("_", " ").strip() or largest for title in titles]
        bond = "" if narrow else landmarks.bond_of(peak, titles[-1]).replace(" degrees", "°")
        label = f"{' and '.join(names)} {peak[f'{titles[-1]}stress']:.4g} {unit}".rstrip() + f"\n{bond}".rstrip()
        place = peak[f"{titles[-1]}strain"], peak[f"{titles[-1]}stress"]
        upper.plot(*place, mark := MARKS[titles[-1]], ms=13 if mark == "*" else 7, zorder=6, **star, label=label)
    upper.margins(y=0.12)  # room for numbers
    for axes in (upper, *middle, lower):
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
        if axes.dataLim.ymin >= -path_curves.ZERO * axes.dataLim.ymax:
            axes.set_ylim(bottom=-0.02 * axes.dataLim.ymax or None)
    upper.xaxis.set_major_locator(MaxNLocator(5 if narrow else 7, steps=ROUND))
    plot_helpers.finish_curves(upper, *middle, lower)
    _number_points(upper, curve, numbers)
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
    along, drawn = stress.shape[1] + path_curves.leading_component(document), list[Array]()
    folds = rising is not None and bool((np.diff([point["load_factor"] for point in points[:first]]) < 0.0).any())
    for i in components:
        name, ink = plot_helpers.SYMBOLS[names[i]], plot_helpers.STRESS_INK[names[i]]
        thin: dict[str, Any] = {"label": f"${name}$", "linewidth": 1.4} if rising is None else {"linewidth": 0.8}
        line: dict[str, Any] = {"color": ink, "linewidth": 2.0, "linestyle": _line_style(stress[:, i], drawn)}
        from_zero = np.append(0.0, strain[:first]), np.append(0.0, stress[:first, i])
        axes.plot(*from_zero, color=ink, alpha=0.8, **thin, **style)
        if first < len(points):
            axes.plot(strain[first - 1 :], stress[first - 1 :, i], **line, marker="o", ms=3.5)
        if rising is not None:
            axes.plot(rising[:, along], rising[:, i], **line, label=f"${name}$")
    if folds:
        of_some = "\nof the first leg" if first < len(points) else ""
        axes.plot([], [], color="0.3", linewidth=0.8, **style, label=f"all equilibria{of_some}")
        axes.plot([], [], color="0.3", linewidth=2.0, label=f"rising {path_curves.what_rises(document)}")
    if first < len(points):
        axes.plot([], [], color="0.3", linewidth=2.0, marker="o", ms=3.5, label="later legs")


def _line_style(values: Array, drawn: list[Array]) -> str:
    """Return dashes for a curve (n,) that mostly covers a `drawn` curve, else a solid line.  Extends `drawn`."""
    tolerance = 0.01 * max(np.abs([values, *drawn]).max(), 1e-300)
    covers = any(np.mean(np.abs(values - other) <= tolerance) > 0.5 for other in drawn)
    drawn.append(values)
    return "--" if covers else "-"


def _count_curves(axes: Axes, document: Document, strain: Array, style: Mapping[str, Any]) -> None:
    """Draw counts of bonded, open and closed nodes.  Lines are thin at all equilibria, thick at a rising load."""
    points, drawn = document["path"], list[Array]()
    rising = path_curves.rising_points(points) if path_curves.is_proportional(document) else None
    for kind, key in STATES.items():
        ink, label = drawn_cell.STATE_COLOURS[kind], drawn_cell.STATE_NAMES[kind]
        count = np.array([point[key] for point in points])
        line: dict[str, Any] = {"color": ink, "linestyle": _line_style(count, drawn), "label": label}
        if rising is None:
            axes.plot(strain, count, **line, linewidth=1.4, **style)
        else:  # after a break the next branch carries the load
            axes.plot(strain, count, color=ink, linewidth=0.6, alpha=0.5)
            axes.step(strain[rising], count[rising], where="pre", **line, linewidth=1.8)
    if "damaged_share" in points[0]:  # softening laws have damaged bonds that hold
        damaged = [point["damaged_share"] * sum(point[key] for key in STATES.values()) for point in points]
        axes.plot(strain, damaged, color=drawn_cell.damage_colour(0.5), linewidth=1.2, label="damaged share × nodes")
    axes.set_ylabel("interface\nnodes")
    axes.yaxis.set_major_locator(MaxNLocator("auto", steps=ROUND, integer=True))


def _number_points(axes: Axes, curve: Array, numbers: Sequence[int]) -> None:
    """Label the points `numbers` of a curve (points, 2) where the most room is.  Crowded points get no label."""
    style: dict[str, Any] = {"color": "0.3", "fontsize": "small", "ha": "center", "va": "center", "bbox": LEGIBLE}
    pointer: dict[str, Any] = {"arrowstyle": "-", "color": "0.3", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 2}
    style |= {"textcoords": "offset points", "arrowprops": pointer}
    figure: Any = axes.figure
    figure.draw_without_rendering()  # places the axes
    scale, angles = 72.0 / figure.dpi, np.radians(np.arange(15.0, 375.0, 30.0))
    offsets = np.concatenate([r * np.column_stack([np.cos(angles), np.sin(angles)]) for r in (16.0, 27.0)])
    low, high = scale * axes.bbox.min + 6.0, scale * axes.bbox.max - 6.0
    places = scale * axes.transData.transform(curve)
    positions = np.linspace(0, len(curve) - 1, 20 * len(curve))
    line = np.column_stack([np.interp(positions, range(len(curve)), column) for column in places.T])
    texts, shape = np.full((1, 2), -1e9), np.array([0.5, 1.0])  # numbers are wider than high
    for number in numbers:
        sides = places[number] + offsets
        apart = cdist(sides * shape, texts * shape).min(axis=1) / 2.0
        room = np.minimum(np.minimum(cdist(sides, line).min(axis=1), apart), 9.0)
        best = (room - 99.0 * ((sides < low) | (sides > high)).any(axis=1)).argmax()
        if apart[best] >= 6.0:
            texts = np.append(texts, sides[[best]], axis=0)
            axes.annotate(str(number), curve[number], offsets[best].tolist(), **style)


def energies(document: Document, look: plot_helpers.Look = plot_helpers.PLAIN) -> Figure | None:
    """Draw the energies per area as a stack over the leading strain or the path position.

    The position is the number of earlier legs plus the load fraction on the leg.  On a proportional path the load only
    rises: where bonds break, the cell drops to the next branch that carries the load, and breaks lose more energy than
    along all equilibria.  Returns None for results without energies.
    """
    points = document.get("path") or [{}]
    if "work" not in points[0]:
        return None
    case, legs = document["case"], path_curves.legs(document)
    names = ("work", "stored", "stored_in_springs", "dissipated", "fracture_energy", "friction_heat")
    rising = path_curves.rising_points(points) if path_curves.is_proportional(document) else None
    if rising is None:  # the stack needs a position that rises
        points = [points[k] for k in path_curves.rising_points(points)]
    work, stored, springs, lost, fracture, heat = (_column(points, name, rising) for name in names)
    if rising is not None:
        lost = _column(points, "dissipated_strain_controlled", rising)
        work = stored + lost + heat
    fracture = np.minimum(fracture, lost)
    rest = "other losses in breaks" if fracture.any() else "lost in breaks"
    # The sum of the parts is the work, except for rounding.
    parts = {"stored in the bodies": stored - springs, "stored in springs": springs, "fracture energy": fracture}
    parts |= {rest: lost - fracture, "heat of friction": heat}
    threshold = path_curves.ZERO * np.abs(stored).max()
    parts = {name: values for name, values in parts.items() if np.abs(values).max() > threshold}
    place, words = _column(points, "load_factor", rising) * legs, "leg of the path"
    if legs == 1:
        component = path_curves.leading_component(document)
        name = voigt.voigt_names(len(points[0]["strain"]))[0][component]
        place = _column([point | {"leading": point["strain"][component]} for point in points], "leading", rising)
        words = f"macroscopic strain ${plot_helpers.SYMBOLS[name]}$"
    picture = look.figure(7.2, 4.6)
    axes = picture.subplots()
    axes.stackplot(place, *parts.values(), labels=[*parts], colors=[AREAS[name] for name in parts])
    axes.plot(place, work, color="0.15", linewidth=1.2, label="work of the loads")
    for leg in range(1, legs):
        axes.axvline(leg, color="0.6", linewidth=0.6, linestyle=":")
    axes.set_xlim(place.min(), place.max())
    axes.set_ylim(bottom=min(0.0, float(work.min())))
    axes.set_xlabel(words)
    axes.set_ylabel(f"energy per area {plot_helpers.stress_unit(case)}")
    text = "energies along the path" if rising is None else f"energies, the {path_curves.what_rises(document)} rising"
    axes.set_title("\n".join(filter(None, [plot_helpers.title_of(case, text), document.get("unfinished")])))
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=ROUND))
    plot_helpers.legend_below(picture, axes.get_legend_handles_labels()[0][::-1], 3)
    return picture


def _column(points: Sequence[Mapping[str, Any]], name: str, rising: Array | None) -> Array:
    """Return the values (n,) of an entry at n drawn positions of the path, from the unloaded cell onwards.

    Up to the first point, and between the points `rising` of a rising load, the response is proportional to the load:
    elastic energies grow with its square, and losses are constant.  On other paths stresses and strains are linear
    between points, and the elastic energies quadratic.
    """
    values = np.array([float(point.get(name) or 0.0) for point in points])
    load = np.array([point["load_factor"] for point in points])
    power = {"load_factor": 1, "leading": 1, "work": 2, "stored": 2, "stored_in_springs": 2}.get(name, 0)
    if rising is None:
        rise, steps = np.diff(values)[:, None], STEPS[1:]
        fields = [np.diff([point[field] for point in points], axis=0) for field in ("stress", "strain")]
        bend = np.zeros((len(rise), 1)) if power < 2 else 0.5 * np.prod(fields, axis=0).sum(axis=1, keepdims=True)
        if name == "stored_in_springs":
            sums = [np.array(column[:-1]) + column[1:] for column in (values, [point["stored"] for point in points])]
            bend *= (sums[0] / np.maximum(sums[1], np.finfo(float).tiny))[:, None]
        between = values[:-1, None] + rise * steps - bend * steps * (1.0 - steps)
        is_drawn = (steps == 1.0) | (np.diff(load)[:, None] > 0.01 * load[-1])  # points between distant loads
        return np.concatenate([values[0] * STEPS[:-1] ** max(power, 1), values[:1], between[is_drawn]])
    values, load = values[rising], load[rising]
    start = np.append(0.0, load[:-1] / load[1:])
    return np.asarray(values[:, None] * (start[:, None] + (1.0 - start[:, None]) * STEPS) ** power).ravel()
