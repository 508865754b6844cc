"""The pictures of a sweep: moduli over the fibre fraction between their bounds; others where they apply."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from feti_homog.config.case import parse
from feti_homog.config.materials import plane_stiffness
from feti_homog.mechanics import bounds
from feti_homog.output.plots.plot_helpers import STYLE, save
from feti_homog.sweep.report import bundles, cell_size
from feti_homog.sweep.report.statistics import Collected
from feti_homog.sweep.report.style import Series, finish, legend, series, varies, with_scatter
from feti_homog.typing import Float

FRACTION, FIBRES = "cell.fibre_fraction", "cell.fibres"
PANELS = ("C11", "C33", "bulk", "shear")


def plot(directory: Path, table: Collected) -> list[Path]:
    """Draw what varies: moduli.png over the fibre fraction, cell_size.png over the number of fibres, curves.png of
    paths; returns the files.  On one rank."""
    with mpl.rc_context(STYLE):
        paths = []
        if varies(table, FRACTION) and "bulk" in table.outputs:
            paths.append(save(_moduli(table), directory / "moduli.png"))
        if varies(table, FIBRES) and cell_size.names(table):
            paths.append(save(cell_size.figure(table, FIBRES), directory / "cell_size.png"))
        if any(len(table.bundle(point)[0]) for point in table.points):
            paths.append(save(bundles.figure(table), directory / "curves.png"))
        return paths


def _moduli(table: Collected) -> Figure:
    """Moduli above; below, where there are bounds, how far they are above that of Reuss, which tells them apart."""
    limits, rows = _bounds(table), series(table, FRACTION)
    figure = Figure(figsize=(14.4, 6.6 if limits else 3.8), layout="constrained")
    panels = figure.subplots(2 if limits else 1, len(PANELS), sharex=True, squeeze=False)
    for k, name in enumerate(PANELS):
        if limits is not None:
            _draw_bounds(panels[0, k], limits["c"], limits[name])
        for style, one in enumerate(rows):
            with_scatter(panels[0, k], table, one, name, style)
        finish(panels[0, k], name, table, "" if limits else "fibre fraction")
        if limits is not None:
            _above_reuss(panels[1, k], table, rows, limits["c"], limits[name], name)
    documents = [document for document in table.documents if document is not None]
    planes = sorted({document["case"]["analysis"]["plane"] for document in documents})
    figure.suptitle(f"{table.name}: plane {' and '.join(planes)}", fontsize=12)
    legend(figure, list(panels.flat)[::-1])
    return figure


def _above_reuss(axes: Axes, table: Collected, rows: list[Series], c: Float, limits: Float, name: str) -> None:
    _draw_bounds(axes, c, 100.0 * (limits / limits[0] - 1.0))
    for style, one in enumerate(rows):
        with_scatter(axes, table, one, name, style, above=lambda x: np.interp(x, c, limits[0]), aside=0.98)
    finish(axes, name, table, "fibre fraction")
    axes.set_ylabel("above Reuss (%)")


def _bounds(table: Collected) -> dict[str, Float] | None:
    """Fibre fractions `c` and, of each panel, rows Reuss, Voigt, and for isotropic phases the Hashin-Shtrikman bounds.

    None if the materials or plane states of the cases differ, or there are more than two phases.
    """
    documents = [document for document in table.documents if document is not None]
    described = {repr((d["case"]["material"], d["case"]["analysis"]["plane"])) for d in documents}
    case = documents[0]["case"]
    if len(described) != 1 or set(case["material"]) != {"matrix", "fibre"}:
        return None
    materials = parse({**case, "cell": case["cell"] | {"order": 2}}, Path()).materials
    phases = [plane_stiffness(materials[phase], case["analysis"]["plane"]) for phase in ("matrix", "fibre")]
    widest = max(float(document["cell"]["fibre_fraction"]) for document in documents)
    c = np.linspace(0.0, min(1.0, 1.05 * widest), 201)
    rows = [_at([1 - share, share], phases) for share in c]
    return {"c": c} | {name: np.array([row[name] for row in rows]).T for name in rows[0]}


def _at(shares: list[float], phases: list[Float]) -> dict[str, list[float]]:
    found: dict[str, list[float]] = {name: [] for name in PANELS}
    for stiffness in (bounds.reuss(shares, phases), bounds.voigt(shares, phases)):
        bulk, shear = bounds.isotropic_part(stiffness)
        for name, value in zip(PANELS, (stiffness[0, 0], stiffness[2, 2], bulk, shear), strict=True):
            found[name].append(float(value))
    if all(map(bounds.is_isotropic, phases)):
        tight = bounds.hashin_shtrikman(shares, phases)
        found["bulk"] += tight.bulk
        found["shear"] += tight.shear
    return found


def _draw_bounds(axes: Axes, c: Float, limits: Float) -> None:
    reuss, voigt, *tight = limits
    axes.fill_between(c, reuss, voigt, color="0.92", linewidth=0.0, label="Reuss to Voigt")
    if tight:
        axes.fill_between(c, *tight, color="0.78", linewidth=0.0, label="Hashin-Shtrikman")
    axes.set_xlim(c[0], c[-1])
