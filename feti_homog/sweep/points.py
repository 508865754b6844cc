"""The points of a sweep: the values of its axes, combined to a grid, row by row, or sampled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from math import prod
from typing import Any

import numpy as np
from scipy.stats import qmc

from feti_homog.case.document import TomlPath
from feti_homog.case.sweep_section import AXIS_EXPECTED, MAX_CASES, SWEEP, SweepSection
from feti_homog.schema.keys import TableReader, keys_of
from feti_homog.schema.wording import dotted_key
from feti_homog.sweep.axes import Axis, AxisReader

Assignment = dict[TomlPath, Any]


def read_points(table: Mapping[str, Any], faults: list[str]) -> tuple[list[Assignment], SweepSection]:
    """The points of a table [sweep] as values by key, in their order, and its settings.

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
    """The keys of each axis in words, and how many values it has; sampled keys are one axis."""
    lengths = [(dotted_key(axis.path), len(axis.values)) for axis in axes if axis.values]
    sampled = [dotted_key(axis.path) for axis in axes if not axis.values]
    return [*lengths, (" and ".join(sampled), settings.samples)] if sampled and settings.samples else lengths


def combine(axes: Sequence[Axis], settings: SweepSection) -> list[Assignment]:
    """The points of axes without fault.

    Of a grid the last key in the file runs fastest; sampled keys are one axis of points, the last.
    """
    lists = [[{axis.path: value} for value in axis.values] for axis in axes if axis.values]
    lists += _samples([axis for axis in axes if not axis.values], settings)
    rows = product(*lists) if settings.mode == "grid" or not lists else zip(*lists, strict=True)
    return [_merged(row) for row in rows]


def _merged(parts: Sequence[Assignment]) -> Assignment:
    """One point of the values of its axes."""
    return {path: value for part in parts for path, value in part.items()}


def _samples(axes: Sequence[Axis], settings: SweepSection) -> list[list[Assignment]]:
    """The points in the box of the sampled axes, a Latin hypercube or independent; no list if there are no axes."""
    if not axes or settings.samples is None:
        return []
    if settings.sampling == "latin":
        shares = qmc.LatinHypercube(len(axes), seed=settings.seed).random(settings.samples)
    else:
        shares = np.random.default_rng(settings.seed).random((settings.samples, len(axes)))
    paths = [axis.path for axis in axes]
    columns = [axis.at(column) for axis, column in zip(axes, shares.T, strict=True)]
    return [[dict(zip(paths, row, strict=True)) for row in zip(*columns, strict=True)]]
