"""`analysis.type = "stiffness"`: L^ef, with debonding and contact the secants to plus and minus each unit strain."""

from __future__ import annotations

from typing import Any

from feti_homog.analysis.context import UNIT_CASES, Study
from feti_homog.homogenization.averaging import asymmetry


def run(study: Study) -> dict[str, Any]:
    """`effective_stiffness`, whose columns are the stresses under the unit strains; with contact between debonded
    faces also `effective_stiffness_compression`, its columns -Sigma(-E)."""
    status = study.status(None)
    nothing = [study.nothing()] * 3
    one_sided = study.homogenization.interface.contact and study.homogenization.counts(status)["open"] > 0
    L, responses = study.unit_responses("", status, nothing, 1.0)
    for name, response in zip(UNIT_CASES, responses, strict=True):
        study.record(response, 1.0, name)
    document: dict[str, Any] = {"effective_stiffness": L}
    if one_sided:
        minus, responses = study.unit_responses("", status, nothing, -1.0)
        for name, response in zip(UNIT_CASES, responses, strict=True):
            study.record(response, -1.0, f"-{name}")
        document["effective_stiffness_compression"] = minus
    else:
        study.check("L^ef", {"symmetry": asymmetry(L)})
    return document
