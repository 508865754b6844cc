"""Read the points of a sweep: values of the keys that vary, combined as a grid or row by row, or random samples."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from feti_homog.case import sections, toml_files
from feti_homog.schema import TableReader, keys, types, wording

DIGITS = 12  # of a computed value, so that rounding errors do not change the identity of a case
Assignment = dict[toml_files.TomlPath, Any]


@dataclass(frozen=True)
class Axis:
    """A key that varies: a list of `values` or, for random samples, the `ends` of a range, logarithmic if `log`."""

    path: toml_files.TomlPath
    values: tuple[Any, ...] = ()
    ends: tuple[float, float] = (0.0, 0.0)
    log: bool = False

    @classmethod
    def of(cls, path: toml_files.TomlPath, value: Any) -> Self:
        """Build the axis of the key at `path` from a checked list or range {from, to, ...}."""
        if isinstance(value, list):
            return cls(path, tuple(value))
        low, high, step, count = float(value["from"]), float(value["to"]), value.get("step"), value.get("count")
        axis = cls(path, ends=(low, high), log=value.get("scale") == "log")
        if step is not None:
            last = int(rounded((high - low) / step))
            return cls(path, tuple(_of_key(low + k * step, path) for k in range(last + 1)))
        return axis if count is None else cls(path, tuple(axis.at(np.linspace(0, 1, count))))

    def at(self, fractions: ArrayLike) -> list[Any]:
        """Return the key's values at `fractions` in [0, 1] of the range, on a logarithmic scale if `log`."""
        low, high = np.log(self.ends) if self.log else self.ends
        values = low + (high - low) * np.asarray(fractions)
        return [_of_key(value, self.path) for value in (np.exp(values) if self.log else values).tolist()]


def read_points(table: object, faults: list[str]) -> tuple[list[Assignment], sections.SweepSection]:
    """Read the points and settings of a table [sweep].

    A point maps each key that varies to a value.  In a grid the last key in the file varies fastest; all sampled keys
    together are the last axis.  Each fault adds a line to `faults`; a faulty table gives no points.
    """
    if not isinstance(table, dict):
        faults.append(f"{sections.SWEEP} = {wording.toml_value(table)}: expected a section [{sections.SWEEP}]")
        return [], sections.SweepSection()
    names = keys.keys_of(sections.SweepSection)
    reader = TableReader()
    given_settings = {name: value for name, value in table.items() if name in names}
    settings = reader.read(sections.SweepSection, given_settings, sections.SWEEP) or sections.SweepSection()
    axes, lines = list[Axis](), reader.faults
    varied = {name: value for name, value in table.items() if name not in names}
    for path, value in toml_files.leaves(varied, lambda path, value: _is_foreign(path) or _is_range(path, value)):
        if fault := _value_fault(path, value, "samples" in given_settings):
            lines.append(f"[{sections.SWEEP}] {wording.dotted_key(path)} = {wording.toml_value(value)}: {fault}")
        else:
            axes.append(Axis.of(path, value))
    listed, sampled = [axis for axis in axes if axis.values], [axis for axis in axes if not axis.values]
    lists = [(wording.dotted_key(axis.path), [{axis.path: value} for value in axis.values]) for axis in listed]
    if sampled and settings.samples is not None:
        names_sampled = " and ".join(wording.dotted_key(axis.path) for axis in sampled)
        lists.append((names_sampled, sampled_points(sampled, settings)))
    elif settings.samples is not None:
        samples = f"[{sections.SWEEP}] samples = {settings.samples}"
        lines.append(f"{samples}: no key is to be sampled; expected a range {{from, to}}")
    paths, counts = [axis.path for axis in axes], [len(rows) for _, rows in lists]
    repeated = [path for path in dict.fromkeys(paths) if paths.count(path) > 1]
    lines += [f"[{sections.SWEEP}] {wording.dotted_key(path)}: given twice" for path in repeated]
    if settings.mode == "zip" and len({*counts}) > 1:
        lengths = ", ".join(f"{len(rows)} of {name}" for name, rows in lists)
        lines.append(f'[{sections.SWEEP}] mode = "zip": expected as many values of each key; there are {lengths}')
    cases = (prod(counts) if settings.mode == "grid" else max(counts, default=1)) * (settings.realisations or 1)
    if cases > types.MOST_ROWS:
        lines.append(f"[{sections.SWEEP}]: {cases} cases; expected at most {types.MOST_ROWS}")
    if not axes and not lines and settings.realisations is None:
        lines += [f"[{sections.SWEEP}]: nothing varies; expected keys with {sections.AXIS_EXPECTED}, or realisations"]
    faults += lines
    if lines:
        return [], settings
    combine = product if settings.mode == "grid" or not lists else zip
    points = combine(*(rows for _, rows in lists))
    return [{path: value for part in point for path, value in part.items()} for point in points], settings


def sampled_points(axes: Sequence[Axis], settings: sections.SweepSection) -> list[Assignment]:
    """Draw points from the ranges of `axes`, by a Latin hypercube or independently; `settings` has count and seed."""
    count = settings.samples or 1
    if settings.sampling == "latin":
        from scipy.stats import qmc  # a slow import that few sweeps need

        fractions = qmc.LatinHypercube(len(axes), seed=settings.seed).random(count)
    else:
        fractions = np.random.default_rng(settings.seed).random((count, len(axes)))
    columns = [axis.at(column) for axis, column in zip(axes, fractions.T, strict=True)]
    return [dict(zip((axis.path for axis in axes), row, strict=True)) for row in zip(*columns, strict=True)]


def _is_foreign(path: toml_files.TomlPath) -> bool:
    """Return whether a path is outside the sections whose keys a sweep may vary."""
    return path[0] not in sections.TOP_LEVEL or path[0] in ("name", sections.SWEEP)


def _is_range(path: toml_files.TomlPath, value: Any) -> bool:
    """Return whether a value is a range rather than a section with a key "to"."""
    return len(path) > 1 and isinstance(value, dict) and bool(value.keys() & {"from", "to"})


def _value_fault(path: toml_files.TomlPath, value: Any, is_sampled: bool) -> str:
    """Return the fault of the value at `path` in [sweep], else "".  Ranges to sample need neither step nor count."""
    if _is_foreign(path):
        names = [*keys.keys_of(sections.SweepSection), *sections.SECTIONS, "material", "petsc"]
        names += [f"{name}.{path[0]}" for name, table in sections.SECTIONS.items() if path[0] in keys.keys_of(table)]
        return f"unknown key; {wording.suggestion(path[0], names, {})}"
    if isinstance(value, list):
        return "" if value else "expected at least one value"
    if not _is_range(path, value):
        return f"expected {sections.AXIS_EXPECTED}"
    if unknown := [name for name in value if name not in sections.RANGE_KEYS]:
        return f"{unknown[0]}: unknown key; expected one of {', '.join(sections.RANGE_KEYS)}"
    low, high, scale = value.get("from"), value.get("to"), value.get("scale", "linear")
    if not (types.is_number(low) and types.is_number(high) and low < high):
        return f"expected numbers from < to{types.hint([low, high])}"
    if scale not in ("linear", "log") or (scale == "log" and low <= 0):
        return 'expected scale = "linear", or "log" from a number above 0'
    step, count = value.get("step"), value.get("count")
    if step is not None and count is not None:
        return "step, count: exclude each other; give one"
    if step is not None:
        width = high - low
        if not types.is_number(step) or step <= 0 or rounded(width / step) < 1 or scale == "log":
            return f"expected a step above 0 and at most to - from, linear{types.hint(step)}"
        too_many = f"about {width / step:.6g} values; expected a step that makes at most {types.MOST_ROWS}"
        return too_many if width / step >= types.MOST_ROWS else ""
    if count is not None:
        is_valid = isinstance(count, int) and 2 <= count <= types.MOST_ROWS
        return "" if is_valid else f"expected a count from 2 to {types.MOST_ROWS}"
    return "" if is_sampled else f"expected {sections.AXIS_EXPECTED}"


def is_seed(name: str) -> bool:
    """Return whether an input, such as `interface.scatter.seed`, selects a realisation."""
    return name.endswith(".seed")


def rounded(value: float) -> float:
    """Round a number to DIGITS significant digits."""
    return float(f"{value:.{DIGITS}g}")


def _of_key(value: float, path: toml_files.TomlPath) -> Any:
    """Round a value to DIGITS significant digits, or to an integer if the key at `path` accepts only integers."""
    value = rounded(value)
    section = sections.SECTIONS.get(path[0])
    entry = keys.keys_of(section).get(path[1]) if section is not None and len(path) == 2 else None
    takes_integers_only = (
        entry is not None and entry.type.accepts(round(value)) and not entry.type.accepts(round(value) + 0.5)
    )
    return round(value) if takes_integers_only else value
