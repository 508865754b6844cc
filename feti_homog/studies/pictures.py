"""moduli.png of a sweep, over the fibre fraction and between bounds; fit.png, with computed and measured values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from feti_homog.case import cell_section, material_sections
from feti_homog.materials import engineering_constants, laws, phase_bounds, voigt
from feti_homog.materials import phase_bounds as mechanics
from feti_homog.report.plots import plot_helpers
from feti_homog.schema import TableReader
from feti_homog.studies.sweep_table import Series, SweepTable, series_over, varies
from feti_homog.typing import Float

FRACTION = "cell.fibre_fraction"
PANELS = ("C11", "C33", "bulk", "shear")
SPATIAL_PANELS = ("E_axial", "E_transverse", "G_axial", "G_transverse")  # of generalized plane strain
RATIOS = ("nu_axial", "nu_transverse", "expansion_axial", "expansion_transverse")
SECANTS = ("C11", "C33", "C44", "C66")  # of generalized plane strain where faces may touch: there are no constants
COMMON_PANELS = ("C11", "C66")  # of generalized plane strain and plane states together
FRACTIONS, MARGIN = 201, 1.05  # of the bounds: points, and how far they go beyond the largest fibre fraction
# Fractions begin at 0, or before the smallest one by this share of their range if it is far from 0.
BEFORE = 0.25
COLOURS = ("#1f4e9c", "#c44e00", "#2a7f3f", "#7a3e9d", "#8c6d1f", "#c2185b")
MARKERS = ("o", "s", "^", "D", "v", "P")
REALISATION_STYLE: dict[str, Any] = {"markersize": 3.5, "alpha": 0.4, "markeredgewidth": 0, "label": "realisations"}
CONFIDENCE_STYLE: dict[str, Any] = {
    "fmt": "none", "elinewidth": 1.2, "capsize": 2.5, "label": "95 % confidence of the mean",
}  # fmt: skip
MESH_ERROR_STYLE: dict[str, Any] = {
    "fmt": "none", "elinewidth": 7.0, "alpha": 0.35, "zorder": 1, "label": "estimated error of the mesh",
}  # fmt: skip
LEGEND_HANDLE, LEGEND_CHARACTER = 0.7, 0.085  # inches of an entry: its line with the space around, a letter
NAMES = {
    **{name: f"$C_{{{name[1:]}}}$" for name in ("C11", "C33", "C44", "C66")},
    **{
        name: f"{constant.symbol} {constant.way} the fibres{' (1 / temperature)' * name.startswith('expansion')}"
        for name, constant in engineering_constants.ABOUT_FIBRES.items()
    },
    "bulk": "plane bulk modulus $k$",
    "shear": "shear modulus $\\mu$",
}


def draw_moduli(directory: Path, table: SweepTable) -> list[Path]:
    """Draw moduli.png of a sweep over fibre fractions; returns its path, or nothing without moduli.  On one rank."""
    if not varies(table, FRACTION) or not panels_of(table):
        return []
    with mpl.rc_context(plot_helpers.STYLE):
        return [plot_helpers.save(moduli_figure(table), directory / "moduli.png")]


@dataclass(frozen=True)
class PanelBounds:
    """Bounds of moduli over the fibre fraction.

    Attributes:
        fractions: (n,).
        rows: by panel (2 or 4, n): Reuss, Voigt, and the two tighter bounds if they apply.
        tight: name of the tighter bounds.
    """

    fractions: Float
    rows: dict[str, Float]
    tight: str


def panels_of(table: SweepTable) -> tuple[str, ...]:
    """Return the drawn outputs; none if the cases have no moduli."""
    spatial = {voigt.plane_state_of(document).is_spatial for document in table.finished}
    in_space = (COMMON_PANELS,) if False in spatial else (SPATIAL_PANELS, SECANTS)
    choices = in_space if True in spatial else (PANELS,)
    return next((names for names in choices if all(name in table.outputs for name in names)), ())


def moduli_figure(table: SweepTable) -> Figure:
    """Moduli over the fibre fraction, between their bounds if there are any.

    In space there are also Poisson's ratios and thermal expansions.
    """
    bounds, series = moduli_bounds(table), series_over(table, FRACTION)[: len(COLOURS)]
    ratios = RATIOS if panels_of(table) == SPATIAL_PANELS else ()
    names = [*panels_of(table), *(name for name in ratios if name in table.outputs)]
    rows = -(-len(names) // len(PANELS))
    picture = Figure(figsize=(14.4, 3.6 * rows + 0.6), layout="constrained")
    panels = picture.subplots(rows, len(PANELS), sharex=True, squeeze=False).ravel()
    for axes, name in zip(panels, names, strict=False):
        if bounds is not None and name in bounds.rows:
            _draw_bounds(axes, bounds, name)
        for style, one_series in enumerate(series):
            _plot_series(axes, table, one_series, name, style)
        unit = "" if name.startswith(("nu_", "expansion_")) else plot_helpers.stress_label(table.stress_unit)
        axes.set(xlabel="fibre fraction", ylabel=f"{NAMES[name]} {unit}".rstrip())
        plot_helpers.faint_grid(axes)
        axes.tick_params(labelbottom=True)
    for axes in panels[len(names) :]:
        axes.set_axis_off()
    planes = sorted({document["case"]["analysis"]["plane"] for document in table.finished})
    without = "" if bounds else f"; no bounds, for {_why_no_bounds(table)}"
    picture.suptitle(f"{plot_helpers.plain(table.name)}: plane {' and '.join(planes)}{without}", fontsize=12)
    _add_legend(picture, list(panels)[::-1])
    return picture


def moduli_bounds(table: SweepTable) -> PanelBounds | None:
    """Return the bounds of the panels; None where none apply."""
    if _why_no_bounds(table):
        return None
    case = table.finished[0]["case"]
    plane = case["analysis"]["plane"]
    materials = material_sections.read_materials(
        case, plane, TableReader({cell_section.GEOMETRY: case["cell"]["geometry"]})
    )
    phases = [laws.stiffness_of(materials[phase], plane) for phase in ("matrix", "fibre")]
    meshed = [float(document["cell"]["fibre_fraction"]) for document in table.finished]
    smallest, largest = min(meshed), max(meshed)
    first = 0.0 if smallest <= largest / 2 else smallest - BEFORE * (largest - smallest or smallest)
    fractions = np.linspace(first, min(1.0, MARGIN * largest), FRACTIONS)
    spatial = voigt.PLANE_STATES[plane].is_spatial
    bounds_at, tight = (_spatial_bounds, "Hill, Hashin") if spatial else (_plane_bounds, "Hashin-Shtrikman")
    columns = [bounds_at([1 - share, share], phases) for share in fractions]
    rows = {name: np.array([column[name] for column in columns]).T for name in columns[0]}
    return PanelBounds(fractions, rows, tight)


def _why_no_bounds(table: SweepTable) -> str:
    """Return why bounds are not drawn, in words; empty if they are."""
    cases = [document["case"] for document in table.finished]
    if len({case["analysis"]["plane"] for case in cases}) != 1:
        return "plane states differ"
    if len({repr(case["material"]) for case in cases}) != 1:
        return "materials vary"
    if set(cases[0]["material"]) != {"matrix", "fibre"}:
        return "phases are others than matrix and fibre"
    if panels_of(table) == SECANTS:
        return "faces may touch"
    return "there are voids" if any(document["cell"].get("porosity") for document in table.finished) else ""


def _plane_bounds(shares: list[float], phases: list[Float]) -> dict[str, list[float]]:
    """Bounds by panel: Reuss, Voigt, and Hashin and Shtrikman's two for isotropic phases."""
    bounds: dict[str, list[float]] = {name: [] for name in PANELS}
    for stiffness in (mechanics.reuss(shares, phases), mechanics.voigt(shares, phases)):
        bulk, shear = engineering_constants.isotropic_part(stiffness)
        for name, value in zip(PANELS, (stiffness[0, 0], stiffness[2, 2], bulk, shear), strict=True):
            bounds[name].append(float(value))
    if all(map(mechanics.is_isotropic, phases)):
        tight = mechanics.hashin_shtrikman(shares, phases)
        bounds["bulk"] += tight.bulk
        bounds["shear"] += tight.shear
    return bounds


def _spatial_bounds(shares: list[float], phases: list[Float]) -> dict[str, list[float]]:
    """Bounds by panel: Reuss, Voigt, and two for fibres of any section if phases are alike across them."""
    ends = [
        engineering_constants.transversely_isotropic_part(bound(shares, phases))
        for bound in (mechanics.reuss, mechanics.voigt)
    ]
    bounds = {name: [float(getattr(end, name)) for end in ends] for name in SPATIAL_PANELS}
    isotropic = [engineering_constants.transversely_isotropic_part(phase) for phase in phases]
    if all(map(engineering_constants.is_transversely_isotropic, isotropic)):
        tight = phase_bounds.fibre_bounds(shares, isotropic)
        for name in ("G_axial", "G_transverse", "E_axial"):
            bounds[name] += getattr(tight, name)
    return bounds


def _draw_bounds(axes: Axes, bounds: PanelBounds, name: str) -> None:
    reuss, voigt, *tight = bounds.rows[name]
    axes.fill_between(bounds.fractions, reuss, voigt, color="0.92", linewidth=0.0, label="Reuss to Voigt")
    if tight:
        axes.fill_between(bounds.fractions, *tight, color="0.78", linewidth=0.0, label=bounds.tight)
    axes.set_xlim(bounds.fractions[0], bounds.fractions[-1])


def _plot_series(axes: Axes, table: SweepTable, series: Series, name: str, style: int) -> None:
    """Draw realisations as faint marks, means with confidence intervals, and mean mesh errors as wide pale bars."""
    colour, marker = COLOURS[style], MARKERS[style]
    statistics, values = table.statistics[name], table.outputs[name]
    numbers = [table.points.index(point) for point in series.points]
    for x, point in zip(series.x, series.points, strict=True):
        rows = table.rows(point)
        if len(rows) > 1:
            axes.plot([x] * len(rows), values[rows], marker, **REALISATION_STYLE, color=colour)
    mean, spread = statistics.mean[numbers], np.nan_to_num(statistics.ci95[numbers])
    axes.plot(series.x, mean, color=colour, marker=marker, markersize=4.5, linewidth=1.2, label=series.label or None)
    if spread.any():
        axes.errorbar(series.x, mean, spread, ecolor=colour, **CONFIDENCE_STYLE)
    if (errors := table.statistics.get(f"{name}_mesh_error")) is not None:
        axes.errorbar(series.x, mean, np.nan_to_num(errors.mean[numbers]), ecolor=colour, **MESH_ERROR_STYLE)


def _add_legend(figure: Any, panels: Sequence[Axes]) -> None:
    """Add one legend below for all panels."""
    entries: dict[str, Any] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        entries |= dict(zip(labels, handles, strict=True))
    if entries:
        widest = LEGEND_HANDLE + LEGEND_CHARACTER * max(map(len, entries))
        columns = max(1, min(len(entries), 5, int(figure.get_figwidth() / widest)))
        figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=columns, frameon=False)


Rows = list[Mapping[str, Any]]


def draw_fit(path: Path, document: Mapping[str, Any]) -> Path:
    """Draw a fit: residuals, and curves over their strain.  Raises FetiHomogError if it cannot be written."""
    single = [row for row in document["measured"] if row["strain"] is None]
    curves = [row for row in document["measured"] if row["strain"] is not None]
    parts = [(_draw_residuals, single)] * bool(single) + [(_draw_curves, curves)] * bool(curves)
    with mpl.rc_context(plot_helpers.STYLE):
        figure = Figure(figsize=(6.5 * len(parts), 4.5), layout="constrained")
        for axes, (draw, rows) in zip(figure.subplots(1, len(parts), squeeze=False)[0], parts, strict=True):
            draw(axes, rows)
        figure.suptitle(f"{plot_helpers.plain(document['name'])}: computed and measured", fontsize=12)
        return plot_helpers.save(figure, path)


def _draw_residuals(axes: Axes, rows: Rows) -> None:
    """Draw residuals in standard deviations, a row for each value."""
    place = np.arange(len(rows))
    tests = np.array([row["test"] for row in rows])
    residuals = np.array([row["residual"] for row in rows])
    axes.axvspan(-1.96, 1.96, color="0.93", zorder=0)
    axes.axvline(0.0, color="0.5", linewidth=0.8)
    for k, test in enumerate(np.unique(tests)):
        colour, marker = COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]
        axes.plot(residuals[tests == test], place[tests == test], marker, color=colour, label=f"test {test}")
    labels = [f"{row['name']} {row['value']:.4g} / {row['computed']:.4g}" for row in rows]
    axes.set_yticks(place, [plot_helpers.plain(label) for label in labels])
    axes.invert_yaxis()
    axes.set_xlabel("(computed - measured) / std")
    axes.set_title("measured / computed")
    if len(np.unique(tests)) > 1:
        axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _draw_curves(axes: Axes, rows: Rows) -> None:
    """Draw points of measured curves with their standard deviations, and the computed curves through them."""
    for k, test in enumerate(dict.fromkeys(row["test"] for row in rows)):
        points = [row for row in rows if row["test"] == test]
        x, y, std, computed = (
            np.array([row[name] for row in points]) for name in ("strain", "value", "std", "computed")
        )
        colour, marker = COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]
        axes.errorbar(x, y, std, fmt=marker, color=colour, markersize=4, label=f"test {test}, measured")
        axes.plot(x, computed, color=colour, label=f"test {test}, computed")
    axes.set(xlabel=rows[0]["strain_name"], ylabel=rows[0]["name"])
    axes.legend(frameon=False)
