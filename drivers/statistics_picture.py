"""Draw statistics.png: fibres with their local fractions, and the distributions of all measured quantities."""

from itertools import product
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from pattern_statistics import SECTORS, FibreStatistics

from feti_homog.report.plots.plot_helpers import STYLE, faint_grid, plain, save
from feti_homog.typing import Float

COLOURS = ("#0072B2", "#D55E00", "#009E73")
ORDINALS = ("nearest", "second", "third")
BINS = 20


def write(directory: Path, found: FibreStatistics, name: str, model: str) -> Path:
    """Draw statistics.png in a folder; return its path.  On one rank.  Raises FetiHomogError if it cannot."""
    with mpl.rc_context(STYLE):
        return save(figure(found, name, model), directory / "statistics.png")


def figure(found: FibreStatistics, name: str, model: str) -> Figure:
    """Return the fibres on the left, six panels beside them; lengths in mean radii or diameters."""
    picture = Figure(figsize=(16.5, 6.8), layout="constrained")
    left, right = picture.subfigures(1, 2, width_ratios=(1.0, 1.75))
    fibres(left.subplots(), found)
    radial, clustering, near, local, radii = (right.add_subplot(2, 3, place) for place in (1, 2, 3, 4, 6))
    _radial(radial, found)
    _clustering(clustering, found, model)
    nearest_distances(near, found)
    _local_fractions(local, found)
    _directions(right.add_subplot(2, 3, 5, projection="polar"), found)
    relative = found.pattern.radii / found.pattern.mean_radius
    _histogram(radii, relative, np.full(found.pattern.count, 1 / found.pattern.count), "radius / mean radius")
    picture.suptitle(f"{plain(name)}: {found.pattern.count} fibres, {100 * found.pattern.fibre_fraction:.1f} %")
    return picture


def fibres(axes: Axes, found: FibreStatistics) -> None:
    """Draw the fibres in the colours of their local fractions.

    Parts outside a periodic cell return on the other side.
    """
    pattern, fractions = found.pattern, np.where(found.cells.whole, found.cells.fractions, np.nan)
    shifts = np.array(list(product((-1, 0, 1), repeat=2)) if pattern.periodic else [(0, 0)]) * pattern.size
    centres = (pattern.wrapped if pattern.periodic else pattern.centres) + shifts[:, None]
    seen = np.all(np.abs(centres - pattern.size / 2) < pattern.size / 2 + pattern.radii[:, None], axis=2)
    which = np.nonzero(seen)[1]
    diameter = 2 * pattern.radii[which]
    discs = EllipseCollection(
        diameter, diameter, np.zeros(len(which)), units="xy", offsets=centres[seen], offset_transform=axes.transData,
        array=fractions[which], cmap="viridis", edgecolors="0.2", linewidths=0.4,
    )  # fmt: skip
    discs.cmap.set_bad("0.85")
    axes.add_collection(discs)
    axes.set(xlim=(0, pattern.width), ylim=(0, pattern.height), xlabel="$x_1$", ylabel="$x_2$")
    axes.set_aspect("equal")
    words = "local fibre fraction" + ("" if found.cells.whole.all() else " (grey: undetermined in the window)")
    axes.figure.colorbar(discs, ax=axes, orientation="horizontal", shrink=0.8, pad=0.02, label=words)


def nearest_distances(axes: Axes, found: FibreStatistics) -> None:
    """Draw weighted distributions of the distances to the three nearest centres."""
    near, size = found.neighbours, 2 * found.pattern.mean_radius
    for k, (colour, ordinal) in enumerate(zip(COLOURS, ORDINALS, strict=True)):
        order = np.argsort(near.distances[:, k])
        order = order[near.weights[order, k] > 0]
        distances = near.distances[order, k] / size
        axes.step(distances, np.cumsum(near.weights[order, k]), where="post", color=colour, label=ordinal)
    _label(axes, "distance of centres / mean diameter", "share of fibres below")
    axes.set_ylim(0, 1.02)
    axes.legend(frameon=False)


def _radial(axes: Axes, found: FibreStatistics) -> None:
    radius = found.pattern.mean_radius
    steps = np.r_[0.0, found.pairs.r] / radius
    axes.stairs(found.pairs.radial, steps, color=COLOURS[0], baseline=None)
    axes.axhline(1.0, color="0.6", linewidth=0.8)
    axes.set(xlim=(0, steps[-1]), ylim=(0, None))
    _label(axes, "r / mean radius", "radial distribution g(r)")


def _clustering(axes: Axes, found: FibreStatistics, model: str) -> None:
    """Draw L(r) - r, above zero where fibres cluster; the band shows the simulations."""
    radius, r = found.pattern.mean_radius, found.pairs.r
    low, high, mean = ((values - r) / radius for values in (found.random.low, found.random.high, found.random.mean))
    axes.fill_between(r / radius, low, high, color="0.87", label=f"simulations, {model}")
    axes.plot(r / radius, mean, color="0.55", linewidth=0.9)
    axes.plot(r / radius, (found.pairs.ripley_l - r) / radius, color=COLOURS[0], label="these fibres")
    axes.axhline(0.0, color="0.6", linewidth=0.8, linestyle=":")
    axes.set_xlim(0, r[-1] / radius)
    axes.set_title(f"p = {found.random.p_value:.3g}")
    _label(axes, "r / mean radius", "(L(r) - r) / mean radius")
    axes.legend(frameon=False)


def _local_fractions(axes: Axes, found: FibreStatistics) -> None:
    whole = found.cells.whole
    _histogram(axes, found.cells.fractions[whole], found.cells.weights[whole], "local fibre fraction")
    axes.axvline(found.pattern.fibre_fraction, color=COLOURS[1], linewidth=1.2, label="fibre fraction")
    axes.legend(frameon=False)


def _directions(axes: Any, found: FibreStatistics) -> None:
    """Draw bars of the near pairs' directions; each direction twice, because a pair has no front and back."""
    angles = np.arange(2 * SECTORS) * np.pi / SECTORS
    axes.bar(angles, np.tile(found.directions, 2), width=np.pi / SECTORS, color="#9fb6da", edgecolor=COLOURS[0])
    axes.plot(np.linspace(0, 2 * np.pi, 200), np.ones(200), color=COLOURS[1], linewidth=1.2)
    axes.set_title("directions of near pairs (line: all alike)", fontsize=10)
    axes.set_yticks([])
    axes.tick_params(labelsize=8)


def _histogram(axes: Axes, values: Float, weights: Float, label: str) -> None:
    """Draw a histogram of the fibres, each with its weight."""
    middle, width = float(np.mean(values)) if len(values) else 0.0, float(np.ptp(values)) if len(values) else 0.0
    least = 0.01 * middle or 0.01  # equal values fill one bar
    limits = (middle - least, middle + least) if width < least else None
    bins = 1 if limits else BINS
    axes.hist(values, bins, range=limits, weights=weights, color="#9fb6da", edgecolor=COLOURS[0], linewidth=0.6)
    if limits:
        axes.set_xlim(middle - 10 * least, middle + 10 * least)
    _label(axes, label, "share of fibres")


def _label(axes: Axes, xlabel: str, ylabel: str) -> None:
    axes.set(xlabel=xlabel, ylabel=ylabel)
    faint_grid(axes)
