"""`analysis.type = "load"`: equilibrium under given strains, stresses and temperature, without breaks."""

from typing import Any

from feti_homog.analysis.constants import note_accuracy, state_error
from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.result_records import LoadPoint
from feti_homog.analysis.sensitivities import load_sensitivities
from feti_homog.analysis.tip_records import tip_rates
from feti_homog.materials import voigt


def run(context: AnalysisContext) -> dict[str, Any]:
    """Compute the `Result` entry `load`, the equilibrium with prescribed debonded faces.  Collective.

    In a case with interfaces the point has `tips`, empty without debonded arcs.  On request there are also
    `sensitivities`.  Raises NotCarriedError if the cell does not carry the stresses.
    """
    cell, (target,) = context.loads.interfaces, context.case.targets
    load = context.loads.load(target)
    state = cell.equilibrium(load, context.bonds(None), cell.no_multipliers())
    responses = context.loads.responses(state, 1.0)
    for response, problem in zip(responses, ("load", "load, along the fibres"), strict=False):
        context.progress.say(context.checks.record(problem, response))
    error, responses = state_error(context, responses)
    note_accuracy(context, max(error.values(), default=0.0))
    context.states.record({"load": responses}, 1.0, 0)
    point = context.loaded_point(responses) | error | {"free_motions": state.free_motions}
    if context.case.interface is not None:
        is_strain = not any(map(target.get, voigt.SPATIAL_STRESSES))
        point["tips"] = tip_rates(context, {"strain" if is_strain else "load": responses})
    rates = load_sensitivities(context, load, responses) if context.case.output.sensitivities else {}
    return {"load": LoadPoint(**point)} | rates
