"""Results of each analysis as pictures and pages show them; the registry that the floors of the report share.

The parts of an analysis are found by its name: `summary.ANSWERS`, `tables.ANSWERS`, `response_curves.CURVES`,
`deformed_panels.PANELS`, `curves.FIGURES`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.results.kept_points import chosen_states

Document = Mapping[str, Any]


def _evenly(document: Document, most: int, count: int) -> list[int]:
    return sorted({round(k) for k in np.linspace(0, count - 1, min(most, count))})


def _never(document: Document) -> bool:
    return False


def _always(document: Document) -> bool:
    return True


def _under_a_strain(document: Document) -> bool:
    return document.get("case", {}).get("angle", {}).get("strain") is not None


@dataclass(frozen=True)
class ReportedAnalysis:
    """An analysis whose entry in result.json has its name; that of the stiffness has others.

    Attributes:
        title: the name in words.
        is_curve: whether its states are points of a curve, shown side by side.
        is_followed: whether the first and the last of them say most.
        picture: name of the picture of a state, "" for that of its unit load.
        is_load_given: whether states of a result are under a load of the case, not under unit strains.
        states: numbers of at most so many of the first states, whose count comes last.
    """

    name: str
    title: str
    is_curve: bool = False
    is_followed: bool = False
    picture: str = ""
    is_load_given: Callable[[Document], bool] = _never
    states: Callable[[Document, int, int], list[int]] = _evenly


STIFFNESS = ReportedAnalysis("stiffness", "effective stiffness")
ANALYSES = {
    each.name: each
    for each in (
        ReportedAnalysis("angle", "debonding angle", is_curve=True, is_load_given=_under_a_strain),
        ReportedAnalysis(
            "path", "load path", is_curve=True, is_followed=True, is_load_given=_always, states=chosen_states
        ),
        ReportedAnalysis("load", "equilibrium under a load", picture="load", is_load_given=_always),
        ReportedAnalysis("envelope", "onset of debonding"),
        STIFFNESS,
    )
}


def reported(document: Document) -> ReportedAnalysis:
    """The analysis of a result.json; of an empty one, that of states without numbers, the stiffness."""
    return next((analysis for name, analysis in ANALYSES.items() if document.get(name)), STIFFNESS)
