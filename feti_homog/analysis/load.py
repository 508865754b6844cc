"""`analysis.type = "load"`: one equilibrium under given strains, stresses and temperature; nothing breaks."""

from __future__ import annotations

from typing import Any

from feti_homog.analysis.context import IN_PLANE_LOADS, AnalysisContext


def run(context: AnalysisContext) -> dict[str, Any]:
    """`load`: the state under the load, with what is debonded from the start, open or in contact; `tips` of its arcs
    if only strains of the plane are there."""
    cell, (target,) = context.loaded_cell, context.case.targets
    status = context.status(None)
    state = cell.equilibrium(context.load(target), status, cell.no_multipliers())
    responses = context.responses(state, 1.0)
    for response, problem in zip(responses, ("load", "load, along the fibres"), strict=False):
        context.progress.say(context.record_checks(problem, response))
    context.record_state(responses, 1.0, "load", 0)
    point = context.loaded_point(responses) | {"free_motions": state.free_motions}
    others = dict(zip(cell.loads, cell.macroscopic(state.solutions).strain.tolist(), strict=True))
    only_in_plane = not any(strain for name, strain in others.items() if name not in IN_PLANE_LOADS)
    if context.case.interface is not None and only_in_plane:
        point["tips"] = context.tips(responses[:1], ["strain"])
    return {"load": point}
