"""The relations between the results of random cases, with the cases that have each and its tolerance."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from differential import other_results, same_results
from differential.brute_force import by_brute_force, is_affordable
from differential.comparison import DIFFERENT
from differential.finer_meshes import accuracy, finer_mesh, quadrilateral_mesh
from differential.limit_loads import limit_load
from differential.other_files import card, mesh_format
from differential.random_cases import Drawn
from differential.setting import Compared, Setting
from differential.transforms import sections
from differential.twin import SolvedAnew
from feti_homog.errors import CaseError, NotCarriedError
from feti_homog.verify.certificate import verify

STATES = 4  # of a result are solved anew
# What the checks of a run demand: the solver's tolerance times the condition of a cell.  Rounding has less than LEAST.
SHARE, LEAST = 1e3, 1e-8


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


def _has_estimate(drawn: Drawn, base: Any) -> bool:
    return drawn.analysis in ("stiffness", "load", "path")


def _is_meshed(drawn: Drawn, base: Any) -> bool:
    # Accurate meshes of debonded arcs have many elements.
    arcs = any("debonded" in section for section in sections(drawn.document))
    return drawn.analysis != "path" and not arcs and "file" not in drawn.document["cell"]


def _has_file(drawn: Drawn, base: Any) -> bool:
    return "file" in drawn.document["cell"]


def _has_card(drawn: Drawn, base: Any) -> bool:
    # Of linear materials: faces in contact have another stiffness under compression.
    one = "effective_stiffness_compression" not in base
    return one and np.shape(base.get("effective_stiffness", ())) == (6, 6)


def _is_envelope(drawn: Drawn, base: Any) -> bool:
    return drawn.analysis == "envelope"


@dataclass(frozen=True)
class Relation:
    """A relation, the cases that have it, and how often it is drawn; one of weight 0 is always tried.

    `exact` ones have limits of their own; others hold to SHARE times the tolerance of the solver, at least LEAST.
    """

    name: str
    check: Callable[[Setting], Compared]
    applies: Applies = _always
    weight: float = 0.0
    exact: bool = False
    refusals: tuple[type[Exception], ...] = ()

    def tolerance(self, rtol: float) -> float:
        """Return the largest deviation that holds."""
        return 0.0 if self.exact else max(SHARE * rtol, LEAST)


ALWAYS = (Relation("verify", certificate, exact=True), Relation("solved anew by SciPy", solved_anew))
RANKS, STRESS_BACK = Relation("ranks", same_results.ranks), "stress back"
DRAWN = (
    Relation("unit of stress", same_results.unit_of_stress, weight=1),
    Relation("unit of length", same_results.unit_of_length, weight=1),
    Relation("order of input", same_results.order_of_input, weight=1),
    Relation("pieces", same_results.pieces, weight=1),
    Relation("influence columns", same_results.influence_columns, _has_interface, weight=1),
    Relation("split way", other_results.split_way, _is_path_of_events, weight=4),
    Relation("resume", same_results.resume, _is_path, weight=4),
    Relation("brute force", by_brute_force, is_affordable, weight=4),
    Relation(STRESS_BACK, other_results.stress_back, _is_linear, weight=2, refusals=(NotCarriedError,)),
    Relation("finer mesh", finer_mesh, _has_estimate, weight=2, exact=True),
    Relation("accuracy", accuracy, _is_meshed, weight=2, exact=True),
    Relation("quadrilaterals", quadrilateral_mesh, _is_linear, weight=1, exact=True),
    Relation("format of the mesh", mesh_format, _has_file, weight=6),
    Relation("card", card, _has_card, weight=6, refusals=(CaseError,)),
    Relation("limit load", limit_load, _is_path, weight=3),
    Relation("onset", other_results.onset, _is_envelope, weight=6),
)
