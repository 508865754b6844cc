"""How the fibres of matched random cells are placed, beside those of the table that they match."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from feti_homog.case.fibre_window import read_window
from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.microstructure.nearest_neighbours import nearest_neighbours
from feti_homog.microstructure.pair_functions import distances, pair_functions
from feti_homog.microstructure.voronoi_cells import voronoi_cells
from feti_homog.report.plots.plot_helpers import plain
from feti_homog.sweep.report.outputs import Document
from feti_homog.sweep.report.style import COLOURS, legend
from feti_homog.sweep.report.sweep_table import SweepTable
from feti_homog.typing import Float

MOST_TABLES, MOST_CELLS = 4, 60  # that are drawn
TABLE_STYLE: dict[str, Any] = {"color": "black", "linewidth": 1.8, "zorder": 3}


def tables(table: SweepTable) -> list[Path]:
    """Return the tables of fibres that finished cases match, as far as they are still there."""
    paths = dict.fromkeys(path for d in table.finished if (path := d["case"]["cell"].get("match")) is not None)
    return [path for path in map(Path, paths) if path.is_file()]


def figure(table: SweepTable) -> Figure:
    """Return a row for each table: distances of neighbours, which are matched, L(r) and local fractions, which
    follow."""
    found = tables(table)[:MOST_TABLES]
    picture = Figure(figsize=(13.0, 0.9 + 3.8 * len(found)), layout="constrained")
    panels = picture.subplots(len(found), 3, squeeze=False)
    for path, row in zip(found, panels, strict=True):
        documents = [d for d in table.finished if d["case"]["cell"].get("match") == str(path)][:MOST_CELLS]
        _compare(row, path, documents)
    picture.suptitle(f"{plain(table.name)}: cells beside the fibres that they match", fontsize=12)
    legend(picture, list(panels.flat))
    return picture


def pattern_of(document: Document) -> FibrePattern:
    """Return the fibres of a result, in its periodic cell."""
    cell, fibres = document["cell"], document["fibres"]
    centres, radii = (np.array([fibre[key] for fibre in fibres]) for key in ("centre", "radius"))
    return FibrePattern(cell["width"], cell["height"], centres, radii, periodic=True)


def _compare(row: Sequence[Axes], path: Path, documents: Sequence[Document]) -> None:
    window, cells = read_window(path), [pattern_of(document) for document in documents]
    words = f"{plain(path.name)}, {window.count} fibres"
    for k, order in enumerate(("nearest", "second")):
        for cell in cells:
            row[0].step(*_distribution(cell, k), where="post", color=COLOURS[k], linewidth=0.7, alpha=0.5)
        row[0].step([], [], color=COLOURS[k], label=f"{order} neighbours of the cells")
        row[0].step(*_distribution(window, k), where="post", **TABLE_STYLE, label="" if k else "table")
    for cell in cells:
        row[1].plot(*_clustering(cell), color=COLOURS[2], linewidth=0.7, alpha=0.5)
        row[2].step(*_local_fractions(cell), where="post", color=COLOURS[2], linewidth=0.7, alpha=0.5)
    row[1].plot([], [], color=COLOURS[2], label="cells")
    row[1].plot(*_clustering(window), **TABLE_STYLE)
    row[2].step(*_local_fractions(window), where="post", **TABLE_STYLE)
    most = max(document["cell"]["match_distance"] for document in documents)
    row[0].set_title(f"{words}; cells to {most:.4f} mean diameters")
    labels = (
        ("distance of centres / mean diameter", "share of fibres below"),
        ("r / mean radius", "(L(r) - r) / mean radius"),
        ("local fibre fraction", "share of fibres below"),
    )
    for axes, (xlabel, ylabel) in zip(row, labels, strict=True):
        axes.set(xlabel=xlabel, ylabel=ylabel)
        axes.grid(color="0.92", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)


def _distribution(pattern: FibrePattern, k: int) -> tuple[Float, Float]:
    """Return the distances to the k-th neighbour that count, in mean diameters, and the weighted share up to each."""
    near = nearest_neighbours(pattern, k + 1)
    order = np.argsort(near.distances[:, k])
    order = order[near.weights[order, k] > 0]
    return near.distances[order, k] / (2 * pattern.mean_radius), np.cumsum(near.weights[order, k])


def _clustering(pattern: FibrePattern) -> tuple[Float, Float]:
    """r and L(r) - r, in mean radii."""
    pairs = pair_functions(pattern, distances(pattern))
    return pairs.r / pattern.mean_radius, (pairs.ripley_l - pairs.r) / pattern.mean_radius


def _local_fractions(pattern: FibrePattern) -> tuple[Float, Float]:
    """Those of the Voronoi cells that count, sorted, and the weighted share up to each."""
    cells = voronoi_cells(pattern)
    order = np.argsort(cells.fractions)
    order = order[cells.whole[order]]
    return cells.fractions[order], np.cumsum(cells.weights[order])
