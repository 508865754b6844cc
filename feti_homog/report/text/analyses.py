"""Results of each analysis as summary, pictures and pages show them: the registry of the report.

Curves of an analysis are found by its name: `response_curves.CURVES`, `deformed_panels.PANELS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from feti_homog.materials.plane_state import plane_state_of
from feti_homog.report.text import constant_tables, point_tables, stiffness_tables
from feti_homog.report.text.path_table import path_table, peak_table
from feti_homog.report.text.table import Table
from feti_homog.results.landmarks import chosen, chosen_states
from feti_homog.typing import Document


def _evenly(document: Document, most: int, count: int) -> list[int]:
    return sorted({round(k) for k in np.linspace(0, count - 1, min(most, count))})


def _angle_lines(document: Document, label: str, toughness: str) -> list[list[str]]:
    points = document["angle"]
    tables = [point_tables.angle_table(points, label), *point_tables.angle_tip_table(points, toughness)]
    return [table.lines for table in tables]


def _load_lines(document: Document, label: str, toughness: str) -> list[list[str]]:
    tables = [
        *point_tables.tip_table(document["load"].get("tips"), toughness),
        *constant_tables.sensitivities(document),
    ]
    return [point_tables.load_lines(document, label), *(table.lines for table in tables)]


def _stiffness_lines(document: Document, label: str, toughness: str) -> list[list[str]]:
    """Return the effective stiffness with what follows from it; units in brackets."""
    blocks = [table.lines for table in stiffness_tables.stiffnesses(document, label)]
    tables = [*point_tables.tip_table(document.get("tips"), toughness), *constant_tables.sensitivities(document)]
    last = [table.lines for table in tables]
    if plane_state_of(document).is_spatial:
        thermal = [table.lines for table in stiffness_tables.thermal(document, label)]
        own = constant_tables.lines(document, label)
        return [own, *blocks, *thermal, *stiffness_tables.constants_lines(document, label), *last]
    if document["case"].get("interface"):  # moduli and bounds are of bonded, linear composites
        return [*blocks, *last]
    bounds = [table.lines for table in stiffness_tables.bounds(document, label)]
    moduli = stiffness_tables.moduli_lines(document, label)
    return [*blocks, moduli, *(bounds or [["Bounds: none of cells with voids"]]), *last]


def _stiffness_tables(document: Document, label: str, most: int) -> list[Table]:
    return [
        *constant_tables.table(document, label),
        *stiffness_tables.stiffnesses(document, label, "Effective stiffness under minus the unit strains"),
        *stiffness_tables.thermal(document, label),
        *stiffness_tables.constants(document, label),
        *stiffness_tables.moduli(document, document["case"].get("output", {}).get("stress_unit", "")),
        *stiffness_tables.bounds(document, label),
        *constant_tables.sensitivities(document),
    ]


@dataclass(frozen=True)
class ReportedAnalysis:
    """An analysis whose entry in result.json has its name; that of the stiffness has others.

    Attributes:
        title: the name in words.
        lines: blocks of the summary, of the units of stresses and of energy release rates in brackets, or empty.
        tables: the same for pages, of the unit of stresses, and with at most so many rows.
        is_curve: whether its states are points of a curve, shown side by side.
        is_followed: whether the first and the last of them matter most.
        picture: name of the picture of a state, "" for that of its unit load.
        is_load_given: whether states of a result are under a load of the case, not under unit strains.
        states: numbers of at most so many of the first states, whose count comes last.
    """

    name: str
    title: str
    lines: Callable[[Document, str, str], list[list[str]]]
    tables: Callable[[Document, str, int], list[Table]]
    is_curve: bool = False
    is_followed: bool = False
    picture: str = ""
    is_load_given: Callable[[Document], bool] = lambda document: False
    states: Callable[[Document, int, int], list[int]] = _evenly


STIFFNESS = ReportedAnalysis("stiffness", "effective stiffness", _stiffness_lines, _stiffness_tables)
ANGLE = ReportedAnalysis(
    "angle",
    "debonding angle",
    _angle_lines,
    lambda document, label, most: [
        point_tables.all_numbers("angle", document, label, range(min(len(document["angle"]), most)))
    ],
    is_curve=True,
    is_load_given=lambda document: document.get("case", {}).get("angle", {}).get("strain") is not None,
)
PATH = ReportedAnalysis(
    "path",
    "load path",
    lambda document, label, toughness: [path_table(document, label).lines],
    lambda document, label, most: [
        peak_table(document, label),
        point_tables.all_numbers("path", document, label, chosen(document, most)),
    ],
    is_curve=True,
    is_followed=True,
    is_load_given=lambda document: True,
    states=chosen_states,
)
LOAD = ReportedAnalysis(
    "load",
    "equilibrium under a load",
    _load_lines,
    lambda document, label, most: [point_tables.load_table(document, label), *constant_tables.sensitivities(document)],
    picture="load",
    is_load_given=lambda document: True,
)
ENVELOPE = ReportedAnalysis(
    "envelope",
    "onset of debonding",
    lambda document, label, toughness: [
        point_tables.envelope_lines(document, label),
        *_stiffness_lines(document, label, toughness),
    ],
    lambda document, label, most: [
        point_tables.envelope_table(document, label, most),
        *_stiffness_tables(document, label, most),
    ],
)
ANALYSES = {each.name: each for each in (ANGLE, PATH, LOAD, ENVELOPE, STIFFNESS)}


def reported(document: Document) -> ReportedAnalysis:
    """Return the analysis of a result.json; of an empty one, that of states without numbers, the stiffness."""
    return next((analysis for name, analysis in ANALYSES.items() if document.get(name)), STIFFNESS)
