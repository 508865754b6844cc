"""`analysis.type = "stiffness"`: L^ef, with debonding and contact the secants to plus and minus each unit strain."""

from __future__ import annotations

from typing import Any

from feti_homog.analysis.context import UNIT_CASES, AnalysisContext
from feti_homog.homogenization.averaging import asymmetry


def run(context: AnalysisContext) -> dict[str, Any]:
    """`effective_stiffness`, whose columns are the stresses under the unit strains; with contact between debonded
    faces also `effective_stiffness_compression`, its columns -Sigma(-E); `tips` of debonded arcs under each of them."""
    status = context.status(None)
    starts = [context.zero_multipliers()] * 3
    one_sided = context.homogenization.interface.contact and context.homogenization.counts(status)["open"] > 0
    L, responses = context.unit_responses("", status, starts, 1.0)
    for name, response in zip(UNIT_CASES, responses, strict=True):
        context.record(response, 1.0, name, 0)
    document: dict[str, Any] = {"effective_stiffness": L}
    under, loads = list(responses), list(UNIT_CASES)
    if one_sided:
        minus, responses = context.unit_responses("", status, starts, -1.0)
        for name, response in zip(UNIT_CASES, responses, strict=True):
            context.record(response, -1.0, f"-{name}", 0)
        document["effective_stiffness_compression"] = minus
        under, loads = [*under, *responses], [*loads, *(f"-{name}" for name in UNIT_CASES)]
    else:
        context.check("L^ef", {"symmetry": asymmetry(L)})
    if context.homogenization.cell.case.interface is not None:
        document["tips"] = context.tips(under, loads)
    return document
