"""Draw pictures of studies: moduli.png or peaks.png for a sweep over the fibre fraction, fit.png for a fit."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from feti_homog.materials import engineering_constants, voigt
from feti_homog.report.plots import plot_helpers
from feti_homog.report.text import tables
from feti_homog.results import landmarks, path_curves
from feti_homog.studies.sweep_table import Series, SweepTable, series_over, varies
from feti_homog.typing import Document

FRACTION = "cell.fibre_fraction"
PANELS = ("C11", "C33", "bulk", "shear")
SPATIAL_PANELS = ("E_axial", "E_transverse", "G_axial", "G_transverse")  # of generalized plane strain
RATIOS = ("nu_axial", "nu_transverse", "expansion_axial", "expansion_transverse")
SECANTS = ("C11", "C33", "C44", "C66")  # of generalized plane strain where faces may touch: there are no constants
CONDUCTION = ("k11", "k22", "k33")
COMMON_PANELS = ("C11", "C66")  # of generalized plane strain and plane states together
BOUNDS = dict.fromkeys(PANELS[:2], "Reuss and Voigt") | dict.fromkeys((*PANELS[2:], *CONDUCTION), "Hashin-Shtrikman")
MARKERS = ("o", "s", "^", "D", "v", "P")
NAMES = {
    **{name: f"${name[0]}_{{{name[1:]}}}$" for name in ("C11", "C33", "C44", "C66", *CONDUCTION)},
    **{
        name: f"{constant.symbol} {constant.way} the fibres{' (1 / temperature)' if name in RATIOS[2:] else ''}"
        for name, constant in engineering_constants.ABOUT_FIBRES.items()
    },
    "bulk": "plane bulk modulus $k$",
    "shear": "shear modulus $\\mu$",
}


def draw_over_fractions(directory: Path, table: SweepTable) -> list[Path]:
    """Draw moduli, or stresses at onset and peak, of a sweep over the fibre fraction to its folder.  On one rank.

    Returns [path of moduli.png or peaks.png]; [] if the fraction does not vary or no output can be drawn.
    """
    names = panels_of(table) if varies(table, FRACTION) else ()
    if not names:
        return []
    with mpl.rc_context(plot_helpers.STYLE):
        path = directory / ("peaks.png" if names[0] not in NAMES else "moduli.png")
        return [plot_helpers.save(figure_over_fractions(table), path)]


def panels_of(table: SweepTable) -> tuple[str, ...]:
    """Choose the outputs to draw: moduli, or stresses at onset and, if all paths have one, at the peak; () if none."""
    spatial = {voigt.plane_state_of(document).is_spatial for document in table.finished}
    in_space = (COMMON_PANELS,) if False in spatial else (SPATIAL_PANELS, SECANTS, CONDUCTION)
    choices = in_space if True in spatial else (PANELS,)
    leading = {landmarks.peak_of(result)["stress_name"] for result in table.finished if "path" in result}
    peaks = [f"peak_{name}" for name in sorted(leading) if f"peak_{name}" in table.stated]
    onsets = [name.replace("peak", "onset") for name in peaks]
    choices = (*choices, tuple(onsets if table.rising else onsets + peaks))
    return next((names for names in choices if all(name in table.outputs for name in names)), ())


def figure_over_fractions(table: SweepTable) -> Figure:
    """Draw a panel for each output over the fibre fraction, with the first `len(MARKERS)` series and known bounds.

    Generalized plane strain has further panels for Poisson's ratios and thermal expansions.
    """
    series = series_over(table, FRACTION)[: len(MARKERS)]
    ratios = RATIOS if panels_of(table) == SPATIAL_PANELS else ()
    names = [*panels_of(table), *(name for name in ratios if name in table.outputs)]
    rows = (len(names) + 1) // 2
    picture = Figure(figsize=(7.2, 2.6 * rows + 0.8), layout="constrained")
    panels = picture.subplots(rows, 2, sharex=True, squeeze=False).ravel()
    for axes, name in zip(panels, names, strict=False):
        for number, one_series in enumerate(series):
            _plot_series(axes, table, one_series, name, number)
        unit = "" if name.startswith(("nu_", "expansion_", "k")) else plot_helpers.stress_label(table.stress_unit)
        shear = r" ($\gamma_{12}$)" if name == "C33" and names == [*PANELS] else ""
        title = NAMES.get(name, name.replace("_S", " $S_{") + "}$")
        axes.set(xlabel="fibre fraction", ylabel=f"{title}{shear}\n{unit}".rstrip())
        # Values with their errors, and bounds, which widen the range by at most half at each end.
        shapes = [path for shape in axes.collections for path in shape.get_paths()]
        values: list[Any] = [np.asarray(path.vertices)[:, 1] for path in shapes]
        bounds = [line.get_ydata() for line in axes.lines if "bounds" in str(line.get_label())]
        values += [line.get_ydata() for line in axes.lines if "bounds" not in str(line.get_label())]
        low, high = np.nanmin(np.concatenate(values)), np.nanmax(np.concatenate(values))
        ends = np.clip(np.concatenate([[low, high], *bounds]), 1.5 * low - 0.5 * high, 1.5 * high - 0.5 * low)
        low, high = np.nanmin(ends), np.nanmax(ends)
        margin = 0.06 * (high - low) or 0.06 * abs(high) or 1.0
        axes.set_ylim(low - margin, high + margin)
        plot_helpers.faint_grid(axes)
        axes.tick_params(labelbottom=True)
    for axes in panels[len(names) :]:
        axes.set_axis_off()
    picture.align_ylabels()
    planes = sorted({voigt.plane_state_of(document).title for document in table.finished})
    picture.suptitle(f"{plot_helpers.plain(table.name)}: {' and '.join(planes)}")
    handles = [handle for axes in panels[::-1] for handle in axes.get_legend_handles_labels()[0]]
    plot_helpers.legend_below(picture, [*{handle.get_label(): handle for handle in handles}.values()])
    return picture


def bounds_of(document: Document) -> dict[str, tuple[float, float]]:
    """Return bounds by output name: Reuss and Voigt's of C11 and C33, Hashin and Shtrikman's or Hill's of others."""
    bounds = document.get("bounds") or {}
    forms, ends = document.get("conductivity_estimates") or {}, ([bounds["reuss"], bounds["voigt"]] if bounds else [])
    pairs: dict[str, Any] = {f"C{k + 1}{k + 1}": tuple(end[k][k] for end in ends) for k in (0, 2) if ends}
    pairs |= dict.fromkeys(("k11", "k22"), forms.get("hashin_shtrikman"))
    pairs |= (bounds.get("hashin_shtrikman") or {}) | (document.get("fibre_bounds") or {})
    return {name: pair for name, pair in pairs.items() if pair is not None}


def _plot_series(axes: Axes, table: SweepTable, series: Series, name: str, number: int) -> None:
    """Draw output `name` of a series, in the colour and marker `number`.

    Faint marks are realisations, a line the means with their confidence intervals, wide pale bars the mean mesh errors,
    and dashes or dots the bounds.
    """
    colour, marker = plot_helpers.INK[number], MARKERS[number]
    statistics, values = table.statistics[name], table.outputs[name]
    numbers = [table.points.index(point) for point in series.points]
    for x, point in zip(series.x, series.points, strict=True):
        rows = table.rows(point)
        if len(rows) > 1:
            faint: dict[str, Any] = {"ms": 3.5, "alpha": 0.4, "mew": 0, "label": "realisations"}
            axes.plot([x] * len(rows), values[rows], marker, color=colour, **faint)
    limits = [[bounds_of(result).get(name, (np.nan, np.nan)) for result in table.results_of(p)] for p in series.points]
    ends = np.array([np.mean(pairs, axis=0) for pairs in limits])
    if np.isfinite(ends).any():
        label, style = f"{BOUNDS.get(name, 'Hill and Hashin')} bounds", ":" if name in PANELS[:2] else "--"
        axes.plot(series.x, ends, style, color=colour, linewidth=0.9, label=label)
    mean, spread = statistics.mean[numbers], np.nan_to_num(statistics.ci95[numbers])
    words = series.label or ("mean" if spread.any() else None)
    axes.plot(series.x, mean, color=colour, marker=marker, markersize=3.5, linewidth=1.2, label=words)
    if spread.any():
        label = "95 % confidence of the mean"
        axes.errorbar(series.x, mean, spread, fmt="none", ecolor=colour, elinewidth=1.2, capsize=2.5, label=label)
    errors = table.statistics.get(f"{name}_mesh_error")
    bars = np.zeros(len(mean)) if errors is None else np.nan_to_num(errors.mean[numbers])
    # Errors that no reader could see have no entry in the legend.
    if bars.max(initial=0.0) > 0.005 * np.ptp(np.nan_to_num(mean)):
        wide: dict[str, Any] = {"elinewidth": 9.0, "alpha": 0.35, "zorder": 1, "label": "estimated error of the mesh"}
        axes.errorbar(series.x, mean, bars, fmt="none", ecolor=colour, **wide)


def draw_fit(path: Path, document: Mapping[str, Any], results: Sequence[Document] = ()) -> Path:
    """Draw residuals and curves of a fit to `path`; return `path`.  Raises FetiHomogError if it cannot be written."""
    with mpl.rc_context(plot_helpers.STYLE):
        return plot_helpers.save(fit_figure(document, results), path)


def fit_figure(document: Mapping[str, Any], results: Sequence[Document] = ()) -> Figure:
    """Draw the residuals and curves of a fit with the content `document` of fit.json.

    One panel has a row for each single value, with its residual in standard deviations; the other has measured points,
    and computed curves from the `results` of the tests or, without a curve, the computed values at the points.
    """
    single = [row for row in document["measured"] if row["strain"] is None]
    points = [row for row in document["measured"] if row["strain"] is not None]
    count, unit = (2 if single and points else 1), (plot_helpers.stress_unit(results[0]["case"]) if results else "")
    figure = Figure(figsize=(6.5 * count, 4.5), layout="constrained")
    panels = figure.subplots(1, count, squeeze=False)[0]
    if single:
        axes, place = panels[0], np.arange(len(single))
        tests, residuals = (np.array([row[name] for row in single]) for name in ("test", "residual"))
        axes.axvspan(-1.96, 1.96, color="0.93", zorder=0)
        axes.axvline(0.0, color="0.5", linewidth=0.8)
        for test, colour, marker in zip(np.unique(tests), cycle(plot_helpers.INK), cycle(MARKERS), strict=False):
            axes.plot(residuals[tests == test], place[tests == test], marker, color=colour, label=f"test {test}")
        labels = [f"{row['name']} {row['value']:.4g} / {row['computed']:.4g}" for row in single]
        axes.set_yticks(place, [plot_helpers.plain(label) for label in labels])
        axes.invert_yaxis()
        axes.set(xlabel="(computed - measured) / std")
        axes.text(-0.02, 1.02, f"measured / computed {unit}".rstrip(), ha="right", transform=axes.transAxes)
        axes.text(0.0, 1.02, "grey: 95 %", ha="center", transform=axes.get_xaxis_transform())
        if len(np.unique(tests)) > 1 and not points:
            plot_helpers.legend_below(figure, axes.get_legend_handles_labels()[0])
    if points:
        numbers = dict.fromkeys(row["test"] for row in points)
        for test, colour, marker in zip(numbers, cycle(plot_helpers.INK), cycle(MARKERS), strict=False):
            rows = [row for row in points if row["test"] == test]
            names = ("strain", "value", "std", "computed")
            x, y, std, computed = (np.array([row[name] for row in rows]) for name in names)
            panels[-1].errorbar(x, y, std, fmt=marker, color=colour, markersize=4, label=f"test {test}, measured")
            curve = path_curves.rising_strain(results[test - 1]) if results else None
            if curve is not None:
                stresses = voigt.voigt_names(curve.shape[1] - 1)[1]
                x, computed = np.sign(x[-1]) * curve[:, -1], curve[:, stresses.index(rows[0]["name"])]
            panels[-1].plot(x, computed, color=colour, linewidth=1.2, label=f"test {test}, computed")
        symbols = [f"${plot_helpers.SYMBOLS[points[0][name]]}$" for name in ("strain_name", "name")]
        panels[-1].set(xlabel=f"macroscopic strain {symbols[0]}", ylabel=f"stress {symbols[1]} {unit}".rstrip())
        panels[-1].locator_params(axis="x", nbins=6)
        plot_helpers.finish_curves(panels[-1])
    stress = results[0]["case"].get("output", {}).get("stress_unit", "") if results else ""
    title = f"{document['name']}: computed and measured{', not converged' if document.get('faults') else ''}"
    for name, number in document.get("unknowns", {}).items():
        deviation = f" ± {number['std']:.2g} (std)" if number["std"] and not document.get("faults") else ""
        title += f"\n{tables.with_unit(name, stress)} = {number['estimate']:.5g}{deviation}"
    figure.suptitle(plot_helpers.plain(title))
    return figure
