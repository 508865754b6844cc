"""The onset of debonding as a curve in the plane of two macroscopic stresses or strains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from feti_homog.report.plots.plot_helpers import bond_limits, plain
from feti_homog.typing import Array

# Loads beyond so many times the median are outside of the picture: those of directions that hardly open a bond.
FARTHEST, SHOWN = 6.0, 3.0
MARGIN = 1.12
MARKED = 180  # directions up to which each has a mark

Document = Mapping[str, Any]


def figure(document: Document) -> Figure:
    """Return the curve, with equal axes, in the colours of the mode in which the first bond breaks."""
    case, points = document["case"], document["envelope"]
    plane, known = case["envelope"]["plane"], [point for point in points if "factor" in point]
    picture = Figure(figsize=(6.6, 5.6), layout="constrained")
    axes = picture.subplots()
    axes.axhline(0.0, color="0.45", linewidth=0.8, zorder=1)
    axes.axvline(0.0, color="0.45", linewidth=0.8, zorder=1)
    places, notes = loads(points), _notes(case, len(points) - len(known))
    if known:
        drawn = _curve(axes, places, modes(points))
        bar = picture.colorbar(drawn, ax=axes, location="bottom", shrink=0.6, aspect=30)
        bar.set_ticks([0, 30, 60, 90], labels=["0, opens", "30", "60", "90, shears"])
        bar.set_label("mode of the first break (degrees)")
        notes += _limit(axes, places[~np.isnan(places[:, 0])])
    unit = case.get("output", {}).get("stress_unit", "")
    axes.set_xlabel(axis_label(plane[0], unit))
    axes.set_ylabel(axis_label(plane[1], unit))
    axes.set_aspect("equal", adjustable="box")
    axes.xaxis.set_major_locator(MaxNLocator(5))  # labels of small stresses are long
    title = f"{plain(case.get('name', ''))}: onset of debonding, plane {case['analysis']['plane']}".lstrip(": ")
    axes.set_title("\n".join([title, *bond_limits(case), *([", ".join(notes)] if notes else [])]))
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)
    return picture


def loads(points: Sequence[Document]) -> Array:
    """(n, 2) the two components at onset, NaN where there is none."""
    angle = np.radians([point["angle"] for point in points])
    factor = np.array([point.get("factor", np.nan) for point in points])
    return np.asarray(factor[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def modes(points: Sequence[Document]) -> Array:
    """(n,) degrees, 0 opens and 90 shears: psi, or of strengths by the shares that are used; NaN without an onset."""
    if any("psi" in point for point in points):
        return np.array([point.get("psi", np.nan) for point in points])
    normal, tangential, axial = (
        np.array([point.get(name, 0.0 if name == "axial" else np.nan) for point in points])
        for name in ("normal", "tangential", "axial")
    )
    return np.asarray(np.degrees(np.arctan2(np.hypot(tangential, axial), normal)))


def axis_label(name: str, stress_unit: str) -> str:
    """Return the symbol of a macroscopic stress or strain, with its unit."""
    digits = name[-2:]
    if name.startswith("S"):
        return f"$\\Sigma_{{{digits}}}$ " + (f"({plain(stress_unit)})" if stress_unit else "(unit of the moduli)")
    return f"${'E' if name.startswith('E') else chr(92) + 'gamma'}_{{{digits}}}$"


def _curve(axes: Axes, places: Array, mode: Array) -> LineCollection:
    """Return the closed curve through the loads (n, 2), open where there is no onset."""
    ends = np.roll(places, -1, axis=0)
    whole = ~np.isnan(places[:, 0]) & ~np.isnan(ends[:, 0])
    if whole.all():
        axes.fill(places[:, 0], places[:, 1], color="0.96", zorder=0)
    lines = LineCollection(list(np.stack([places, ends], axis=1)[whole]), linewidths=2.2, cmap="viridis")
    lines.set_array((mode + np.roll(mode, -1))[whole] / 2)
    lines.set_clim(0.0, 90.0)
    axes.add_collection(lines)
    if len(places) <= MARKED:
        axes.scatter(places[:, 0], places[:, 1], c=mode, cmap="viridis", vmin=0.0, vmax=90.0, s=14, zorder=3)
    return lines


def _limit(axes: Axes, places: Array) -> list[str]:
    """Let the axes hold all loads (n, 2), or those that are not far away from the others, and zero.

    What is not shown, in words.
    """
    size = np.linalg.norm(places, axis=1)
    usual = float(np.median(size))
    far = size > FARTHEST * usual
    beyond = places[far] / np.where(size > 0.0, size, 1.0)[far, None] * SHOWN * usual
    shown = np.concatenate([places[~far], beyond, np.zeros((1, 2))])
    low, high = shown.min(axis=0), shown.max(axis=0)
    middle, half = (low + high) / 2, MARGIN * (high - low) / 2
    half = np.maximum(half, 0.05 * half.max() or 1.0)
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
    return [f"loads up to {size.max():.4g} are outside"] if far.any() else []


def _notes(case: Document, without: int) -> list[str]:
    """Temperature and how many directions have no onset."""
    temperature, notes = case["envelope"].get("temperature"), list[str]()
    if temperature is not None:
        notes.append(f"$\\Delta T = {{{temperature:g}}}$ first")
    return [*notes, f"no onset in {without} directions"] if without else notes
