"""`analysis.type = "angle"`: the response as a function of the debonding angle, Fig. 3 of the paper."""

from typing import Any

import numpy as np

from feti_homog.analysis.constants import energy_error, note_accuracy, state_error
from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.result_records import AnglePoint
from feti_homog.analysis.tip_records import tip_rates
from feti_homog.case import load_sections
from feti_homog.homogenization import averaging


def run(context: AnalysisContext) -> dict[str, Any]:
    """Compute the `Result` entry `angle`, with a point for each debonding angle in the case.  Collective.

    A point has energy release rates at tips, and stress and energies under the strain of the case or, if the case gives
    no strain, the stiffness from unit loads.  A solve starts from the multipliers at the previous angle.
    """
    section = context.case.section
    assert isinstance(section, load_sections.Angle)
    by_unit_loads = section.strain is None
    loads = context.loads.names if by_unit_loads else ("strain",)
    starts = context.loads.zero_multipliers()[: len(loads)]
    points = []
    for number, value in enumerate(section.values):
        bonds, label = context.bonds(value), f"{value:g} deg"
        point: dict[str, Any] = {"angle": value}
        if by_unit_loads:
            columns, errors, responses = context.unit_states(bonds, starts, label=f"{label} ", point=number)
            point |= columns | energy_error(columns["stiffness"], errors)
            if not (context.plane.interface.contact and responses[0].debonded):
                context.checks.require(label, {"symmetry": averaging.asymmetry(columns["stiffness"])})
        else:
            responses = context.plane.respond(np.array([section.strain]), bonds, starts)
            context.progress.say(context.checks.record(label, responses[0]))
            error, responses = state_error(context, responses)
            point |= error | {"strain": responses[0].strain, "stress": responses[0].stress}
            point |= {"stored": responses[0].stored, "stored_in_springs": responses[0].in_springs}
            context.states.record({label: responses}, 1.0, number)
        starts = [r.state.solution.lam for r in responses]
        point["tips"] = tip_rates(context, {load: [r] for load, r in zip(loads, responses, strict=True)})
        points.append(AnglePoint(**point | context.point(responses)))
    note_accuracy(context, max(point.mesh_error or 0.0 for point in points))
    return {"angle": tuple(points)}
