"""Points of a sweep: axis values combined to a grid, row by row, or sampled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from feti_homog.case import sections, toml_files
from feti_homog.schema import TableReader, keys, types, wording

STEP_TOLERANCE = 1e-9  # of a step: a rounding error that does not cost the last one
Assignment = dict[toml_files.TomlPath, Any]


@dataclass(frozen=True)
class Axis:
    """A key that varies: its values or, if it is sampled, the ends that they lie between."""

    path: toml_files.TomlPath
    values: tuple[Any, ...] = ()
    ends: tuple[float, float] = (0.0, 0.0)
    log: bool = False

    @classmethod
    def of(cls, path: toml_files.TomlPath, value: Any) -> Axis:
        """Return the axis of a valid list or range."""
        if isinstance(value, list):
            return cls(path, tuple(value))
        low, high, step, count = float(value["from"]), float(value["to"]), value.get("step"), value.get("count")
        axis = cls(path, ends=(low, high), log=value.get("scale") == "log")
        if step is not None:
            last = int((high - low) / step + STEP_TOLERANCE)
            return cls(path, tuple(_rounded(low + k * step, path) for k in range(last + 1)))
        return axis if count is None else cls(path, tuple(axis.at(np.linspace(0, 1, count))))

    def at(self, fractions: ArrayLike) -> list[Any]:
        """Return the values at fractions in [0, 1] of the way from the first end to the second."""
        low, high = np.log(self.ends) if self.log else self.ends
        values = low + (high - low) * np.asarray(fractions)
        return [_rounded(value, self.path) for value in (np.exp(values) if self.log else values).tolist()]


def read_points(table: Mapping[str, Any], faults: list[str]) -> tuple[list[Assignment], sections.SweepSection]:
    """Return the points of a table [sweep] as values by key, in their order, and its settings.

    A faulty table has no points, and adds a line for each fault to `faults`.
    """
    names = keys.keys_of(sections.SweepSection)
    reader = TableReader()
    given_settings = {name: value for name, value in table.items() if name in names}
    settings = reader.read(sections.SweepSection, given_settings, sections.SWEEP) or sections.SweepSection()
    axes, lines = list[Axis](), reader.faults
    varied = {name: value for name, value in table.items() if name not in names}
    for path, value in toml_files.leaves(varied, _is_value):
        if fault := _value_fault(path, value, "samples" in given_settings):
            lines.append(f"[{sections.SWEEP}] {wording.dotted_key(path)} = {wording.toml_value(value)}: {fault}")
        else:
            axes.append(Axis.of(path, value))
    lines += _faults_between(axes, settings)
    if not axes and not lines and settings.realisations is None:
        lines.append(
            f"[{sections.SWEEP}]: nothing varies; expected keys with {sections.AXIS_EXPECTED}, or realisations"
        )
    faults += lines
    return ([] if lines else _combined(axes, settings)), settings


def _faults_between(axes: Sequence[Axis], settings: sections.SweepSection) -> list[str]:
    """Return faults that no axis has alone: nothing to sample, a repeated key, unequal rows, too many cases."""
    faults, paths = list[str](), [axis.path for axis in axes]
    if settings.samples is not None and all(axis.values for axis in axes):
        samples = f"[{sections.SWEEP}] samples = {settings.samples}"
        faults.append(f"{samples}: no key is to be sampled; expected a range {{from, to}}")
    repeated = [path for path in dict.fromkeys(paths) if paths.count(path) > 1]
    faults += [f"[{sections.SWEEP}] {wording.dotted_key(path)}: given twice" for path in repeated]
    # All sampled keys are one axis.
    lengths = [(wording.dotted_key(axis.path), len(axis.values)) for axis in axes if axis.values]
    sampled = [wording.dotted_key(axis.path) for axis in axes if not axis.values]
    lengths += [(" and ".join(sampled), settings.samples)] if sampled and settings.samples else []
    counts = [length for _, length in lengths]
    if settings.mode == "zip" and len({*counts}) > 1:
        listed = ", ".join(f"{length} of {names}" for names, length in lengths)
        faults.append(f'[{sections.SWEEP}] mode = "zip": expected as many values of each key; there are {listed}')
    cases = (prod(counts) if settings.mode == "grid" else max(counts, default=1)) * (settings.realisations or 1)
    if cases > sections.MAX_CASES:
        faults.append(f"[{sections.SWEEP}]: {cases} cases; expected at most {sections.MAX_CASES}")
    return faults


def _combined(axes: Sequence[Axis], settings: sections.SweepSection) -> list[Assignment]:
    """Return the points on valid axes.

    In a grid the last key in the file runs fastest. Sampled keys are one axis, the last: a Latin hypercube, or
    independent samples.
    """
    lists = [[{axis.path: value} for value in axis.values] for axis in axes if axis.values]
    sampled = [axis for axis in axes if not axis.values]
    if sampled and settings.samples is not None:
        if settings.sampling == "latin":
            from scipy.stats import qmc  # which takes most of a second, and few sweeps need it

            fractions = qmc.LatinHypercube(len(sampled), seed=settings.seed).random(settings.samples)
        else:
            fractions = np.random.default_rng(settings.seed).random((settings.samples, len(sampled)))
        columns = [axis.at(column) for axis, column in zip(sampled, fractions.T, strict=True)]
        paths = [axis.path for axis in sampled]
        lists.append([dict(zip(paths, row, strict=True)) for row in zip(*columns, strict=True)])
    rows = product(*lists) if settings.mode == "grid" or not lists else zip(*lists, strict=True)
    return [{path: value for part in row for path, value in part.items()} for row in rows]


def _is_value(path: toml_files.TomlPath, table: Mapping[str, Any]) -> bool:
    """Return whether a table is a value: a range, or anything in an unknown section."""
    return path[0] not in sections.TOP_LEVEL or path[0] in ("name", sections.SWEEP) or _is_range(path, table)


def _is_range(path: toml_files.TomlPath, value: Any) -> bool:
    """Return whether the value of a key is meant as a range; a section, which may have a key "to", is none."""
    return len(path) > 1 and isinstance(value, dict) and bool(value.keys() & {"from", "to"})


def _value_fault(path: toml_files.TomlPath, value: Any, is_sampled: bool) -> str:
    """Return the fault of an axis, empty if there is none; sampled ranges need no step and no count."""
    if path[0] not in sections.TOP_LEVEL or path[0] in ("name", sections.SWEEP):
        names = [*keys.keys_of(sections.SweepSection), *sections.SECTIONS, "material", "petsc"]
        return f"unknown key; {wording.suggestion(path[0], names, {})}"
    if isinstance(value, list):
        return "" if value else "expected at least one value"
    if not _is_range(path, value):
        return f"expected {sections.AXIS_EXPECTED}"
    if unknown := [name for name in value if name not in sections.RANGE_KEYS]:
        return f"{unknown[0]}: unknown key; expected one of {', '.join(sections.RANGE_KEYS)}"
    low, high, scale = value.get("from"), value.get("to"), value.get("scale", "linear")
    if not (types.is_number(low) and types.is_number(high) and low < high):
        return f"expected numbers from < to{types.magnitudes_in_words([low, high])}"
    if scale not in ("linear", "log") or (scale == "log" and low <= 0):
        return 'expected scale = "linear" or "log", this from a number above 0'
    return _spacing_fault(value, is_sampled)


def _spacing_fault(table: Mapping[str, Any], is_sampled: bool) -> str:
    """Return the fault in step or count, of a range with valid ends."""
    step, count = table.get("step"), table.get("count")
    if step is not None and count is not None:
        return "step, count: exclude each other; give one"
    if step is not None:
        width = table["to"] - table["from"]
        if not types.is_number(step) or not 0 < step <= width or table.get("scale") == "log":
            return f"expected a step above 0 and at most to - from, linear{types.magnitudes_in_words(step)}"
        too_many = f"about {width / step:.6g} values; expected a step that makes at most {sections.MAX_CASES}"
        return too_many if width / step >= sections.MAX_CASES else ""
    if count is not None:
        is_valid = isinstance(count, int) and 2 <= count <= sections.MAX_CASES
        return "" if is_valid else f"expected a count from 2 to {sections.MAX_CASES}"
    return "" if is_sampled else f"expected {sections.AXIS_EXPECTED}"


def _rounded(value: float, path: toml_files.TomlPath) -> Any:
    """Return the number without the noise of its last digits; an integer where the key takes nothing else."""
    value = float(f"{value:.12g}")
    section = sections.SECTIONS.get(path[0])
    entry = keys.keys_of(section).get(path[1]) if section is not None and len(path) == 2 else None
    takes_integers_only = (
        entry is not None and entry.type.accepts(round(value)) and not entry.type.accepts(round(value) + 0.5)
    )
    return round(value) if takes_integers_only else value
