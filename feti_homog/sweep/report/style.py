"""What the pictures of a sweep have in common: their series, scatter with means, and panels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from feti_homog.output.plots.plot_helpers import unit_label
from feti_homog.sweep.report.statistics import Collected
from feti_homog.typing import Float

INK = ("#1f4e9c", "#c44e00", "#2a7f3f", "#7a3e9d", "#8c6d1f", "#c2185b")
MARKS = ("o", "s", "^", "D", "v", "P")
FAINT: dict[str, Any] = {"markersize": 3.5, "alpha": 0.4, "markeredgewidth": 0}
NAMES = {
    "C11": "$L_{11}$",
    "C33": "$L_{33}$",
    "bulk": "plane bulk modulus $k$",
    "shear": "shear modulus $\\mu$",
    "onset_S11": "$\\Sigma_{11}$ at the first break",
    "peak_S11": "largest $\\Sigma_{11}$",
}


Reference = Callable[[Float], Float]


@dataclass(frozen=True)
class Series:
    """Points of a sweep that differ by one key only: their numbers and that key's values, rising."""

    label: str
    points: list[int]
    x: Float


def series(table: Collected, key: str) -> list[Series]:
    """The series over a key, as many as there are inks.

    What varies along with the key, one value to one, is no other series.
    """
    points = [point for point in table.points if any(table.documents[row] is not None for row in table.rows(point))]
    points = [point for point in points if _value(table, key, point) is not None]
    along = [name for name in table.inputs if _follows(table, points, name, key)]
    found: dict[str, list[tuple[float, int]]] = {}
    for point in points:
        found.setdefault(table.label(point, along), []).append((float(_value(table, key, point)), point))
    ordered = {label: sorted(pairs) for label, pairs in found.items()}
    return [
        Series(label, [point for _, point in pairs], np.array([x for x, _ in pairs]))
        for label, pairs in list(ordered.items())[: len(INK)]
    ]


def _value(table: Collected, name: str, point: int) -> Any:
    return table.inputs[name][table.rows(point)[0]]


def _follows(table: Collected, points: Sequence[int], name: str, key: str) -> bool:
    """Whether an input has one value for each value of the key."""
    pairs = {(repr(_value(table, key, point)), repr(_value(table, name, point))) for point in points}
    return len(pairs) == len({value for value, _ in pairs})


def varies(table: Collected, key: str) -> bool:
    """Whether a key has more than one value among finished cases."""
    values = table.inputs.get(key, ())
    return len({v for v, d in zip(values, table.documents, strict=False) if v is not None and d is not None}) > 1


def with_scatter(
    axes: Axes, table: Collected, one: Series, name: str, style: int, above: Reference | None = None, aside: float = 1.0
) -> None:
    """Every realisation as a faint mark, at x times `aside`, and the means with their confidence intervals.

    With `above`, a value for each x, in percent above that.
    """
    ink, mark = INK[style], MARKS[style]
    statistics, values = table.statistics[name], table.outputs[name]
    numbers = [table.points.index(point) for point in one.points]
    base = np.zeros(len(one.x)) if above is None else above(one.x)
    factor = np.ones(len(one.x)) if above is None else 100.0 / base
    for x, point, zero, scale in zip(one.x, one.points, base, factor, strict=True):
        rows = table.rows(point)
        if len(rows) > 1:
            axes.plot([x * aside] * len(rows), scale * (values[rows] - zero), mark, **FAINT, color=ink)
    mean, spread = statistics.mean[numbers] - base, np.nan_to_num(statistics.ci95[numbers])
    axes.errorbar(
        one.x, factor * mean, factor * spread, color=ink, marker=mark, markersize=4.5, linewidth=1.2, capsize=2.5,
        label=one.label or None,
    )  # fmt: skip


def finish(axes: Axes, name: str, table: Collected, xlabel: str) -> None:
    """Labels, a faint grid, no box."""
    unit = unit_label(table.stress_unit) or "(unit of the moduli)"
    axes.set(xlabel=xlabel, ylabel=f"{NAMES.get(name, name)} {unit}")
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def legend(figure: Any, axes: Sequence[Axes]) -> None:
    """One legend below for all panels."""
    found: dict[str, Any] = {}
    for one in axes:
        handles, labels = one.get_legend_handles_labels()
        found |= dict(zip(labels, handles, strict=True))
    if found:
        figure.legend(
            list(found.values()), list(found), loc="outside lower center", ncols=min(len(found), 5), frameon=False
        )
