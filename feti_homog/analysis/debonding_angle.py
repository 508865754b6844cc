"""`analysis.type = "angle"`: the response against the debonding angle, Fig. 3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from feti_homog.analysis.context import AnalysisContext
from feti_homog.homogenization.averaging import Response, asymmetry
from feti_homog.typing import Float


def run(context: AnalysisContext, values: Sequence[float], strain: Float | None) -> dict[str, Any]:
    """`angle`, a list of points: under `strain` the stress, else the stiffness from the three unit cases.

    Each angle begins with the multipliers of the one before it.
    """
    unit = strain is None
    starts = context.zero_multipliers() if unit else context.zero_multipliers()[:1]
    points = []
    for number, value in enumerate(context.progress.bar(values, "angles")):
        status, label = context.status(value), f"{value:g} deg"
        point: dict[str, Any] = {"angle": value}
        responses: list[Response]
        if unit:
            columns, responses = context.unit_responses(f"{label} ", status, starts, 1.0)
            point |= columns
            debonded = responses[0].counts["open"] + responses[0].counts["closed"]
            if not (context.homogenization.interface.contact and debonded):
                context.check(label, {"symmetry": asymmetry(columns["stiffness"])})
            context.record_unit_states(responses, 1.0, f"{label} ", number)
        else:
            responses = context.homogenization.respond(np.array([strain]), status, starts)
            context.progress.say(context.record_checks(label, responses[0]))
            point |= {"strain": responses[0].strain, "stress": responses[0].stress}
            point |= {"stored": responses[0].stored, "stored_in_springs": responses[0].in_springs}
            context.record(responses[0], None, 1.0, label, number)
        starts = [r.state.solution.lam for r in responses]
        tips = context.tips(responses, context.unit_loads if unit else ("strain",))
        points.append(point | context.point(responses) | {"tips": tips})
    return {"angle": points}
