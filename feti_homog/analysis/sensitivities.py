"""Differentiate a stiffness, its constants, a conductivity or a loaded state with respect to case constants."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from feti_homog.analysis.cell_records import Sensitivities
from feti_homog.analysis.context import AnalysisContext
from feti_homog.homogenization import averaging, phase_laws, stiffness_derivatives
from feti_homog.interface import Load
from feti_homog.materials import engineering_constants, material_derivatives, voigt
from feti_homog.typing import Float

Constant = tuple[str, float]
"""Name and value of a constant of the case."""


def sensitivities(
    context: AnalysisContext, document: Mapping[str, Any], responses: Sequence[averaging.Response], one_sided: bool
) -> dict[str, Any]:
    """Compute the `Result` entry `sensitivities` of a stiffness or conductivity.  Collective.

    Args:
        document: the entry `effective_conductivity`; or `effective_stiffness` and, if a temperature is a load,
            `thermal_stress`.
        responses: the responses to all unit loads.
        one_sided: whether debonded faces touch without tension; then each column is differentiated at fixed faces.
    """
    conductivity, groups = document.get("effective_conductivity"), context.loads.by_problem(responses)
    columns = dict[Constant, list[float]]()
    if conductivity is not None:
        for change in stiffness_derivatives.derivatives(context.cell.problems, groups):
            columns[change.name, change.value] = change.energies[0].ravel().tolist()
        return _entry(_entries(conductivity, None, "k"), columns, False)
    C, thermal = document["effective_stiffness"], document.get("thermal_stress")
    if not one_sided:
        for change in stiffness_derivatives.derivatives(context.cell.problems, groups):
            changes = material_derivatives.constant_changes(C, thermal, *_secants(change.energies))
            columns[change.name, change.value] = [*changes.values()]
        return _entry(engineering_constants.constants(C, thermal), columns, False)
    plane, *axial = groups
    energies = dict[Constant, list[Float]]()
    for number, (name, response) in enumerate(zip(context.plane.loads, plane, strict=True)):
        fixed = _at_status(context, name, [response], [0])
        for change in stiffness_derivatives.derivatives(context.cell.problems, [*fixed, *axial]):
            in_plane, *along_fibres = change.energies
            matrices = energies.setdefault((change.name, change.value), [np.zeros_like(in_plane), *along_fibres])
            matrices[0][:, number] = in_plane[:, number]
    columns = {key: [*_entries(*_secants(matrices)).values()] for key, matrices in energies.items()}
    return _entry(_entries(C, thermal), columns, True)


def load_sensitivities(context: AnalysisContext, load: Load, responses: Sequence[averaging.Response]) -> dict[str, Any]:
    """Compute the `Result` entry `sensitivities` of the state under one load.  Collective.

    The faces stay fixed as in the state.  With macroscopic strains x, stresses s and the cell stiffness A for these
    faces, A x = s; the load prescribes x or s in each component.  The free strains follow from A dx = -dA x; the stored
    energy changes by d(x.s / 2).
    """
    fixed = _at_status(context, "load", responses, range(len(context.loads.problems)))
    A = block_diag(*(np.stack([r.stress for r in group], axis=1) for group in fixed))
    x = np.concatenate([response.strain for response in responses])
    free, s = load.by_stress, A @ x
    stress = dict(zip(voigt.SPATIAL_STRAINS, voigt.SPATIAL_STRESSES, strict=True))
    names = [name if is_free else stress.get(name) for name, is_free in zip(context.loads.names, free, strict=True)]

    def entries(x: Float, s: Float, stored: float) -> dict[str, float]:
        pairs = zip(names, np.where(free, x, s).tolist(), strict=True)
        return {name: value for name, value in pairs if name is not None} | {"stored": stored}

    columns = dict[Constant, list[float]]()
    for change in stiffness_derivatives.derivatives(context.cell.problems, fixed):
        dA, dx = block_diag(*change.energies), np.zeros(len(x))
        dx[free] = np.linalg.lstsq(A[np.ix_(free, free)], -(dA @ x)[free], rcond=None)[0]
        ds = dA @ x + A @ dx
        columns[change.name, change.value] = [*entries(dx, ds, float(dx @ s + x @ ds) / 2).values()]
    is_one_sided = context.plane.interface.contact and responses[0].debonded > 0
    return _entry(entries(x, s, float(x @ s) / 2), columns, is_one_sided)


def _entry(values: Mapping[str, float], columns: Mapping[Constant, Sequence[float]], is_fixed: bool) -> dict[str, Any]:
    """Build {"sensitivities": record} from values by name and, for each parameter, a column of their derivatives."""
    matrix = np.array([*columns.values()]).T
    record = Sensitivities(
        parameters=tuple(name for name, _ in columns),
        parameter_values=np.array([value for _, value in columns]),
        constants=tuple(values),
        constant_values=np.array([*values.values()]),
        derivatives=matrix.reshape(len(values), len(columns)),
        at_fixed_status=is_fixed,
    )
    return {"sensitivities": record}


def _secants(energies: Sequence[Float]) -> tuple[Float, Float | None]:
    """Assemble derivatives of stiffness and thermal stress (None without temperature) from `Derivative.energies`."""
    changed = phase_laws.secants(*energies)
    return changed["stiffness"], changed.get("thermal_stress")


def _entries(C: Float, thermal: Float | None, symbol: str = "C") -> dict[str, float]:
    """Name the entries of a matrix `C`, as in C11 for `symbol` "C", and the normal thermal stresses, if any."""
    entries = {f"{symbol}{i + 1}{j + 1}": float(value) for (i, j), value in np.ndenumerate(C)}
    normal = {} if thermal is None else dict(zip(voigt.THERMAL_STRESSES[:3], map(float, thermal[:3]), strict=True))
    return entries | normal


def _at_status(
    context: AnalysisContext, name: str, states: Sequence[averaging.Response], problems: Sequence[int]
) -> list[list[averaging.Response]]:
    """Solve for unit loads with faces fixed as in a loaded state; return the responses by problem.  Collective.

    `states` are the responses of the state `name`, `problems` the indices of the problems to solve.  Records the
    checks, except contact.
    """
    groups, bonds = list[list[averaging.Response]](), states[0].state.bonds
    for number in problems:
        problem, fixed = context.loads.problems[number], list[averaging.Response]()
        count, zero = len(problem.loads), np.zeros(problem.cell.solver.rows)
        equilibria = problem.interface.equilibria(np.eye(count), bonds, [zero] * count)
        for load, state in zip(problem.loads, equilibria, strict=True):
            response = problem.response(state, 1.0)
            # Fixed faces may pull and overlap; the laws of contact are checked for the state itself.
            checks = {law: error for law, error in response.checks.items() if not law.startswith("kkt_")}
            fixed.append(replace(response, checks=checks))
            context.checks.record(f"{name}, derivatives, {load}", fixed[-1])
        groups.append(fixed)
    return groups
