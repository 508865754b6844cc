"""The registry of the report: how summary, pictures and pages show each analysis.

Modules of pictures find an analysis by its name: `response_curves.CURVES`, `deformed_panels.PANELS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from feti_homog.materials.voigt import plane_state_of
from feti_homog.report.text import point_tables
from feti_homog.report.text.constant_tables import sensitivities, table
from feti_homog.report.text.path_table import ROWS, path_table
from feti_homog.report.text.stiffness_tables import bounds, constants, moduli, stiffnesses, thermal
from feti_homog.report.text.table import Table
from feti_homog.results.landmarks import chosen_states
from feti_homog.typing import Document


def _evenly(document: Document, limit: int, count: int) -> list[int]:
    return sorted({round(k) for k in np.linspace(0, count - 1, min(limit, count))})


def _stiffness_tables(document: Document) -> list[Table]:
    """Return effective stiffness, constants and bounds."""
    last = [*point_tables.tip_table(document, document.get("tips")), *sensitivities(document)]
    if plane_state_of(document).is_spatial:
        first = [table(document)] if document.get("constants") else []
        return [*first, *stiffnesses(document), *thermal(document), *constants(document), *last]
    if document["case"].get("interface"):  # moduli and bounds are of bonded, linear composites
        return [*stiffnesses(document), *last]
    return [*stiffnesses(document), moduli(document), bounds(document), *last]


@dataclass(frozen=True)
class ReportedAnalysis:
    """An analysis; its entry in result.json has its name, except for the stiffness.

    Attributes:
        title: the name in words.
        tables: tables for a result with at most `limit` rows of points; None for the rows of the summary.
        is_curve: whether its states are points of a curve, shown side by side.
        is_followed: whether first and last states matter most.
        picture: picture name of a state, "" for the name of its unit load.
        is_load_given: whether states are under a load of the case, not under unit strains.
        states: numbers of at most `limit` states among the first `count`.
    """

    name: str
    title: str
    tables: Callable[[Document, int | None], list[Table]]
    is_curve: bool = False
    is_followed: bool = False
    picture: str = ""
    is_load_given: Callable[[Document], bool] = lambda document: False
    states: Callable[[Document, int, int], list[int]] = _evenly


STIFFNESS = ReportedAnalysis("stiffness", "effective stiffness", lambda document, limit: _stiffness_tables(document))
ANGLE = ReportedAnalysis(
    "angle",
    "debonding angle",
    lambda document, limit: [point_tables.angle_table(document, limit), *point_tables.angle_tip_table(document)],
    is_curve=True,
    is_load_given=lambda document: document.get("case", {}).get("angle", {}).get("strain") is not None,
)
PATH = ReportedAnalysis(
    "path",
    "load path",
    lambda document, limit: [path_table(document, limit or ROWS)],
    is_curve=True,
    is_followed=True,
    is_load_given=lambda document: True,
    states=chosen_states,
)
LOAD = ReportedAnalysis(
    "load",
    "equilibrium under a load",
    lambda document, limit: [
        point_tables.load_table(document),
        *point_tables.tip_table(document, document["load"].get("tips")),
        *sensitivities(document),
    ],
    picture="load",
    is_load_given=lambda document: True,
)
ENVELOPE = ReportedAnalysis(
    "envelope",
    "onset of debonding",
    lambda document, limit: [
        point_tables.envelope_table(document, limit or point_tables.ENVELOPE_ROWS),
        *_stiffness_tables(document),
    ],
)
ANALYSES = {entry.name: entry for entry in (ANGLE, PATH, LOAD, ENVELOPE, STIFFNESS)}


def reported(document: Document) -> ReportedAnalysis:
    """Return the analysis of a result.json; the stiffness for an empty one, which has states alone."""
    return next((analysis for name, analysis in ANALYSES.items() if document.get(name)), STIFFNESS)
