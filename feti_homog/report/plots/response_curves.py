"""Draw numbers of result.json: angle.png, envelope.png, sensitivities.png; `path_picture` draws paths."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, MultipleLocator

from feti_homog.case import interface_section
from feti_homog.materials import voigt
from feti_homog.report.plots import path_picture, plot_helpers
from feti_homog.report.text import constant_tables
from feti_homog.report.text.point_tables import shown_entries
from feti_homog.report.text.summary import reported
from feti_homog.typing import Array, Document

Curve = Callable[[Document, plot_helpers.Look], Figure | None]
MARKS = ("o", "s", "^", "D", "v", "P", "X")
CELL = (0.95, 0.42)  # width and height of an entry, inches
FAINTEST = 0.005  # smaller entries have no number


def drawn(document: Document) -> Mapping[str, Curve]:
    """Return the functions that draw pictures from result.json only, by picture name."""
    curves = {"sensitivities": sensitivities, "energy": path_picture.energies}
    return curves | {name: curve for name, curve in CURVES.items() if name == reported(document).name}


def angle(document: Document, look: plot_helpers.Look = plot_helpers.PLAIN) -> Figure:
    """Draw stiffnesses or stresses against the debonding angle."""
    points, case = document["angle"], document["case"]
    stiff = "stiffness" in points[0]
    figure = look.figure(6.4, 4.6)
    axes = figure.subplots()
    angles = [point["angle"] for point in points]
    responses = np.array([point["stiffness" if stiff else "stress"] for point in points])
    if stiff:
        curves = {f"C_{{{i + 1}{j + 1}}}": responses[:, i, j] for i, j in shown_entries(points).values()}
        inks = [plot_helpers.ENTRY_INK[name] for name in shown_entries(points)]
    else:
        curves = dict(zip((plot_helpers.SYMBOLS[name] for name in voigt.STRESSES), responses.T, strict=True))
        inks = [plot_helpers.STRESS_INK[name] for name in voigt.STRESSES]
    is_relative = "C_{66}" in curves  # in space the stiffness along the fibres would flatten all others
    unit = plot_helpers.stress_unit(case)
    for (name, column), ink, mark in zip(curves.items(), inks, MARKS, strict=False):
        first = column[0] if is_relative else 1.0
        label = r"$C_{33}$ ($\gamma_{12}$)" if name == "C_{33}" and not is_relative else f"${name}$"
        label += f", {first:.4g} {unit.strip('()')}".rstrip() if is_relative else ""
        axes.plot(angles, column / first, color=ink, marker=mark, markersize=4, linewidth=1.5, label=label)
    axes.set_xlabel("debonding angle (degrees)")
    quantity = f"{'effective stiffness' if stiff else 'macroscopic stress'} {unit}"
    axes.set_ylabel(f"stiffness / stiffness at {angles[0]:g} degrees" if is_relative else quantity)
    axes.xaxis.set_major_locator(MultipleLocator(60 if angles[-1] > 180 else 30))
    contact = "contact" if all(bond["contact"] for bond in interface_section.interface_tables(case)) else "no contact"
    load = "" if stiff else f", $E=[{','.join(f'{e:g}' for e in points[0]['strain'])}]$"
    axes.set_title(plot_helpers.title_of(case, f"{voigt.plane_state_of(document).title}, {contact}{load}"))
    axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    plot_helpers.finish_curves(axes)
    if stiff:
        axes.set_ylim(bottom=0.0)
    return figure


def envelope(document: Document, look: plot_helpers.Look = plot_helpers.PLAIN) -> Figure:
    """Draw the onset curve with equal axes, coloured by the mode of the first break."""
    case, points = document["case"], document["envelope"]
    plane, broken = case["envelope"]["plane"], [point for point in points if "factor" in point]
    picture = look.figure(6.6, 5.6)
    axes = picture.subplots()
    axes.axhline(0.0, color="0.45", linewidth=0.8, zorder=1)
    axes.axvline(0.0, color="0.45", linewidth=0.8, zorder=1)
    places, temperature = loads(points), case["envelope"].get("temperature")
    notes = [] if temperature is None else [f"$\\Delta{{T}}={{{temperature:g}}}$ first"]
    if points[0].get("factor") == 0.0:
        notes.append("which breaks bonds alone")
    if len(broken) < len(points):
        notes.append(f"directions without onset: {len(points) - len(broken)}")
    if broken:
        # The closed curve through the loads, open where directions have no onset.
        ends, mode = np.roll(places, -1, axis=0), modes(points)
        joined = ~np.isnan(places[:, 0]) & ~np.isnan(ends[:, 0])
        if joined.all():
            axes.fill(places[:, 0], places[:, 1], color="0.96", zorder=0)
        lines = LineCollection(list(np.stack([places, ends], axis=1)[joined]), linewidths=2.2, cmap="viridis")
        lines.set_array((mode + np.roll(mode, -1))[joined] / 2)
        lines.set_clim(0.0, 90.0)
        axes.add_collection(lines)
        if len(places) <= 180:
            axes.scatter(places[:, 0], places[:, 1], c=mode, cmap="viridis", vmin=0.0, vmax=90.0, s=14, zorder=3)
        bar = picture.colorbar(lines, ax=axes, location="bottom", shrink=0.6, aspect=30)
        bar.set_ticks([0, 30, 60, 90], labels=["0, opens", "30", "60", "90, shears"])
        bar.set_label("mode of the first break (degrees)")
        notes += _limit(axes, places[~np.isnan(places[:, 0])])
    unit = f" {plot_helpers.stress_unit(case)}" if plane[0].startswith("S") else ""
    axes.set(xlabel=f"${plot_helpers.SYMBOLS[plane[0]]}${unit}", ylabel=f"${plot_helpers.SYMBOLS[plane[1]]}${unit}")
    axes.set_aspect("equal", adjustable="box")
    axes.xaxis.set_major_locator(MaxNLocator(5))  # labels of small stresses are long
    title = plot_helpers.title_of(case, f"onset of debonding or softening, {voigt.plane_state_of(document).title}")
    axes.set_title("\n".join(filter(None, [title, *plot_helpers.bond_limits(case), ", ".join(notes)])))
    plot_helpers.faint_grid(axes)
    return picture


def loads(points: Sequence[Document]) -> Array:
    """Return both load components (n, 2) at onset; NaN in directions without onset."""
    angle = np.radians([point["angle"] for point in points])
    factor = np.array([point.get("factor", np.nan) for point in points])
    return np.asarray(factor[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def modes(points: Sequence[Document]) -> Array:
    """Return the modes psi (n,) of breaks in degrees: 0 opens, 90 shears.  They are NaN without onset."""
    if any("psi" in point for point in points):
        return np.array([point.get("psi", np.nan) for point in points])
    normal, tangential = (np.array([point.get(name, np.nan) for point in points]) for name in ("normal", "tangential"))
    axial = np.array([point.get("axial", 0.0) for point in points])
    return np.asarray(np.degrees(np.arctan2(np.hypot(tangential, axial), normal)))


def _limit(axes: Axes, places: Array) -> list[str]:
    """Set axis limits around zero and the loads (n, 2) of usual size.  Returns notes on loads outside, or []."""
    size = np.linalg.norm(places, axis=1)
    usual = float(np.median(size))
    far = size > 6.0 * usual  # directions that hardly open a bond
    beyond = places[far] / np.where(size > 0.0, size, 1.0)[far, None] * 3.0 * usual
    visible = np.concatenate([places[~far], beyond, np.zeros((1, 2))])
    low, high = visible.min(axis=0), visible.max(axis=0)
    middle, half = (low + high) / 2, 1.12 * (high - low) / 2
    half = np.maximum(half, 0.05 * half.max() or 1.0)
    axes.set(xlim=(middle[0] - half[0], middle[0] + half[0]), ylim=(middle[1] - half[1], middle[1] + half[1]))
    return [f"loads up to {size.max():.4g} are outside"] if far.any() else []


def sensitivities(document: Document, look: plot_helpers.Look = plot_helpers.PLAIN) -> Figure | None:
    """Draw elasticities d ln c / d ln p of constants c (columns) by parameters p (rows).  Returns None without rows."""
    tables = constant_tables.sensitivities(document)
    if not tables or not tables[0].rows:
        return None
    names = [plot_helpers.plain(str(row[0])) for row in tables[0].rows]
    values = np.array([[np.nan if isinstance(entry, str) else entry for entry in row[1:]] for row in tables[0].rows])
    width, height = CELL
    names_width = 0.4 + 0.085 * max(map(len, names))
    picture = look.figure(names_width + width * values.shape[1] + 1.2, 1.4 + height * len(names))
    axes = picture.subplots()
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    highest = min(max(largest, FAINTEST), 1.0)  # constants near zero have large elasticities
    image = axes.imshow(values, cmap="RdBu_r", norm=Normalize(-highest, highest), aspect="auto")
    narrow = picture.get_figwidth() < plot_helpers.NARROW
    for (row, column), value in np.ndenumerate(values) if not narrow else ():
        number = f"{value:.2f}" if abs(value) >= FAINTEST else ""
        text, ink = "-" if np.isnan(value) else number, "white" if abs(value) > 0.6 * highest else "black"
        axes.text(column, row, text, ha="center", va="center", color=ink)
    heads = [column.name if narrow else column.name.replace("_", "_\n") for column in tables[0].columns[1:]]
    axes.set_xticks(range(values.shape[1]), heads, rotation=90 if narrow else 0)
    axes.set_yticks(range(len(names)), names)
    axes.tick_params(length=0, labeltop=True, labelbottom=False)
    axes.spines[:].set_visible(False)
    label, extend = "" if narrow else "relative change / relative change", "both" if largest > highest else "neither"
    picture.colorbar(image, ax=axes, label=label, extend=extend)
    title = "change of a constant (%) by a change of a parameter by 1 %"
    picture.suptitle(plot_helpers.title_of(document["case"], title))
    return picture


CURVES: dict[str, Curve] = {"angle": angle, "path": path_picture.figure, "envelope": envelope}
