"""Moduli over the fibre fraction, between their bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from feti_homog.config.cell_section import GEOMETRY
from feti_homog.config.material_forms import Material
from feti_homog.config.material_sections import read_materials
from feti_homog.config.materials import plane_stiffness, spatial_stiffness
from feti_homog.config.schema import TableReader
from feti_homog.mechanics import bounds as mechanics
from feti_homog.mechanics.voigt import SPATIAL_STRESSES
from feti_homog.output.plots.plot_helpers import plain
from feti_homog.sweep.report.series import Series, series_over
from feti_homog.sweep.report.style import COLOURS, label_axes, legend, plot_series
from feti_homog.sweep.report.sweep_table import SweepTable
from feti_homog.typing import Float

FRACTION = "cell.fibre_fraction"
PANELS = ("C11", "C33", "bulk", "shear")
SPATIAL_PANELS = ("C11", "C33", "C44", "C66")  # of generalized plane strain
COMMON_PANELS = ("C11", "C66")  # of that and of plane states
FRACTIONS, MARGIN = 201, 1.05  # of the bounds: points, and how far they go beyond the largest fibre fraction
X_FACTOR = 0.98


@dataclass(frozen=True)
class PanelBounds:
    """Fibre fractions (n,) and the bounds of each panel over them: rows Reuss, Voigt, and the two of
    Hashin and Shtrikman if they apply, (2 or 4, n)."""

    fractions: Float
    rows: dict[str, Float]


def panels_of(table: SweepTable) -> tuple[str, ...]:
    """The outputs that are drawn; none if the cases have no moduli."""
    planes = {document["case"]["analysis"]["plane"] for document in table.finished}
    names = SPATIAL_PANELS if planes == {"generalized"} else COMMON_PANELS if "generalized" in planes else PANELS
    return names if all(name in table.outputs for name in names) else ()


def figure(table: SweepTable) -> Figure:
    """Moduli above; below, where there are bounds, how far they are above that of Reuss, which tells them apart."""
    bounds, series = _bounds(table), series_over(table, FRACTION)[: len(COLOURS)]
    names = panels_of(table)
    picture = Figure(figsize=(14.4, 6.6 if bounds else 3.8), layout="constrained")
    panels = picture.subplots(2 if bounds else 1, len(names), sharex=True, squeeze=False)
    for k, name in enumerate(names):
        if bounds is not None:
            _draw_bounds(panels[0, k], bounds.fractions, bounds.rows[name])
        for style, each in enumerate(series):
            plot_series(panels[0, k], table, each, name, style)
        label_axes(panels[0, k], name, table, "" if bounds else "fibre fraction")
        if bounds is not None:
            _draw_above_reuss(panels[1, k], table, series, bounds, name)
    planes = sorted({document["case"]["analysis"]["plane"] for document in table.finished})
    picture.suptitle(f"{plain(table.name)}: plane {' and '.join(planes)}", fontsize=12)
    legend(picture, list(panels.flat)[::-1])
    return picture


def _draw_above_reuss(axes: Axes, table: SweepTable, series: list[Series], bounds: PanelBounds, name: str) -> None:
    c, rows = bounds.fractions, bounds.rows[name]
    _draw_bounds(axes, c, 100.0 * (rows / rows[0] - 1.0))
    for style, each in enumerate(series):
        plot_series(axes, table, each, name, style, baseline=lambda x: np.interp(x, c, rows[0]), x_factor=X_FACTOR)
    label_axes(axes, name, table, "fibre fraction")
    axes.set_ylabel("above Reuss (%)")


def _bounds(table: SweepTable) -> PanelBounds | None:
    """The bounds; None if the materials or plane states of the cases differ, or there are more than two phases."""
    described = {repr((d["case"]["material"], d["case"]["analysis"]["plane"])) for d in table.finished}
    case = table.finished[0]["case"]
    if len(described) != 1 or set(case["material"]) != {"matrix", "fibre"} or _has_voids(table):
        return None
    plane = case["analysis"]["plane"]
    reader = TableReader({GEOMETRY: case["cell"]["geometry"]})
    materials = read_materials(case["material"], case["cell"], plane, reader)
    phases = [_stiffness(materials[phase], plane) for phase in ("matrix", "fibre")]
    largest = max(float(document["cell"]["fibre_fraction"]) for document in table.finished)
    c = np.linspace(0.0, min(1.0, MARGIN * largest), FRACTIONS)
    columns = [_bounds_at([1 - share, share], phases) for share in c]
    return PanelBounds(c, {name: np.array([column[name] for column in columns]).T for name in columns[0]})


def _stiffness(material: Material, plane: str) -> Float:
    """Of a phase, (6, 6) in generalized plane strain."""
    return spatial_stiffness(material) if plane == "generalized" else plane_stiffness(material, plane)


def _has_voids(table: SweepTable) -> bool:
    return any(document["cell"].get("porosity") for document in table.finished)


def _bounds_at(shares: list[float], phases: list[Float]) -> dict[str, list[float]]:
    """Of each panel Reuss, Voigt, and in the plane the two of Hashin and Shtrikman for isotropic phases."""
    if len(phases[0]) == len(SPATIAL_STRESSES):
        pair = np.stack([bound(shares, phases).diagonal() for bound in (mechanics.reuss, mechanics.voigt)])
        return {name: pair[:, int(name[1]) - 1].tolist() for name in SPATIAL_PANELS}
    found: dict[str, list[float]] = {name: [] for name in PANELS}
    for stiffness in (mechanics.reuss(shares, phases), mechanics.voigt(shares, phases)):
        bulk, shear = mechanics.isotropic_part(stiffness)
        for name, value in zip(PANELS, (stiffness[0, 0], stiffness[2, 2], bulk, shear), strict=True):
            found[name].append(float(value))
    if all(map(mechanics.is_isotropic, phases)):
        tight = mechanics.hashin_shtrikman(shares, phases)
        found["bulk"] += tight.bulk
        found["shear"] += tight.shear
    return found


def _draw_bounds(axes: Axes, c: Float, rows: Float) -> None:
    reuss, voigt, *tight = rows
    axes.fill_between(c, reuss, voigt, color="0.92", linewidth=0.0, label="Reuss to Voigt")
    if tight:
        axes.fill_between(c, *tight, color="0.78", linewidth=0.0, label="Hashin-Shtrikman")
    axes.set_xlim(c[0], c[-1])
