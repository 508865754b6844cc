"""The points of a sweep: the values of its axes, combined to a grid, row by row, or sampled."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from feti_homog.case.document import TomlPath
from feti_homog.case.sections import AXIS_EXPECTED, MAX_CASES, RANGE_KEYS, SECTIONS, SWEEP, TOP_LEVEL, SweepSection
from feti_homog.schema.keys import TableReader, keys_of
from feti_homog.schema.values import is_number, magnitudes_in_words
from feti_homog.schema.wording import dotted_key, suggestion, toml_value

STEP_TOLERANCE = 1e-9  # of a step: what rounding may take from the last one
Assignment = dict[TomlPath, Any]


def read_points(table: Mapping[str, Any], faults: list[str]) -> tuple[list[Assignment], SweepSection]:
    """Return the points of a table [sweep] as values by key, in their order, and its settings.

    There are no points, and a line for each fault is added to `faults`, if the table is faulty.
    """
    names = keys_of(SweepSection)
    reader = TableReader()
    own = {name: value for name, value in table.items() if name in names}
    settings = reader.read(SweepSection, own, SWEEP) or SweepSection()
    axis_reader = AxisReader(is_sampled="samples" in own)
    axes = axis_reader.read({name: value for name, value in table.items() if name not in names})
    found = [*reader.faults, *axis_reader.faults, *_axis_faults(axes, settings)]
    if not axes and not found and settings.realisations is None:
        found.append(f"[{SWEEP}]: nothing varies; expected keys with {AXIS_EXPECTED}, or realisations")
    found += _count_faults(axes, settings)
    faults += found
    return ([] if found else combine(axes, settings)), settings


def _axis_faults(axes: Sequence[Axis], settings: SweepSection) -> list[str]:
    """Faults of the axes together: nothing to sample, or a key twice."""
    faults = []
    if settings.samples is not None and all(axis.values for axis in axes):
        faults.append(f"[{SWEEP}] samples = {settings.samples}: no key is to be sampled; expected a range {{from, to}}")
    paths = [axis.path for axis in axes]
    repeated = [path for path in dict.fromkeys(paths) if paths.count(path) > 1]
    return faults + [f"[{SWEEP}] {dotted_key(path)}: given twice" for path in repeated]


def _count_faults(axes: Sequence[Axis], settings: SweepSection) -> list[str]:
    """Faults of how many values there are: not the same of all keys, or too many cases."""
    faults, lengths = [], _lengths(axes, settings)
    if settings.mode == "zip" and len({length for _, length in lengths}) > 1:
        words = ", ".join(f"{length} of {names}" for names, length in lengths)
        faults.append(f'[{SWEEP}] mode = "zip": expected as many values of each key; there are {words}')
    counts = [length for _, length in lengths]
    cases = (prod(counts) if settings.mode == "grid" else max(counts, default=1)) * (settings.realisations or 1)
    return faults + ([f"[{SWEEP}]: {cases} cases; expected at most {MAX_CASES}"] if cases > MAX_CASES else [])


def _lengths(axes: Sequence[Axis], settings: SweepSection) -> list[tuple[str, int]]:
    """Return the keys of each axis in words, and how many values it has; sampled keys are one axis."""
    lengths = [(dotted_key(axis.path), len(axis.values)) for axis in axes if axis.values]
    sampled = [dotted_key(axis.path) for axis in axes if not axis.values]
    return [*lengths, (" and ".join(sampled), settings.samples)] if sampled and settings.samples else lengths


def combine(axes: Sequence[Axis], settings: SweepSection) -> list[Assignment]:
    """Return the points of axes without fault.

    Of a grid the last key in the file runs fastest; sampled keys are one axis of points, the last.
    """
    lists = [[{axis.path: value} for value in axis.values] for axis in axes if axis.values]
    lists += _samples([axis for axis in axes if not axis.values], settings)
    rows = product(*lists) if settings.mode == "grid" or not lists else zip(*lists, strict=True)
    return [{path: value for part in row for path, value in part.items()} for row in rows]


def _samples(axes: Sequence[Axis], settings: SweepSection) -> list[list[Assignment]]:
    """Return the points in the box of the sampled axes, a Latin hypercube or independent.

    No list if there are no axes.
    """
    if not axes or settings.samples is None:
        return []
    if settings.sampling == "latin":
        from scipy.stats import qmc  # which takes most of a second, and few sweeps need it

        shares = qmc.LatinHypercube(len(axes), seed=settings.seed).random(settings.samples)
    else:
        shares = np.random.default_rng(settings.seed).random((settings.samples, len(axes)))
    paths = [axis.path for axis in axes]
    columns = [axis.at(column) for axis, column in zip(axes, shares.T, strict=True)]
    return [[dict(zip(paths, row, strict=True)) for row in zip(*columns, strict=True)]]


@dataclass(frozen=True)
class Axis:
    """A key that varies: its values or, if it is sampled, the ends that they lie between."""

    path: TomlPath
    values: tuple[Any, ...] = ()
    ends: tuple[float, float] = (0.0, 0.0)
    log: bool = False

    def at(self, shares: ArrayLike) -> list[Any]:
        """Return the values at shares in [0, 1] of the way from the first to the second end."""
        low, high = np.log(self.ends) if self.log else self.ends
        found = low + (high - low) * np.asarray(shares)
        return [_rounded(value, self.path) for value in (np.exp(found) if self.log else found).tolist()]


@dataclass(frozen=True)
class Range:
    """A checked range: its ends, and a step, a number of values, or neither if it is sampled."""

    low: float
    high: float
    log: bool
    step: float | None
    count: int | None

    def axis(self, path: TomlPath) -> Axis:
        """Return the axis of the key that has this range."""
        axis = Axis(path, ends=(self.low, self.high), log=self.log)
        if self.step is not None:
            return Axis(path, tuple(_rounded(value, path) for value in _steps(self.low, self.high, self.step)))
        if self.count is not None:
            return Axis(path, tuple(axis.at(np.linspace(0, 1, self.count))))
        return axis


@dataclass
class AxisReader:
    """Reads the axes of a table, nested by section, and gathers what is wrong with them.

    Attributes:
        is_sampled: whether ranges without step and count are allowed.
        faults: one line each.
    """

    is_sampled: bool
    faults: list[str] = field(default_factory=list)

    def read(self, table: Mapping[str, Any]) -> list[Axis]:
        """Return the axes in the order of the file, but for the faulty ones."""
        axes = []
        for path, value in _leaves(table):
            fault = self._fault(path, value)
            if fault:
                self.faults.append(f"[{SWEEP}] {dotted_key(path)} = {toml_value(value)}: {fault}")
            else:
                axes.append(_axis(path, value))
        return axes

    def _fault(self, path: TomlPath, value: Any) -> str:
        """Return the fault of an axis, empty if there is none."""
        if path[0] not in TOP_LEVEL or path[0] in ("name", SWEEP):
            known = [*keys_of(SweepSection), *SECTIONS, "material", "petsc"]
            return f"unknown key; {suggestion(path[0], known, {})}"
        if isinstance(value, list):
            return "" if value else "expected at least one value"
        return range_fault(value, self.is_sampled) if _is_range(path, value) else f"expected {AXIS_EXPECTED}"


def _leaves(table: Mapping[str, Any], above: TomlPath = ()) -> Iterator[tuple[TomlPath, Any]]:
    """Yield the paths and values of a nested table; a range is a value, and so is what stands in an unknown section."""
    for name, value in table.items():
        path = (*above, *name.split("."))
        is_known = path[0] in TOP_LEVEL and path[0] not in ("name", SWEEP)
        if is_known and isinstance(value, dict) and value and not _is_range(path, value):
            yield from _leaves(value, path)
        else:
            yield path, value


def _is_range(path: TomlPath, value: Any) -> bool:
    """Return whether the value of a key is meant as a range; a section, which may have a key "to", is none."""
    return len(path) > 1 and isinstance(value, dict) and bool(value.keys() & {"from", "to"})


def _axis(path: TomlPath, value: Any) -> Axis:
    """Return the axis of a value without fault."""
    return Axis(path, tuple(value)) if isinstance(value, list) else _range(value).axis(path)


def _range(table: Mapping[str, Any]) -> Range:
    """Return the range of a table without fault."""
    is_log = table.get("scale") == "log"
    return Range(float(table["from"]), float(table["to"]), is_log, table.get("step"), table.get("count"))


def range_fault(table: Mapping[str, Any], is_sampled: bool) -> str:
    """Return the fault of a range, empty if there is none."""
    unknown = [name for name in table if name not in RANGE_KEYS]
    if unknown:
        return f"{unknown[0]}: unknown key; expected one of {', '.join(RANGE_KEYS)}"
    return _ends_fault(table) or _spacing_fault(table, is_sampled)


def _ends_fault(table: Mapping[str, Any]) -> str:
    low, high, scale = table.get("from"), table.get("to"), table.get("scale", "linear")
    if not (is_number(low) and is_number(high) and low < high):  # type: ignore[operator]
        return f"expected numbers from < to{magnitudes_in_words([low, high])}"
    if scale not in ("linear", "log") or (scale == "log" and low <= 0):  # type: ignore[operator]
        return 'expected scale = "linear" or "log", this from a number above 0'
    return ""


def _spacing_fault(table: Mapping[str, Any], is_sampled: bool) -> str:
    """Return the fault of the step or count of a range with valid ends."""
    step, count = table.get("step"), table.get("count")
    if step is not None and count is not None:
        return "step, count: exclude each other; give one"
    if step is not None:
        return _step_fault(step, table)
    if count is not None:
        is_right = isinstance(count, int) and 2 <= count <= MAX_CASES
        return "" if is_right else f"expected a count from 2 to {MAX_CASES}"
    return "" if is_sampled else f"expected {AXIS_EXPECTED}"


def _step_fault(step: Any, table: Mapping[str, Any]) -> str:
    width = table["to"] - table["from"]
    if not is_number(step) or not 0 < step <= width or table.get("scale") == "log":
        return f"expected a step above 0 and at most to - from, linear{magnitudes_in_words(step)}"
    if width / step >= MAX_CASES:
        return f"about {width / step:.6g} values; expected a step that makes at most {MAX_CASES}"
    return ""


def _steps(low: float, high: float, step: float) -> list[float]:
    """low, low + step, ... up to high, which a rounding error does not leave out."""
    return [low + k * step for k in range(int((high - low) / step + STEP_TOLERANCE) + 1)]


def _rounded(value: float, path: TomlPath) -> Any:
    """Return the number without the noise of its last digits; an integer where the key takes nothing else."""
    value = float(f"{value:.12g}")
    section = SECTIONS.get(path[0])
    entry = keys_of(section).get(path[1]) if section is not None and len(path) == 2 else None
    takes_integers_only = (
        entry is not None and entry.type.accepts(round(value)) and not entry.type.accepts(round(value) + 0.5)
    )
    return round(value) if takes_integers_only else value
