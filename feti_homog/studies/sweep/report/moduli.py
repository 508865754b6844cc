"""Moduli over the fibre fraction, between their bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from feti_homog.case.cell_section import GEOMETRY
from feti_homog.case.material_sections import read_materials
from feti_homog.materials import bounds as mechanics
from feti_homog.materials.bounds import fibre_bounds
from feti_homog.materials.constants import is_transversely_isotropic, isotropic_part, transversely_isotropic_part
from feti_homog.materials.laws import stiffness_of
from feti_homog.materials.voigt import PLANE_STATES, plane_state_of
from feti_homog.report.plots.plot_helpers import plain
from feti_homog.schema.keys import TableReader
from feti_homog.studies.sweep.report.style import COLOURS, label_axes, legend, plot_series
from feti_homog.studies.sweep.report.sweep_table import SweepTable, series_over
from feti_homog.typing import Float

FRACTION = "cell.fibre_fraction"
PANELS = ("C11", "C33", "bulk", "shear")
SPATIAL_PANELS = ("E_axial", "E_transverse", "G_axial", "G_transverse")  # of generalized plane strain
RATIOS = ("nu_axial", "nu_transverse", "expansion_axial", "expansion_transverse")
SECANTS = ("C11", "C33", "C44", "C66")  # of that where faces may touch: there are no constants
COMMON_PANELS = ("C11", "C66")  # of that and of plane states
FRACTIONS, MARGIN = 201, 1.05  # of the bounds: points, and how far they go beyond the largest fibre fraction
# Where the fractions drawn begin: at none, or before the smallest by this share of their range if that is far away.
BEFORE = 0.25
HASHIN_SHTRIKMAN = "Hashin-Shtrikman"


@dataclass(frozen=True)
class PanelBounds:
    """Fibre fractions (n,) and the bounds of each panel over them, with their names.

    Rows are Reuss, Voigt, and the two tighter ones if they apply, (2 or 4, n).
    """

    fractions: Float
    rows: dict[str, Float]
    tight: str


def panels_of(table: SweepTable) -> tuple[str, ...]:
    """Return the outputs that are drawn; none if the cases have no moduli."""
    spatial = {plane_state_of(document).is_spatial for document in table.finished}
    in_space = (COMMON_PANELS,) if False in spatial else (SPATIAL_PANELS, SECANTS)
    choices = in_space if True in spatial else (PANELS,)
    return next((names for names in choices if all(name in table.outputs for name in names)), ())


def figure(table: SweepTable) -> Figure:
    """Moduli over the fibre fraction, between their bounds if there are any.

    In space there are also Poisson's ratios and thermal expansions.
    """
    bounds, series = _bounds(table), series_over(table, FRACTION)[: len(COLOURS)]
    ratios = RATIOS if panels_of(table) == SPATIAL_PANELS else ()
    names = [*panels_of(table), *(name for name in ratios if name in table.outputs)]
    rows = -(-len(names) // len(PANELS))
    picture = Figure(figsize=(14.4, 3.6 * rows + 0.6), layout="constrained")
    panels = picture.subplots(rows, len(PANELS), sharex=True, squeeze=False).ravel()
    for axes, name in zip(panels, names, strict=False):
        if bounds is not None and name in bounds.rows:
            _draw_bounds(axes, bounds.fractions, bounds.rows[name], bounds.tight)
        for style, each in enumerate(series):
            plot_series(axes, table, each, name, style)
        label_axes(axes, name, table, "fibre fraction")
        axes.tick_params(labelbottom=True)
    for axes in panels[len(names) :]:
        axes.set_axis_off()
    planes = sorted({document["case"]["analysis"]["plane"] for document in table.finished})
    without = "" if bounds else f"; no bounds, for {_why_no_bounds(table)}"
    picture.suptitle(f"{plain(table.name)}: plane {' and '.join(planes)}{without}", fontsize=12)
    legend(picture, list(panels)[::-1])
    return picture


def _why_no_bounds(table: SweepTable) -> str:
    """Why bounds are not drawn, in words; empty if they are."""
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


def _bounds(table: SweepTable) -> PanelBounds | None:
    """Return the bounds, if there are any."""
    if _why_no_bounds(table):
        return None
    case = table.finished[0]["case"]
    plane = case["analysis"]["plane"]
    reader = TableReader({GEOMETRY: case["cell"]["geometry"]})
    materials = read_materials(case, plane, reader)
    phases = [stiffness_of(materials[phase], plane) for phase in ("matrix", "fibre")]
    c = _fractions([float(document["cell"]["fibre_fraction"]) for document in table.finished])
    spatial = PLANE_STATES[plane].is_spatial
    bounds_at, tight = (_spatial_bounds_at, "Hill, Hashin") if spatial else (_bounds_at, HASHIN_SHTRIKMAN)
    columns = [bounds_at([1 - share, share], phases) for share in c]
    return PanelBounds(c, {name: np.array([column[name] for column in columns]).T for name in columns[0]}, tight)


def _fractions(meshed: list[float]) -> Float:
    """(n,) over which bounds are drawn."""
    least, largest = min(meshed), max(meshed)
    first = 0.0 if least <= largest / 2 else least - BEFORE * (largest - least or least)
    return np.linspace(first, min(1.0, MARGIN * largest), FRACTIONS)


def _bounds_at(shares: list[float], phases: list[Float]) -> dict[str, list[float]]:
    """Bounds of each panel: Reuss, Voigt, and the two of Hashin and Shtrikman for isotropic phases."""
    found: dict[str, list[float]] = {name: [] for name in PANELS}
    for stiffness in (mechanics.reuss(shares, phases), mechanics.voigt(shares, phases)):
        bulk, shear = isotropic_part(stiffness)
        for name, value in zip(PANELS, (stiffness[0, 0], stiffness[2, 2], bulk, shear), strict=True):
            found[name].append(float(value))
    if all(map(mechanics.is_isotropic, phases)):
        tight = mechanics.hashin_shtrikman(shares, phases)
        found["bulk"] += tight.bulk
        found["shear"] += tight.shear
    return found


def _spatial_bounds_at(shares: list[float], phases: list[Float]) -> dict[str, list[float]]:
    """Bounds of each panel: Reuss, Voigt, and the two of fibres of any section for phases alike across them."""
    ends = [transversely_isotropic_part(bound(shares, phases)) for bound in (mechanics.reuss, mechanics.voigt)]
    found = {name: [float(getattr(end, name)) for end in ends] for name in SPATIAL_PANELS}
    own = [transversely_isotropic_part(phase) for phase in phases]
    if all(map(is_transversely_isotropic, own)):
        tight = fibre_bounds(shares, own)
        for name, pair in (
            ("G_axial", tight.G_axial),
            ("G_transverse", tight.G_transverse),
            ("E_axial", tight.E_axial),
        ):
            found[name] += pair
    return found


def _draw_bounds(axes: Axes, c: Float, rows: Float, whose: str) -> None:
    reuss, voigt, *tight = rows
    axes.fill_between(c, reuss, voigt, color="0.92", linewidth=0.0, label="Reuss to Voigt")
    if tight:
        axes.fill_between(c, *tight, color="0.78", linewidth=0.0, label=whose)
    axes.set_xlim(c[0], c[-1])
