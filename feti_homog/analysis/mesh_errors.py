"""Estimated errors of the mesh in the entries of a stiffness and in the constants that follow from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import eigh

from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.result_records import MeshError
from feti_homog.homogenization import phase_laws
from feti_homog.homogenization.averaging import Response
from feti_homog.materials import bounds, spatial_constants
from feti_homog.runtime.records import plain
from feti_homog.typing import Float

if TYPE_CHECKING:
    from feti_homog.homogenization.mesh_error import EnergyErrors


def unit_errors(context: AnalysisContext, responses: Sequence[Response]) -> list[EnergyErrors]:
    """Return those of the responses to all unit loads, by problem; none if the case asks for none.  Collective."""
    if not context.case.output.mesh_error:
        return []
    from feti_homog.homogenization.mesh_error import energy_errors  # with the recovery of stresses

    found: list[EnergyErrors] = []
    first = 0
    for problem in context.loads.problems:
        own = responses[first : first + len(problem.loads)]
        touches = problem.interface.contact and any(response.debonded for response in own)
        found.append(energy_errors(problem.cell, own, touches))
        first += len(problem.loads)
    return found


def mesh_error(secants: Mapping[str, Any], of_plus: list[EnergyErrors], of_minus: list[EnergyErrors]) -> dict[str, Any]:
    """Return the entry `mesh_error` of `Result`, empty without errors.

    A constant f(C) errs by |f(C - signed) - f(C)| or, if that is more, |f(C - least) - f(C)|.

    Args:
        secants: `effective_stiffness` and what follows from it, as in `Result`.
        of_plus: errors of the unit loads.
        of_minus: those of minus the unit loads, where faces touch.
    """
    if not of_plus:
        return {}
    parts = {name: _secants(of_plus, name) for name in ("absolute", "signed", "least")}
    found = parts["absolute"]
    found |= {f"{name}_compression": entry for name, entry in _secants(of_minus, "absolute").items()}
    stiffness, heat = secants["effective_stiffness"], secants.get("thermal_stress")
    energy, constants = _of_energy(stiffness, parts), dict[str, float]()
    if "moduli" in secants or "constants" in secants:
        here = _constants(stiffness, heat)
        changed = [_constants(*_changed(stiffness, heat, parts[name])) for name in ("signed", "least")]
        apart = {name: np.max([np.abs(each[name] - value) for each in changed], axis=0) for name, value in here.items()}
        expansion = apart.pop("thermal_expansion", None)
        found |= {} if expansion is None else {"thermal_expansion": expansion}
        constants = {name: float(value) for name, value in apart.items()}
    return {"mesh_error": MeshError(**found, energy=energy, constants=constants)}


def state_error(context: AnalysisContext, responses: Sequence[Response]) -> tuple[float | None, list[Float]]:
    """Return the estimated relative error of the energy of one state, of all problems, and the share of the elements.

    None and nothing if the case asks for none. Collective.
    """
    if not context.case.output.mesh_error:
        return None, []
    from feti_homog.homogenization.mesh_error import energy_errors  # with the recovery of stresses

    pairs = zip(context.loads.problems, responses, strict=False)
    errors = [energy_errors(problem.cell, [response]) for problem, response in pairs]
    energy = sum(2 * response.stored for response in responses)
    size = max(abs(sum(each.signed.item() for each in errors)), abs(sum(each.least.item() for each in errors)))
    return (size / energy if energy > 0 else 0.0), [each.shares[:, 0] for each in errors]


def _secants(errors: Sequence[EnergyErrors], name: str) -> dict[str, Float]:
    """Return the errors of one kind as those of `effective_stiffness` and `thermal_stress`."""
    if not errors:
        return {}
    found = phase_laws.secants(*(getattr(each, name) for each in errors))
    return {"effective_stiffness": found.pop("stiffness")} | found


def _changed(stiffness: Float, heat: Float | None, errors: Mapping[str, Float]) -> tuple[Float, Float | None]:
    heat = None if heat is None else heat - errors["thermal_stress"]
    return stiffness - errors["effective_stiffness"], heat


def _constants(stiffness: Float, heat: Float | None) -> dict[str, Float]:
    """Return the constants of a stiffness by name, and the `thermal_expansion`."""
    if len(stiffness) == 3:
        return {name: np.asarray(value) for name, value in plain(bounds.engineering_moduli(stiffness)).items()}
    strains = None if heat is None else -np.linalg.solve(stiffness, heat)
    records = (
        spatial_constants.engineering_constants(stiffness),
        spatial_constants.transversely_isotropic_part(stiffness, strains),
        spatial_constants.transverse_moduli(stiffness),
    )
    named = {name: value for record in records for name, value in plain(record).items() if value is not None}
    found = {name: np.asarray(value) for name, value in named.items()}
    return found if strains is None else found | {"thermal_expansion": strains}


def _of_energy(stiffness: Float, parts: Mapping[str, Mapping[str, Float]]) -> float:
    """Return the largest relative error of the strain energy under any strain.

    Of a stiffness that is not positive definite under unit strains.
    """
    symmetric = (stiffness + stiffness.T) / 2
    if np.linalg.eigvalsh(symmetric)[0] <= 0:
        return float((np.diag(parts["absolute"]["effective_stiffness"]) / np.abs(np.diag(stiffness))).max())
    errors = (parts[name]["effective_stiffness"] for name in ("signed", "least"))
    return max(float(np.abs(eigh((each + each.T) / 2, symmetric, eigvals_only=True)).max()) for each in errors)
