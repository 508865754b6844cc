"""Derivatives of a stiffness and of what follows from it, of a state, and what scatter of phases makes of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from feti_homog.analysis.cell_records import Sensitivities
from feti_homog.analysis.context import AnalysisContext
from feti_homog.homogenization import phase_laws
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.sensitivities import derivatives
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.loads import Load
from feti_homog.materials.constants import constants
from feti_homog.materials.derivatives import constant_changes
from feti_homog.materials.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES, THERMAL_STRESSES
from feti_homog.typing import Float


def sensitivities(
    context: AnalysisContext, document: Mapping[str, Any], responses: Sequence[Response], one_sided: bool
) -> dict[str, Any]:
    """Return the entry `sensitivities` of `Result` from the responses to all unit loads.  Collective.

    If faces touch without tension, each column is differentiated at the status of its own load.

    Args:
        document: the entries `effective_stiffness` and, where there is one, `thermal_stress`.
    """
    C, thermal = document["effective_stiffness"], document.get("thermal_stress")
    if one_sided:
        values = _entries(C, thermal)
        changes = _changes_with_contact(context, responses)
        columns = {key: [*_entries(*own).values()] for key, own in changes.items()}
    else:
        values = constants(C, thermal)
        found = derivatives(_cells(context), _by_problem(context, responses))
        columns = {
            (each.name, each.value): [*constant_changes(C, thermal, *_secants(each.energies)).values()]
            for each in found
        }
    return {"sensitivities": _record(values, columns, one_sided)}


def load_sensitivities(context: AnalysisContext, load: Load, responses: Sequence[Response]) -> dict[str, Any]:
    """Return the entry `sensitivities` of the state under one load, at its status.  Collective.

    With the stiffness A of the cell there, in which the load names of each component its strain or its stress, A x = s
    has the changes A dx = -dA x of strains that follow, and of what is stored d(x.s / 2).
    """
    fixed = _at_status(context, "load", responses, range(len(context.loads.problems)))
    A = block_diag(*(np.stack([r.stress for r in own], axis=1) for own in fixed))
    x = np.concatenate([response.strain for response in responses])
    free, s = load.by_stress, A @ x
    stress = dict(zip(SPATIAL_STRAINS, SPATIAL_STRESSES, strict=True))
    names = [name if is_free else stress.get(name) for name, is_free in zip(context.loads.names, free, strict=True)]
    shown = [k for k, name in enumerate(names) if name is not None]

    def entries(x: Float, s: Float, stored: float) -> dict[str, float]:
        return {str(names[k]): float((x if free[k] else s)[k]) for k in shown} | {"stored": stored}

    columns = dict[tuple[str, float], list[float]]()
    for each in derivatives(_cells(context), fixed):
        dA, dx = block_diag(*each.energies), np.zeros(len(x))
        dx[free] = np.linalg.lstsq(A[np.ix_(free, free)], -(dA @ x)[free], rcond=None)[0]
        ds = dA @ x + A @ dx
        columns[each.name, each.value] = [*entries(dx, ds, float(dx @ s + x @ ds) / 2).values()]
    is_one_sided = context.plane.interface.contact and responses[0].debonded > 0
    return {"sensitivities": _record(entries(x, s, float(x @ s) / 2), columns, is_one_sided)}


def _record(
    values: Mapping[str, float], columns: Mapping[tuple[str, float], Sequence[float]], at_fixed_status: bool
) -> Sensitivities:
    return Sensitivities(
        parameters=tuple(name for name, _ in columns),
        parameter_values=np.array([value for _, value in columns]),
        constants=tuple(values),
        constant_values=np.array([*values.values()]),
        derivatives=np.array([*columns.values()]).T.reshape(len(values), len(columns)),
        at_fixed_status=at_fixed_status,
    )


def _cells(context: AnalysisContext) -> list[TornCell]:
    return [problem.cell for problem in context.loads.problems]


def _by_problem(context: AnalysisContext, responses: Sequence[Response]) -> list[list[Response]]:
    """Return the responses to the unit loads of each problem."""
    rest = iter(responses)
    return [[next(rest) for _ in problem.loads] for problem in context.loads.problems]


def _secants(energies: Sequence[Float]) -> tuple[Float, Float | None]:
    changed = phase_laws.secants(*energies)
    return changed["stiffness"], changed.get("thermal_stress")


def _entries(C: Float, thermal: Float | None) -> dict[str, float]:
    """Return all entries of a secant stiffness, which is not symmetric, and the thermal stress by name."""
    found = {f"C{i + 1}{j + 1}": float(value) for (i, j), value in np.ndenumerate(C)}
    return found | dict(zip(THERMAL_STRESSES[:3], map(float, [] if thermal is None else thermal), strict=False))


def _changes_with_contact(
    context: AnalysisContext, responses: Sequence[Response]
) -> dict[tuple[str, float], tuple[Float, Float | None]]:
    """Return the changes of secants by constant, each column at the status of its load.  Collective."""
    plane, *axial = _by_problem(context, responses)
    kept = dict[tuple[str, float], list[Float]]()
    for k, (name, response) in enumerate(zip(context.plane.loads, plane, strict=True)):
        fixed = _at_status(context, name, [response], [0])
        for each in derivatives(_cells(context), [*fixed, *axial]):
            first, *others = each.energies
            columns = kept.setdefault((each.name, each.value), [np.zeros_like(first), *others])
            columns[0][:, k] = first[:, k]
    return {key: _secants(columns) for key, columns in kept.items()}


def _at_status(
    context: AnalysisContext, name: str, states: Sequence[Response], problems: Sequence[int]
) -> list[list[Response]]:
    """Return the responses to the unit loads of some problems at the status of one state, faces held.  Collective."""
    found, bonds = list[list[Response]](), states[0].state.bonds
    for problem in (context.loads.problems[k] for k in problems):
        count, zero = len(problem.loads), np.zeros(problem.cell.solver.rows)
        held = problem.interface.equilibria(np.eye(count), bonds, [zero] * count)
        own = [problem.response(state, 1.0) for state in held]
        # Held faces may pull and overlap: the laws of contact are those of the state itself.
        laws = ({law: error for law, error in r.checks.items() if not law.startswith("kkt_")} for r in own)
        own = [replace(r, checks=checks) for r, checks in zip(own, laws, strict=True)]
        for load, response in zip(problem.loads, own, strict=True):
            context.checks.record(f"{name}, derivatives, {load}", response)
        found.append(own)
    return found
