"""Draw the scaling study and the forecast of its model."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from scaling_model import Prediction
from scaling_report import STAGES, Row

mpl.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

STAGE_INK = ("#c9c9c9", "#9a9a9a", "#1f4e9c", "#c44e00")
PART_INK = ("#c9c9c9", "#1f4e9c", "#c44e00", "#3b8a5a")
STUDY_INK = {"weak": "#1f4e9c", "strong": "#c44e00"}


def plot(path: Path, studies: dict[str, list[Row]], futures: dict[str, list[Prediction]]) -> None:
    """Draw iterations and messages by ranks, seconds by size, and the shares of the predicted times."""
    figure, ((iterations, messages), (sizes, shares)) = plt.subplots(2, 2, figsize=(11, 7.5))
    by_ranks = {study: studies[study] for study in STUDY_INK if studies[study]}
    _iterations(iterations, by_ranks)
    _messages(messages, by_ranks)
    for axes in (iterations, messages):
        axes.set_xscale("log", base=2)
        axes.xaxis.set_major_formatter("{x:g}")
    _sizes(sizes, studies["sizes"])
    _shares(shares, futures)
    for axes in (iterations, messages, sizes, shares):
        # Above the axes, where there are no data.
        axes.legend(fontsize=8, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
        axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(path, dpi=150)
    plt.close(figure)


def _iterations(axes: Axes, studies: dict[str, list[Row]]) -> None:
    """Draw the iterations of weak and strong scaling by ranks."""
    for study, rows in studies.items():
        ranks, iterations = [row.ranks for row in rows], [row.iterations for row in rows]
        axes.plot(ranks, iterations, "o-", color=STUDY_INK[study], label=study)
    axes.set(xlabel="ranks", ylabel="iterations")
    axes.set_ylim(0, 1.3 * max(row.iterations for rows in studies.values() for row in rows))


def _messages(axes: Axes, studies: dict[str, list[Row]]) -> None:
    """Draw the multipliers sent in an iteration by ranks."""
    for study, rows in studies.items():
        ink, several = STUDY_INK[study], [row for row in rows if row.ranks > 1]
        sent = [row.sent / 1e3 for row in several]
        axes.plot([row.ranks for row in several], sent, "o-", color=ink, label=f"{study}: multipliers sent")
    axes.set(xlabel="ranks", ylabel="kB of the busiest rank in an iteration", yscale="log")


def _sizes(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw the cost per dof by size."""
    axes.set_visible(len(rows) > 0)
    places, start = np.arange(len(rows)), np.zeros(len(rows))
    for stage, ink in zip(STAGES, STAGE_INK, strict=True):
        values = np.array([1e6 * row.ranks * row.seconds[stage] / row.dofs for row in rows])
        axes.bar(places, values, bottom=start, color=ink, label=stage)
        start = start + values
    axes.set_xticks(places, [_short(row.dofs) for row in rows])
    axes.set(xlabel="dofs", ylabel="microseconds of a rank per dof")


def _shares(axes: Axes, futures: dict[str, list[Prediction]]) -> None:
    """Draw the predicted shares of time."""
    found = [p for series in futures.values() for p in series]
    names = [f"{title.split()[0]}, p = {p.ranks}: {p.total:.0f} s" for title, series in futures.items() for p in series]
    places, start = np.arange(len(found)), np.zeros(len(found))
    for part, ink in zip(found[0].parts, PART_INK, strict=True):
        values = np.array([p.parts[part] / p.total for p in found])
        axes.barh(places, values, left=start, color=ink, label=part)
        start += values
    axes.set_yticks(places, names, fontsize=8)
    axes.invert_yaxis()
    axes.set(xlabel="share of the predicted time")


def _short(dofs: int) -> str:
    return f"{dofs / 1e6:.2g} M" if dofs >= 1e6 else f"{dofs / 1e3:.0f} k"
