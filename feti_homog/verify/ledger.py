"""What was found of each law: its largest violation, where it is, and whether rounding or the solver explains it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from feti_homog.typing import Float


@dataclass(frozen=True)
class Law:
    """What must hold, in words, and the largest relative violation that is none."""

    name: str
    words: str
    limit: float


@dataclass(frozen=True)
class Finding:
    """The largest violation of a law and where it is."""

    law: Law
    violation: float
    where: str

    @property
    def holds(self) -> bool:
        """Whether it is within the limit: NaN is not."""
        return self.violation <= self.law.limit

    def line(self) -> str:
        """The finding as a line of the certificate."""
        verdict = "holds" if self.holds else "BROKEN"
        where = f", at {self.where}" if self.where and self.violation > 0 else ""
        numbers = f"{self.violation:9.1e} of {self.law.limit:7.1e}"
        return f"{self.law.name:<13} {verdict:<7} {numbers}  {self.law.words}{where}"

    @property
    def document(self) -> Mapping[str, Any]:
        """The finding as it is written in JSON; a violation without bound is null."""
        violation = self.violation if np.isfinite(self.violation) else None
        law = {"law": self.law.name, "words": self.law.words, "limit": self.law.limit}
        return law | {"violation": violation, "where": self.where, "holds": self.holds}


class Ledger:
    """The largest violation of each law so far."""

    def __init__(self, laws: Iterable[Law]) -> None:
        self._laws = {law.name: law for law in laws}
        self._worst: dict[str, tuple[float, str]] = {}

    def record(self, name: str, violations: ArrayLike, where: Callable[[int], str] | str = "") -> None:
        """Take violations of a law, each relative to its scale; `where` names the place of the i-th.

        Laws of which nothing is recorded do not apply to the result.
        """
        values = np.atleast_1d(np.asarray(violations, float)).ravel()
        if not len(values):
            return
        values = np.where(np.isnan(values), np.inf, values)
        worst = int(np.argmax(values))
        value = float(values[worst])
        if name not in self._worst or value > self._worst[name][0]:
            self._worst[name] = value, where if isinstance(where, str) else where(worst)

    def findings(self) -> tuple[Finding, ...]:
        """Of every law that applies, in the order of the laws."""
        return tuple(Finding(law, *self._worst[name]) for name, law in self._laws.items() if name in self._worst)


def relative(errors: Float, scale: Float | float) -> Float:
    """errors / scale; where the scale is zero only an error of zero is none."""
    errors, scale = np.broadcast_arrays(np.abs(np.asarray(errors, float)), np.asarray(scale, float))
    absolute = np.where(errors == 0.0, 0.0, np.inf)
    return np.asarray(np.divide(errors, scale, out=absolute, where=scale > 0))
