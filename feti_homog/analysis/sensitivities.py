"""Derivatives of a stiffness and of the constants that follow from it, and what scatter of phases makes of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.analysis.cell_records import UncertainConstants
from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.result_records import Sensitivities
from feti_homog.case.case import Case
from feti_homog.errors import CaseError
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


def propagated(case: Case, document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entry `uncertainty` of `Result`: standard deviations of first order, and their shares.

    With the derivatives J of the constants by the uncertain ones, of covariance V, the variances are those of J V J^T;
    the share of a constant is J_k (V J^T)_k, so that shares of correlated constants may be negative.

    Raises:
        CaseError: the stiffness does not depend on an uncertain constant.
    """
    found: Sensitivities = document["sensitivities"]
    std = case.uncertainty.std
    idle = [name for name in std if name not in found.parameters]
    if idle:
        raise CaseError(*(f"[uncertainty] {name}: the stiffness does not depend on it" for name in idle))
    J = found.derivatives[:, [found.parameters.index(name) for name in std]]
    sizes = np.array([*std.values()])
    A = J * sizes  # changes of the constants by one standard deviation of each
    scale = np.abs(A).max(axis=1, initial=np.finfo(float).tiny)  # so that no square over- or underflows
    A = A / scale[:, None]
    parts = A * (A @ case.uncertainty.matrix())
    variance = np.maximum(parts.sum(axis=1), 0.0)
    shares = np.divide(parts, variance[:, None], out=np.zeros_like(parts), where=variance[:, None] > 0)
    own = UncertainConstants(
        parameters=tuple(std),
        parameter_std=sizes,
        constants=found.constants,
        std=scale * np.sqrt(variance),
        shares=shares,
    )
    return {"uncertainty": own}
