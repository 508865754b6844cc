"""The relations between the results of random cases, with the cases that have each and its tolerance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from differential import other_results, same_results
from differential.comparison import DIFFERENT
from differential.random_cases import Drawn
from differential.setting import Compared, Setting
from differential.twin import SolvedAnew
from feti_homog.errors import NotCarriedError
from feti_homog.verification.certificate import verify

STATES = 4  # of a result are solved anew


def certificate(setting: Setting) -> Compared:
    """`verify` of the files: the largest error of a law / its limit."""
    found = verify(setting.files)
    if not found.holds:
        return Compared(DIFFERENT, "; ".join(f.line() for f in found.findings if not f.holds))
    return Compared(0.0, "every law holds")


def solved_anew(setting: Setting) -> Compared:
    """States of the files against a solve by SciPy."""
    cell = SolvedAnew(setting.files)
    count = len(cell.file.get("state", ()))
    numbers = np.unique(np.linspace(0, count - 1, min(count, STATES)).round().astype(int)) if count else []
    found = [(off, f"{name} of state {number}") for number in map(int, numbers)
             for name, off in vars(cell.compare(number)).items()]  # fmt: skip
    cell.file.close()
    return Compared(*max(found, default=(0.0, "no state")))


Applies = Callable[[Drawn, Any], bool]


def _always(drawn: Drawn, base: Any) -> bool:
    return True


def _is_path(drawn: Drawn, base: Any) -> bool:
    return drawn.analysis == "path"


def _is_path_of_events(drawn: Drawn, base: Any) -> bool:
    return _is_path(drawn, base) and drawn.document["path"].get("method") != "increments"


def _has_interface(drawn: Drawn, base: Any) -> bool:
    return "interface" in drawn.document


def _is_linear(drawn: Drawn, base: Any) -> bool:
    # Meshes of the program are finer at the tips of all angles than at those of one.
    return drawn.analysis in ("stiffness", "load") or (drawn.analysis == "angle" and "file" in drawn.document["cell"])


def _is_envelope(drawn: Drawn, base: Any) -> bool:
    return drawn.analysis == "envelope"


@dataclass(frozen=True)
class Relation:
    """A relation, the cases that have it, and its tolerance: so many times that of the solver, at least `least`.

    Of those that cost a solve `weight` says how often they are drawn; the others, of weight 0, are always tried.
    """

    name: str
    check: Callable[[Setting], Compared]
    applies: Applies
    weight: float
    share: float
    least: float
    refusals: tuple[type[Exception], ...] = ()

    def tolerance(self, rtol: float) -> float:
        """The largest deviation that holds."""
        return max(self.share * rtol, self.least)


ALWAYS = (
    Relation("verify", certificate, _always, 0, 0.0, 0.0),
    Relation("solved anew by SciPy", solved_anew, _always, 0, 1e3, 1e-7),
)
RANKS = Relation("ranks", same_results.ranks, _always, 0, 1e3, 1e-7)
DRAWN = (
    Relation("unit of stress", same_results.unit_of_stress, _always, 1, 1e3, 1e-7),
    Relation("unit of length", same_results.unit_of_length, _always, 1, 1e3, 1e-7),
    Relation("order of input", same_results.order_of_input, _always, 1, 1e3, 1e-7),
    Relation("pieces", same_results.pieces, _always, 1, 1e3, 1e-7),
    Relation("influence columns", same_results.influence_columns, _has_interface, 1, 1e3, 1e-7),
    Relation("split way", other_results.split_way, _is_path_of_events, 2, 1e3, 1e-7),
    Relation("resume", same_results.resume, _is_path, 2, 1e3, 1e-7),
    Relation("stress back", other_results.stress_back, _is_linear, 1, 1e3, 1e-7, (NotCarriedError,)),
    Relation("onset", other_results.onset, _is_envelope, 2, 1e3, 1e-7),
)
