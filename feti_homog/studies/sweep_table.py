"""Tabulate a sweep: inputs, outputs and results of all cases, with statistics over realisations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy.stats import t as student

from feti_homog.report.text import tables
from feti_homog.results import landmarks, path_curves
from feti_homog.studies.axes import is_seed
from feti_homog.studies.estimation import CONFIDENCE
from feti_homog.typing import Document, Float

PARTS = ("count", "mean", "std", "ci95")
CURVE_POINTS = 401  # strains at which curves are averaged


@dataclass(frozen=True)
class Statistics:
    """Statistics of an output over the finished realisations; all arrays have the same shape.

    `std` and `ci95`, half the 95 % confidence interval of the mean by Student's t, are NaN below two realisations.
    """

    count: Float
    mean: Float
    std: Float
    ci95: Float

    @classmethod
    def of(cls, samples: Float) -> Self:
        """Compute the statistics (...) over the first axis of `samples` (n, ...), whose NaN do not count."""
        is_known = np.isfinite(samples)
        count = is_known.sum(axis=0)
        several = np.where(count > 1, count, np.nan)
        mean = np.where(is_known, samples, 0.0).sum(axis=0) / np.where(count > 0, count, np.nan)
        std = np.sqrt(np.where(is_known, (samples - mean) ** 2, 0.0).sum(axis=0) / (several - 1))
        return cls(count.astype(float), mean, std, student.ppf((1 + CONFIDENCE) / 2, several - 1) * std / several**0.5)


@dataclass(frozen=True, repr=False)
class SweepTable:
    """The table of a sweep, a row for each case; as a frame: `pandas.DataFrame({**table.inputs, **table.outputs})`.

    Attributes:
        name, stress_unit: as in the sweep.
        folder, point, realisation, status, reason: values for each case; `reason` explains a missing or partial result.
        inputs: value of each case by dotted key, None if the case does not set the key.
        outputs: values (cases,) by name, NaN for cases without the output; for unfinished paths, values so far.
        documents: result.json of finished cases, else None.
    """

    name: str
    stress_unit: str
    folder: Sequence[str]
    point: Sequence[int]
    realisation: Sequence[int]
    status: Sequence[str]
    reason: Sequence[str]
    inputs: Mapping[str, Sequence[Any]]
    outputs: Mapping[str, Float]
    documents: Sequence[Document | None]

    def __repr__(self) -> str:
        counts = f"{len(self.finished)} of {len(self.status)} cases done, {len(self.outputs)} outputs"
        return f"SweepTable({self.name!r}: {counts} over {', '.join(self.inputs)})"

    @cached_property
    def points(self) -> list[int]:
        """The numbers of the sweep points, in ascending order."""
        return sorted(set(self.point))

    def rows(self, point: int) -> list[int]:
        """Return the table rows of the realisations of point number `point`."""
        return [row for row, number in enumerate(self.point) if number == point]

    @cached_property
    def statistics(self) -> dict[str, Statistics]:
        """The statistics (points,) of each output over the finished realisations of each point, by output name."""
        statistics, is_finished = {}, np.array([document is not None for document in self.documents])
        for name, values in self.outputs.items():
            finished = np.where(is_finished, values, np.nan)
            at_points = [Statistics.of(finished[self.rows(point)]) for point in self.points]
            statistics[name] = Statistics(*(np.array([getattr(each, part) for each in at_points]) for part in PARTS))
        return statistics

    @property
    def stated(self) -> list[str]:
        """The names of outputs worth a table: not zero in all cases, and no times, memory or checks."""
        names = [name for name, values in self.outputs.items() if np.nan_to_num(values).any()]
        return [name for name in names if not name.startswith(("seconds_", "memory", "check_"))]

    @property
    def finished(self) -> list[Document]:
        """The contents of result.json for all finished cases."""
        return [document for document in self.documents if document is not None]

    @cached_property
    def rising(self) -> list[Document]:
        """The results of finished paths on which stress acts and does not fall before the end."""
        peaks = [(result, landmarks.peak_of(result)) for result in self.finished if "path" in result]
        return [result for result, peak in peaks if "stress_left" not in peak and "event" in peak]

    def input_of(self, point: int, name: str) -> Any:
        """Return the value of an input at a point, or None if the point does not set the input."""
        return self.inputs[name][self.rows(point)[0]]

    def results_of(self, point: int) -> list[Document]:
        """Return the contents of result.json for the finished realisations of a point."""
        return [document for row in self.rows(point) if (document := self.documents[row]) is not None]

    def label(self, point: int, without: Sequence[str] = ()) -> str:
        """Return a phrase with the varying inputs of a point, except seeds and keys in `without`; "" without inputs."""
        keys = [name for name in self.inputs if name not in without and not is_seed(name)]
        varied = [name for name in keys if len({repr(value) for value in self.inputs[name]}) > 1]
        labels = []
        for key in varied:
            if (value := self.input_of(point, key)) is None:
                continue
            # A key loses its section, but keeps a material's phase and an interface's number.
            section, _, rest = key.partition(".")
            name = rest if section == "material" else key.partition("interface.")[2] or key.rpartition(".")[2]
            name = name.replace(".", " ").replace("_", " ")
            words = value if isinstance(value, str) else f"{name} {value}"
            if name == "fibres":
                words = f"{value} fibres"
            elif isinstance(value, float | int) and not isinstance(value, bool):
                words = f"{name} {value:g}"
            labels.append(f"{words} {tables.unit(key, self.stress_unit)}".rstrip())
        return ", ".join(labels)

    def curves(self, point: int) -> tuple[Float, Float]:
        """Return the stress-strain curves at a point of the sweep, interpolated to common strains.

        Returns leading strains (g,) from 0 to the shortest path's end, g = CURVE_POINTS, and c stresses (n, g, c) of
        the n finished realisations with a `path_curves.rising_strain`.  Both are empty if n = 0.
        """
        paths = [path for path in map(path_curves.rising_strain, self.results_of(point)) if path is not None]
        if not paths:
            return np.zeros(0), np.zeros((0, 0, 3))
        strain = np.linspace(0.0, min(path[-1, -1] for path in paths), CURVE_POINTS)
        stresses = range(paths[0].shape[1] - 1)
        curves = np.array([[np.interp(strain, p[:, -1], p[:, k]) for k in stresses] for p in paths])
        return strain, curves.swapaxes(1, 2)


@dataclass(frozen=True)
class Series:
    """Sweep points that differ in one key, whose ascending values are `x`, and in inputs that are functions of it."""

    label: str
    points: list[int]
    x: Float


def series_over(table: SweepTable, key: str) -> list[Series]:
    """Group the sweep points with finished cases into series over a key.

    Points in a series agree in all inputs except the key, seeds, and inputs that are functions of the key.
    """
    points = [p for p in table.points if table.results_of(p) and table.input_of(p, key) is not None]
    along = list[str]()
    for name in table.inputs:
        pairs = {(repr(table.input_of(point, key)), repr(table.input_of(point, name))) for point in points}
        if len(pairs) == len({value for value, _ in pairs}):
            along.append(name)
    labels = {point: table.label(point, along) for point in points}
    series = []
    for label in dict.fromkeys(labels.values()):
        rising = sorted((float(table.input_of(point, key)), point) for point in points if labels[point] == label)
        series.append(Series(label, [point for _, point in rising], np.array([x for x, _ in rising])))
    return series


def varies(table: SweepTable, key: str) -> bool:
    """Return whether an input has more than one value among finished cases."""
    values = table.inputs.get(key, ())
    return len({v for v, d in zip(values, table.documents, strict=False) if v is not None and d is not None}) > 1
