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
ENERGIES = ("work", "stored", "stored_in_springs", "dissipated", "fracture_energy", "friction_heat")
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
    """Draw stresses (strains if no stress acts) and interface states over the leading strains, with the landmarks.

    A panel between the two shows the change of temperature, if any; if it varies alone, it is the axis of all panels.
    Selected points carry their numbers.  Each strain that leads a leg has a column of panels.
    """
    points, case, names = document["path"], document["case"], path_curves.abscissas(document)
    style: dict[str, Any] = {"marker": "o", "markersize": 2.5} if len(points) <= 60 else {}
    warms = names[0] != "temperature" and any(point.get("temperature") for point in points)
    heights = (2.2, 1, 1) if warms else (2.2, 1)
    picture = look.figure(7.2, 8.8 if warms else 7.2)
    narrow = picture.get_figwidth() < plot_helpers.NARROW
    grid: dict[str, Any] = {"sharex": "col", "sharey": "row", "squeeze": False, "height_ratios": heights}
    panels: Any = picture.subplots(len(heights), len(names), **grid)
    table = path_curves.table_of(points)
    way = path_curves.table_of(points[: path_curves.first_leg(document)] + path_curves.later_corners(document))
    for name, (upper, *middle, lower) in zip(names, panels.T, strict=True):
        has_stress = _main_curves(upper, document, name, style)
        for axes in middle:
            axes.plot(*(np.append(0.0, way[key]) for key in (name, "temperature")), color="0.3", lw=1.2, **style)
        _count_curves(lower, document, table[name], style)
        lower.set_xlabel(_axis_label(name))
        _mark_landmarks(upper, document, name, has_stress, narrow)
        upper.margins(y=0.12)  # room for numbers
        for axes in (upper, *middle, lower):
            axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
            if axes.dataLim.ymin >= -path_curves.ZERO * axes.dataLim.ymax:
                axes.set_ylim(bottom=-0.02 * axes.dataLim.ymax or None)
        upper.xaxis.set_major_locator(MaxNLocator(5 if narrow or len(names) > 1 else 7, steps=ROUND))
    upper, *middle, lower = panels[:, 0]
    upper.set_ylabel(f"stress\n{plot_helpers.stress_unit(case)}" if has_stress else "macroscopic strain")
    for axes in middle:
        axes.set_ylabel("change of temperature\n" r"$\Delta T$")
    lower.set_ylabel("interface\nnodes")
    if len(names) == 1:  # several columns have no room
        lower.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.1, ncols=2 if narrow else 4)
    heading = plot_helpers.title_of(case, voigt.plane_state_of(document).title), document.get("unfinished")
    write = upper.set_title if len(names) == 1 else picture.suptitle
    write("\n".join(filter(None, (*heading, *plot_helpers.bond_limits(case)))))
    plot_helpers.finish_curves(*panels.flat)
    # The panels of path_states.png show the same points.
    of_state = landmarks.kept_points(document)
    numbers = [of_state[state] for state in landmarks.landmark_states(document, 6, len(of_state))]
    height = table[landmarks.peak_of(document)["stress_name" if has_stress else "strain_name"]]
    for name, axes in zip(names, panels[0], strict=True):
        _number_points(axes, np.stack([table[name], height], axis=1), numbers)
    return picture


def _mark_landmarks(axes: Axes, document: Document, name: str, has_stress: bool, narrow: bool) -> None:
    """Mark the landmarks on the curve of their stress (or strain) over the quantity `name`, with labels."""
    table, peak = path_curves.table_of(document["path"]), landmarks.peak_of(document)
    unit = "" if narrow else plot_helpers.plain(document["case"].get("output", {}).get("stress_unit", ""))
    height = table[peak["stress_name" if has_stress else "strain_name"]]
    ink = plot_helpers.STRESS_INK[peak["stress_name"]]
    star: dict[str, Any] = {"markeredgecolor": "white", "linestyle": "none", "color": ink}
    largest = landmarks.name_of(document, peak)
    if largest == landmarks.LARGEST and peak.get("event") == len(height) - 1:
        largest += ", no peak yet,"
    for event in dict.fromkeys(peak[f"{title}event"] for title in MARKS if f"{title}event" in peak):
        titles = [title for title in MARKS if peak.get(f"{title}event") == event]
        last = titles[-1]
        stress, temperature = peak[f"{last}stress"], path_curves.temperature_of(document, event)
        label = " and ".join(title.replace("_", " ").strip() or largest for title in titles)
        if stress or temperature is None:
            label += f" {stress:.4g} {unit}".rstrip()
        if temperature is not None:
            label += rf" at $\Delta{{T}}={temperature:.4g}$"
        bond = "" if narrow else landmarks.bond_of(peak, last).replace(" degrees", "°")
        label = f"{label}\n{bond}".rstrip()
        place = table[name][event], height[event]
        axes.plot(*place, MARKS[last], ms=13 if MARKS[last] == "*" else 7, zorder=6, **star, label=label)


def _axis_label(axis: str) -> str:
    quantity = "change of temperature" if axis == "temperature" else "macroscopic strain"
    return f"{quantity} ${plot_helpers.SYMBOLS[axis]}$"


def _main_curves(axes: Axes, document: Document, axis: str, style: Mapping[str, Any]) -> bool:
    """Draw the stresses of a path, or the strains if no stress acts, over `axis`; return whether stresses act.

    Thin lines show the first leg with its snap-back; thick lines show the response to a controlled load, on all legs.
    On later legs lines end at a break if the state after the break is unknown.
    """
    points, first = document["path"], path_curves.first_leg(document)
    table, names = path_curves.table_of(points), path_curves.shown_components(document)
    later = path_curves.table_of([*points[first - 1 : first], *path_curves.later_corners(document)])
    corners = path_curves.load_controlled(points[:first])
    rising = dict(zip(table, corners.T, strict=True)) if document["case"]["path"]["method"] == "events" else None
    drawn, (strains, stresses) = list[Array](), voigt.voigt_names(len(points[0]["stress"]))
    inks = {stress: plot_helpers.STRESS_INK[stress] for stress in stresses}
    inks |= {strain: inks[stress] for strain, stress in zip(strains, stresses, strict=True)}
    folds = rising is not None and bool((np.diff([point["load_factor"] for point in points[:first]]) < 0.0).any())
    for name in names:
        symbol, ink = plot_helpers.SYMBOLS[name], inks[name]
        thin: dict[str, Any] = {"label": f"${symbol}$", "linewidth": 1.4} if rising is None else {"linewidth": 0.8}
        line: dict[str, Any] = {"color": ink, "linewidth": 2.0, "linestyle": _line_style(table[name], drawn)}
        from_zero = np.append(0.0, table[axis][:first]), np.append(0.0, table[name][:first])
        if rising is None or "friction_heat" not in points[0]:  # friction follows no snap-back
            axes.plot(*from_zero, color=ink, alpha=0.8, **thin, **style)
        if first < len(points):
            axes.plot(later[axis], later[name], **line)
            axes.plot(table[axis][first:], table[name][first:], "o", color=ink, ms=3.5)
        if rising is not None:
            axes.plot(rising[axis], rising[name], **line, label=f"${symbol}$")
    if folds:
        of_some = "\nof the first leg" if first < len(points) else ""
        axes.plot([], [], color="0.3", linewidth=0.8, **style, label=f"all equilibria{of_some}")
        axes.plot([], [], color="0.3", linewidth=2.0, label=f"rising {path_curves.what_rises(document)}")
    if first < len(points):
        axes.plot([], [], color="0.3", linewidth=2.0, marker="o", ms=3.5, label="later legs")
    return names[0] not in strains


def _line_style(values: Array, drawn: list[Array]) -> str:
    """Return dashes for a curve (n,) that mostly covers a `drawn` curve, else a solid line.  Extends `drawn`."""
    tolerance = 0.01 * max(np.abs([values, *drawn]).max(), 1e-300)
    covers = any(np.mean(np.abs(values - other) <= tolerance) > 0.5 for other in drawn)
    drawn.append(values)
    return "--" if covers else "-"


def _count_curves(axes: Axes, document: Document, strain: Array, style: Mapping[str, Any]) -> None:
    """Draw counts of bonded, open and closed nodes: thin lines at all equilibria, thick lines at a rising load."""
    points, drawn = document["path"], list[Array]()
    rising = path_curves.rising_points(points) if path_curves.is_proportional(document) else None
    # Without load any status is right: that of the point before is drawn.
    stored = np.array([point.get("stored") or 0.0 for point in points])
    loaded = np.maximum.accumulate(np.where(stored >= path_curves.ZERO**2 * stored.max(), range(len(points)), 0))
    # The bonds of an event break at the event, the bonds of an increment on the way to it.
    by_events = document["case"]["path"]["method"] == "events"
    way: dict[str, Any] = {"drawstyle": "steps-pre"} if by_events and rising is None else {}
    for kind, key in STATES.items():
        ink, label = drawn_cell.STATE_COLOURS[kind], drawn_cell.STATE_NAMES[kind]
        count = np.array([points[number][key] for number in loaded])
        line: dict[str, Any] = {"color": ink, "linestyle": _line_style(count, drawn), "label": label}
        if rising is None:
            axes.plot(strain, count, **line, linewidth=1.4, **way, **style)
        else:  # after a break the next branch carries the load
            if "friction_heat" not in points[0]:
                axes.plot(strain, count, color=ink, linewidth=0.6, alpha=0.5)
            axes.step(strain[rising], count[rising], where="pre", **line, linewidth=1.8)
    if "damaged_share" in points[0]:  # softening laws have damaged bonds that hold
        damaged = [point["damaged_share"] * sum(point[key] for key in STATES.values()) for point in points]
        label = "damaged share × nodes"
        axes.plot(strain, damaged, color=drawn_cell.damage_colour(0.5), linewidth=1.2, label=label, **way)
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
    case, legs, rises = document["case"], path_curves.legs(document), path_curves.is_proportional(document)
    # The stack needs a position that rises.
    curves = energy_curves(document, [points[k] for k in path_curves.rising_points(points)])
    work, stored, springs, lost, fracture, heat = (curves[name] for name in ENERGIES)
    fracture = np.minimum(fracture, lost)
    rest = "other losses in breaks" if fracture.any() else "lost in breaks"
    # The sum of the parts is the work, except for rounding.
    parts = {"stored in the bodies": stored - springs, "stored in springs": springs, "fracture energy": fracture}
    parts |= {rest: lost - fracture, "heat of friction": heat}
    threshold = path_curves.ZERO * np.abs(stored).max()
    parts = {name: values for name, values in parts.items() if np.abs(values).max() > threshold}
    place, place_label = curves["load_factor"] * legs, "leg of the path"
    if legs == 1:
        place, place_label = curves["axis"], _axis_label(path_curves.abscissa(document)[0])
    picture = look.figure(7.2, 4.6)
    axes = picture.subplots()
    axes.stackplot(place, *parts.values(), labels=[*parts], colors=[AREAS[name] for name in parts])
    axes.plot(place, work, color="0.15", linewidth=1.2, label="work of the loads")
    for leg in range(1, legs):
        axes.axvline(leg, color="0.6", linewidth=0.6, linestyle=":")
    axes.set_ylim(bottom=min(0.0, float(work.min())))
    axes.set(xlim=(place.min(), place.max()), xlabel=place_label)
    axes.set_ylabel(f"energy per area {plot_helpers.stress_unit(case)}")
    text = f"energies, the {path_curves.what_rises(document)} rising" if rises else "energies along the path"
    axes.set_title("\n".join(filter(None, [plot_helpers.title_of(case, text), document.get("unfinished")])))
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=ROUND))
    plot_helpers.legend_below(picture, axes.get_legend_handles_labels()[0][::-1], 3)
    return picture


def energy_curves(document: Document, points: Sequence[Mapping[str, Any]]) -> dict[str, Array]:
    """Return `ENERGIES`, load factor and axis (n,) at drawn positions along `points`, from the unloaded cell on.

    Up to each point the load moves straight, on the first leg along a ray through zero, and energies are quadratic.
    With stress S, strain E, temperature T and their changes d, the slope of the work at an end is S dE + C dT or, under
    given stresses, E dS; the conjugate C of T follows from the stored energy (S E + C T) / 2.  A break at the start of
    the way loses energy at one load; its work is 0 or, under given stresses alone, twice the loss.
    """
    path, legs, axis = document["case"]["path"], path_curves.legs(document), path_curves.abscissa(document)[0]
    table = {name: np.append(0.0, values) for name, values in path_curves.table_of(points).items()}
    strains, stresses = voigt.voigt_names(len(points[0]["stress"]))
    S, E = (np.array([table[name] for name in names]).T for names in (stresses, strains))
    T = table["temperature"]
    energy = {n: np.array([0.0, *(point.get(n) or 0.0 for point in points)]) for n in (*ENERGIES, "load_factor")}
    work, stored, springs, lost, _, heat, load = energy.values()
    if path_curves.is_proportional(document):
        lost[1:] = [point["dissipated_strain_controlled"] for point in points]
        work[:] = stored + lost + heat
    by_events, breaks = path["method"] == "events", np.array([False, *map(path_curves.breaks, points)])
    broken = breaks[:-1] if by_events else breaks[1:]
    position = load[1:] * legs
    is_ray = by_events & (position <= 1.0 + path_curves.SAME_LOAD) & (legs == 1 or not heat.any())
    start = np.where(is_ray, load[:-1] / load[1:], 0.0)
    targets = path_curves.targets(document)
    legs_by_stress = np.array([not any(map(target.get, (*strains, "temperature"))) for target in targets])
    by_stress = broken & legs_by_stress[np.ceil(position - path_curves.SAME_LOAD).clip(1).astype(int) - 1]
    begin = np.where(is_ray, work[1:] - stored[1:] * (1.0 - start**2), work[:-1] + 2.0 * by_stress * np.diff(lost))
    dE, dT, C = np.diff(E, axis=0), np.diff(T), (2.0 * stored - (S * E).sum(axis=1)) / np.where(T == 0.0, np.inf, T)
    slope = np.where(by_stress[:, None], np.diff(S, axis=0) * E[1:], S[1:] * dE).sum(axis=1) + C[1:] * dT
    bend = slope - work[1:] + begin
    is_early = ~broken & (np.abs(T[1:]) < np.abs(T[:-1]))
    bend = np.where(is_early, work[1:] - begin - (S[:-1] * dE).sum(axis=1) - C[:-1] * dT, bend)
    bend = np.where(is_ray, stored[1:] * (1.0 - start) ** 2, np.where(broken & (not by_events), 0.0, bend))

    def straight(values: Array, first: Array) -> Array:
        return np.asarray(first[:, None] + (values[1:] - first)[:, None] * STEPS)

    curves = {"work": straight(work, begin) - bend[:, None] * STEPS * (1.0 - STEPS)}
    for name in ("dissipated", "fracture_energy", "friction_heat"):
        is_step = is_ray if name == "friction_heat" else by_events
        curves[name] = straight(energy[name], np.where(is_step, energy[name][1:], energy[name][:-1]))
    curves["stored"] = curves["work"] - curves["dissipated"] - curves["friction_heat"]
    behind, tiny = curves["stored"][:, 0], np.finfo(float).tiny
    in_springs = np.where(is_ray, springs[1:] * start**2, springs[:-1] * behind / np.maximum(stored[:-1], tiny))
    share = (in_springs + springs[1:]) / np.maximum(behind + stored[1:], tiny)
    bent = curves["stored"] - straight(stored, behind)
    curves["stored_in_springs"] = straight(springs, in_springs) + share[:, None] * bent
    for name in ENERGIES:  # the unloaded cell has no energies
        curves[name][0] = energy[name][1] * STEPS**2
    curves["load_factor"] = straight(load, load[:-1])
    curves["axis"] = straight(table[axis], np.where(is_ray, start * table[axis][1:], table[axis][:-1]))
    is_drawn = np.isin(STEPS, (0.0, 1.0)) | (np.diff(load)[:, None] > 0.01 * load[-1])  # between distant loads
    return {name: values[is_drawn] for name, values in curves.items()}
