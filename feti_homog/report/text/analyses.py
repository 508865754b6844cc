"""Results of each analysis as summary, pictures and pages show them: the registry of the report.

Curves of an analysis are found by its name: `response_curves.CURVES`, `deformed_panels.PANELS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from feti_homog.materials.plane_state import plane_state_of
from feti_homog.report.text import point_tables
from feti_homog.report.text.constant_tables import sensitivities, table, uncertainty
from feti_homog.report.text.path_table import ROWS, path_table
from feti_homog.report.text.stiffness_tables import bounds, constants, moduli, stiffnesses, thermal
from feti_homog.report.text.table import Table
from feti_homog.results.landmarks import chosen_states
from feti_homog.typing import Document


def _evenly(document: Document, most: int, count: int) -> list[int]:
    return sorted({round(k) for k in np.linspace(0, count - 1, min(most, count))})


def _changes(document: Document) -> list[Table]:
    """Return the tables of sensitivities and of scatter, if the case asks for them."""
    return [*sensitivities(document), *uncertainty(document)]


def _stiffness_tables(document: Document) -> list[Table]:
    """Return the effective stiffness with all constants and limits that follow from it."""
    last = [*point_tables.tip_table(document, document.get("tips")), *_changes(document)]
    if plane_state_of(document).is_spatial:
        first = [table(document)] if document.get("constants") else []
        return [*first, *stiffnesses(document), *thermal(document), *constants(document), *last]
    if document["case"].get("interface"):  # moduli and bounds are of bonded, linear composites
        return [*stiffnesses(document), *last]
    return [*stiffnesses(document), moduli(document), bounds(document), *last]


@dataclass(frozen=True)
class ReportedAnalysis:
    """An analysis whose entry in result.json has its name; that of the stiffness has others.

    Attributes:
        title: the name in words.
        tables: its tables; of points at most so many rows, None for as many as the summary prints.
        is_curve: whether its states are points of a curve, shown side by side.
        is_followed: whether the first and the last of them matter most.
        picture: name of the picture of a state, "" for that of its unit load.
        is_load_given: whether states of a result are under a load of the case, not under unit strains.
        states: numbers of at most so many of the first states, whose count comes last.
    """

    name: str
    title: str
    tables: Callable[[Document, int | None], list[Table]]
    is_curve: bool = False
    is_followed: bool = False
    picture: str = ""
    is_load_given: Callable[[Document], bool] = lambda document: False
    states: Callable[[Document, int, int], list[int]] = _evenly


STIFFNESS = ReportedAnalysis("stiffness", "effective stiffness", lambda document, most: _stiffness_tables(document))
ANGLE = ReportedAnalysis(
    "angle",
    "debonding angle",
    lambda document, most: [point_tables.angle_table(document, most), *point_tables.angle_tip_table(document)],
    is_curve=True,
    is_load_given=lambda document: document.get("case", {}).get("angle", {}).get("strain") is not None,
)
PATH = ReportedAnalysis(
    "path",
    "load path",
    lambda document, most: [path_table(document, most or ROWS)],
    is_curve=True,
    is_followed=True,
    is_load_given=lambda document: True,
    states=chosen_states,
)
LOAD = ReportedAnalysis(
    "load",
    "equilibrium under a load",
    lambda document, most: [
        point_tables.load_table(document),
        *point_tables.tip_table(document, document["load"].get("tips")),
        *_changes(document),
    ],
    picture="load",
    is_load_given=lambda document: True,
)
ENVELOPE = ReportedAnalysis(
    "envelope",
    "onset of debonding",
    lambda document, most: [
        point_tables.envelope_table(document, most or point_tables.ENVELOPE_ROWS),
        *_stiffness_tables(document),
    ],
)
ANALYSES = {each.name: each for each in (ANGLE, PATH, LOAD, ENVELOPE, STIFFNESS)}


def reported(document: Document) -> ReportedAnalysis:
    """Return the analysis of a result.json; of an empty one, that of states without numbers, the stiffness."""
    return next((analysis for name, analysis in ANALYSES.items() if document.get(name)), STIFFNESS)
