"""`analysis.type = "stiffness"`: the effective stiffness; with contact, secants under unit loads of both signs."""

from typing import Any

from feti_homog.analysis.constants import constants, mesh_error
from feti_homog.analysis.context import AnalysisContext
from feti_homog.homogenization import averaging


def run(context: AnalysisContext) -> dict[str, Any]:
    """Compute the `Result` entry `effective_stiffness` and the constants that follow from it.  Collective.

    Contact between debonded faces adds `effective_stiffness_compression`, whose column j is -Sigma(-e_j) under minus
    the unit strain e_j; debonded arcs add `tips` under each load; a temperature among the loads adds `thermal_stress`
    and, with contact, `thermal_stress_compression`.  The case may also ask for `mesh_error` and `sensitivities`.
    """
    bonds, starts = context.bonds(None), context.loads.zero_multipliers()
    one_sided = context.plane.interface.contact and context.plane.counts(bonds.status)["open"] > 0
    columns, errors, responses = context.unit_states(bonds, starts)
    stiffness = columns.pop("stiffness")
    document: dict[str, Any] = {"effective_stiffness": stiffness} | columns
    under = dict(zip(context.loads.names, responses, strict=True))
    if one_sided:
        minus, errors_of_minus, under_minus = context.unit_states(bonds, starts, -1.0)
        document["effective_stiffness_compression"] = minus.pop("stiffness")
        document |= {f"{name}_compression": column for name, column in minus.items()}
        under |= {f"-{name}": response for name, response in zip(context.loads.names, under_minus, strict=True)}
    else:
        errors_of_minus = []
        context.checks.require("L^ef", {"symmetry": averaging.asymmetry(stiffness)})
    if context.case.interface is not None:
        from feti_homog.analysis.tip_records import tip_rates  # bonded cells have no tips

        document["tips"] = tip_rates(context, {load: [response] for load, response in under.items()})
    document |= constants(context.cell, document)
    if context.case.output.sensitivities:
        from feti_homog.analysis.sensitivities import sensitivities  # few runs need sensitivities

        document |= sensitivities(context, document, responses, one_sided)
    return document | mesh_error(context, document, errors, errors_of_minus)
