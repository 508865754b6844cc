"""The pictures of a sweep, each drawn where what it shows varies."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

from feti_homog.report.plots.plot_helpers import STYLE, save
from feti_homog.sweep.report import bundles, cell_size, match_comparison, moduli
from feti_homog.sweep.report.series import varies
from feti_homog.sweep.report.sweep_table import SweepTable

FIBRES = "cell.fibres"


def plot(directory: Path, table: SweepTable) -> list[Path]:
    """Draw what varies: moduli.png over the fibre fraction, cell_size.png over the number of fibres, curves.png of
    paths, match.png of cells that match a table of fibres; returns the files.  On one rank."""
    with mpl.rc_context(STYLE):
        paths = []
        if varies(table, moduli.FRACTION) and moduli.panels_of(table):
            paths.append(save(moduli.figure(table), directory / "moduli.png"))
        if varies(table, FIBRES) and cell_size.names(table):
            paths.append(save(cell_size.figure(table, FIBRES), directory / "cell_size.png"))
        if any(len(table.curves(point)[0]) for point in table.points):
            paths.append(save(bundles.figure(table), directory / "curves.png"))
        if match_comparison.tables(table):
            paths.append(save(match_comparison.figure(table), directory / "match.png"))
        return paths
