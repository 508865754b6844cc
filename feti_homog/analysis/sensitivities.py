"""Derivatives of a stiffness and of the constants that follow from it, as an entry of result.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.result_records import Sensitivities
from feti_homog.homogenization import phase_laws
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.sensitivities import derivatives
from feti_homog.materials.derivatives import composite_constants, constant_changes


def sensitivities(
    context: AnalysisContext, document: Mapping[str, Any], responses: Sequence[Response]
) -> dict[str, Any]:
    """Return the entry `sensitivities` of `Result` from the responses to all unit loads.  Collective.

    Args:
        document: the entries `effective_stiffness` and, where there is one, `thermal_stress`.
    """
    cells, own = [problem.cell for problem in context.loads.problems], list[Sequence[Response]]()
    for problem in context.loads.problems:
        first = sum(map(len, own))
        own.append(responses[first : first + len(problem.loads)])
    found = derivatives(cells, own)
    C, thermal = document["effective_stiffness"], document.get("thermal_stress")
    values, columns = composite_constants(C, thermal), list[list[float]]()
    for each in found:
        changed = phase_laws.secants(*each.energies)
        columns.append([*constant_changes(C, thermal, changed["stiffness"], changed.get("thermal_stress")).values()])
    return {
        "sensitivities": Sensitivities(
            parameters=tuple(each.name for each in found),
            parameter_values=np.array([each.value for each in found]),
            constants=tuple(values),
            constant_values=np.array([*values.values()]),
            derivatives=np.array(columns).T,
        )
    }
