"""The table [sweep]: which keys vary, over which values, and how these are combined."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import qmc

from feti_homog.config.case import SWEEP, TOP_LEVEL
from feti_homog.config.schema import choice, integer, is_real, key, keys_of, named, read, shown, suggestion
from feti_homog.config.sections import SECTIONS

Path = tuple[str, ...]
Assignment = dict[Path, Any]

RANGE = ("from", "to", "step", "count", "scale")
EXPECTED = "a list of values, or a range {from, to} with step, with count, or with samples in [sweep]"
MOST = 100_000  # cases of a sweep


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How values are combined, how many samples and realisations there are; `seed` is that of the samples."""

    mode: str = key(choice("grid", "zip"), default="grid")
    samples: int | None = key(integer(least=1, most=MOST), default=None)
    sampling: str = key(choice("latin", "random"), default="latin")
    seed: int = key(integer(least=0), default=0)
    realisations: int | None = key(integer(least=1, most=MOST), default=None)


@dataclass(frozen=True)
class Axis:
    """A key that varies: its values or, to be sampled, the ends that they lie between."""

    path: Path
    values: tuple[Any, ...] = ()
    ends: tuple[float, float] = (0.0, 0.0)
    log: bool = False

    def at(self, shares: ArrayLike) -> list[Any]:
        """The values at shares in [0, 1] of the way from the first to the second end."""
        low, high = np.log(self.ends) if self.log else self.ends
        found = low + (high - low) * np.asarray(shares)
        return [_plain(value, self.path) for value in (np.exp(found) if self.log else found).tolist()]


@dataclass
class Reader:
    """Reads the axes of a table, nested by section, and gathers what is wrong with them."""

    faults: list[str]
    sampled: bool
    axes: list[Axis] = field(default_factory=list)

    def read(self, table: Mapping[str, Any], above: Path = ()) -> None:
        for name, value in table.items():
            path = (*above, *name.split("."))
            if (not above and path[0] not in TOP_LEVEL) or path[0] in ("name", SWEEP):
                known = [*keys_of(Settings), *SECTIONS, "material", "petsc"]
                self._complain(path, value, f"unknown key; {suggestion(path[0], known)}")
            elif isinstance(value, list):
                self._list(path, value)
            elif isinstance(value, dict) and value.keys() & {"from", "to"}:
                self._range(path, value)
            elif isinstance(value, dict) and value:
                self.read(value, path)
            else:
                self._complain(path, value, f"expected {EXPECTED}")

    def _complain(self, path: Path, value: Any, words: str) -> None:
        self.faults.append(f"[{SWEEP}] {dotted(path)} = {shown(value)}: {words}")

    def _list(self, path: Path, values: list[Any]) -> None:
        if values:
            self.axes.append(Axis(path, tuple(values)))
        else:
            self._complain(path, values, "expected at least one value")

    def _range(self, path: Path, table: Mapping[str, Any]) -> None:
        unknown = [name for name in table if name not in RANGE]
        if unknown:
            return self._complain(path, table, f"{unknown[0]}: unknown key; known here: {', '.join(RANGE)}")
        low, high, scale = table.get("from"), table.get("to"), table.get("scale", "linear")
        if not (is_real(low) and is_real(high) and low < high):  # type: ignore[operator]
            return self._complain(path, table, "expected numbers from < to")
        if scale not in ("linear", "log") or (scale == "log" and low <= 0):  # type: ignore[operator]
            return self._complain(path, table, 'expected scale = "linear" or "log", this from a number above 0')
        axis = Axis(path, ends=(float(low), float(high)), log=scale == "log")  # type: ignore[arg-type]
        step, count = table.get("step"), table.get("count")
        if step is not None and count is not None:
            return self._complain(path, table, "step, count: exclude each other; give one")
        if step is not None:
            if not is_real(step) or not 0 < step <= high - low or axis.log:  # type: ignore[operator]
                return self._complain(path, table, "expected a step above 0 and at most to - from, linear")
            axis = Axis(path, tuple(_plain(value, path) for value in _steps(*axis.ends, step)))
        elif count is not None:
            if not (isinstance(count, int) and 2 <= count <= MOST):
                return self._complain(path, table, f"expected a count from 2 to {MOST}")
            axis = Axis(path, tuple(axis.at(np.linspace(0, 1, count))))
        elif not self.sampled:
            return self._complain(path, table, f"expected {EXPECTED}")
        self.axes.append(axis)


def assignments(table: Mapping[str, Any], faults: list[str]) -> tuple[list[Assignment], Settings]:
    """The points of a sweep as values by key, in their order, and the settings; nothing if there are faults.

    Of a grid the last key in the file runs fastest; sampled keys are one axis of points.
    """
    own = {name: value for name, value in table.items() if name in keys_of(Settings)}
    settings = read(Settings, own, SWEEP, faults) or Settings()
    reader = Reader(faults, settings.samples is not None or "samples" in own)
    reader.read({name: value for name, value in table.items() if name not in own})
    lists = [[{axis.path: value} for value in axis.values] for axis in reader.axes if axis.values]
    sampled = [axis for axis in reader.axes if not axis.values]
    if settings.samples is not None and not sampled:
        faults.append(f"[{SWEEP}] samples = {settings.samples}: no key is to be sampled; expected a range {{from, to}}")
    elif sampled and settings.samples is not None:
        lists.append(_samples(sampled, settings, settings.samples))
    paths = [axis.path for axis in reader.axes]
    faults += [f"[{SWEEP}] {dotted(path)}: given twice" for path in dict.fromkeys(paths) if paths.count(path) > 1]
    if not reader.axes and not faults and settings.realisations is None:
        faults.append(f"[{SWEEP}]: nothing varies; expected keys with {EXPECTED}, or realisations")
    lengths = [len(values) for values in lists]
    if settings.mode == "zip" and len(set(lengths)) > 1:
        faults.append(f'[{SWEEP}] mode = "zip": expected as many values of each key; there are {_counted(lists)}')
    total = int(np.prod(lengths)) if settings.mode == "grid" else max(lengths, default=1)
    if total * (settings.realisations or 1) > MOST:
        faults.append(f"[{SWEEP}]: {total * (settings.realisations or 1)} cases; expected at most {MOST}")
    if faults:
        return [], settings
    rows = product(*lists) if settings.mode == "grid" or not lists else zip(*lists, strict=True)
    return [{path: value for part in row for path, value in part.items()} for row in rows], settings


def dotted(path: Path) -> str:
    return ".".join(map(named, path))


def _samples(axes: Sequence[Axis], settings: Settings, count: int) -> list[Assignment]:
    """So many points in the box of the axes: a Latin hypercube or independent."""
    if settings.sampling == "latin":
        shares = qmc.LatinHypercube(len(axes), seed=settings.seed).random(count)
    else:
        shares = np.random.default_rng(settings.seed).random((count, len(axes)))
    columns = [axis.at(column) for axis, column in zip(axes, shares.T, strict=True)]
    return [{axis.path: v for axis, v in zip(axes, row, strict=True)} for row in zip(*columns, strict=True)]


def _steps(low: float, high: float, step: float) -> list[float]:
    """low, low + step, ... up to high, which a rounding error does not leave out."""
    return [low + k * step for k in range(int((high - low) / step + 1e-9) + 1)]


def _plain(value: float, path: Path) -> Any:
    """The number without the noise of its last digits; an integer where the key takes nothing else."""
    value = float(f"{value:.12g}")
    section = SECTIONS.get(path[0])
    entry = keys_of(section).get(path[1]) if section is not None and len(path) == 2 else None
    whole = entry is not None and entry.kind.accepts(round(value)) and not entry.kind.accepts(round(value) + 0.5)
    return round(value) if whole else value


def _counted(lists: Sequence[Sequence[Assignment]]) -> str:
    return ", ".join(f"{len(values)} of {' and '.join(map(dotted, values[0]))}" for values in lists)
