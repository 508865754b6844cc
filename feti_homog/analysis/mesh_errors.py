"""Estimated errors of the mesh in the entries of a stiffness and in the constants that follow from it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import eigh

from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.result_records import MeshError
from feti_homog.errors import NotCarriedError
from feti_homog.homogenization import phase_laws
from feti_homog.homogenization.averaging import Response
from feti_homog.materials import constants as named_constants
from feti_homog.system.runtime.records import plain
from feti_homog.typing import Float

if TYPE_CHECKING:
    from feti_homog.homogenization.mesh_error import EnergyErrors

Named = Mapping[str, Float]
# True errors of the energy / estimated ones, at the most.
OFF = 3.0
# Share of a bound by which rounding may leave a value outside.
ROUNDING = 1e-9


def unit_errors(context: AnalysisContext, responses: list[Response]) -> tuple[list[EnergyErrors], list[Response]]:
    """Return the errors of the responses to all unit loads, by problem, and the responses with elements' shares.

    No errors if the case asks for none, no shares if nobody does.  Collective.
    """
    if not context.case.output.mesh_error:
        return [], responses
    from feti_homog.homogenization.mesh_error import energy_errors  # with the recovery of stresses

    found: list[EnergyErrors] = []
    first, shared, keep = 0, list[Response](), context.recovers_again
    for problem in context.loads.problems:
        own = responses[first : first + len(problem.loads)]
        touches = problem.interface.contact and any(response.debonded for response in own)
        found.append(energy_errors(problem.cell, own, touches, keep))
        shared += [replace(response, shares=part) for response, part in zip(own, found[-1].shares.T, strict=True)]
        first += len(problem.loads)
    return found, shared if keep else responses


def mesh_error(
    context: AnalysisContext, secants: Mapping[str, Any], of_plus: list[EnergyErrors], of_minus: list[EnergyErrors]
) -> dict[str, Any]:
    """Return the entry `mesh_error` of `Result`, empty without errors.

    A constant f(C) errs by |f(C - signed) - f(C)| or, if that is more, |f(C - least) - f(C)|.  Notes where the error is
    more than the case asked for, and values outside their bounds, which are faults beyond any error of the mesh.

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
    constants, energy = dict[str, float](), _of_energy(stiffness, parts)
    if "moduli" in secants or "constants" in secants:
        here = _constants(stiffness, heat)
        changed = {name: _constants(*_changed(stiffness, heat, parts[name])) for name in ("signed", "least")}
        off = {part: {name: np.abs(each[name] - here[name]) for name in here} for part, each in changed.items()}
        errors = {name: np.maximum(off["signed"][name], off["least"][name]) for name in here}
        _note_bounds(context, secants, here, errors, energy)
        expansion = errors.pop("thermal_expansion", None)
        found |= {} if expansion is None else {"thermal_expansion": expansion}
        constants = {name: float(value) for name, value in errors.items()}
    note_accuracy(context, energy)
    return {"mesh_error": MeshError(**found, energy=energy, constants=constants)}


def note_accuracy(context: AnalysisContext, energy: float) -> None:
    """Note which mesh would do if the relative error of the energy is more than the case asks for.  Collective."""
    cell = context.case.cell
    if cell.accuracy is None or (energy := context.cell.comm.bcast(energy)) <= cell.accuracy:
        return
    finer = cell.refine + math.ceil(math.log(energy / cell.accuracy, 4**cell.order))
    words = f"[cell] accuracy = {cell.accuracy:g}: the estimated error of the strain energy is {energy:.1e}"
    context.notes.append(
        f"{words}; mesh_size = {cell.mesh_size:g}, refine = {finer} and order = {cell.order} in its place would do"
    )


def _note_bounds(
    context: AnalysisContext, secants: Mapping[str, Any], here: Named, errors: Named, energy: float
) -> None:
    """Note constants outside the bounds of their phases; report a fault beyond any possible error of the mesh.

    No constant errs relatively by more than `energy`, the largest relative error of the strain energy, of which the
    estimate counts OFF times.  Bounds apply to cells of their symmetry, and follow from the meshed shares of phases.
    """
    limits: dict[str, Sequence[float]] = {}
    if (known := secants.get("bounds")) is not None and known.hashin_shtrikman is not None:
        C, off = secants["effective_stiffness"], errors["bulk"]
        is_square = max(abs(C[0, 0] - C[1, 1]), *np.abs(C[:2, 2])) <= off
        is_isotropic = here["anisotropy"] <= errors["anisotropy"]
        limits |= {"bulk": known.hashin_shtrikman.bulk} if is_square else {}
        limits |= {"shear": known.hashin_shtrikman.shear} if is_isotropic else {}
    if secants.get("fibre_bounds") is not None and here["deviation"] <= errors["deviation"]:
        limits |= {name: pair for name, pair in plain(secants["fibre_bounds"]).items() if pair is not None}
    for name, (lower, upper) in limits.items():
        value, error = float(here[name]), float(errors[name])
        outside = max(lower - value, value - upper)
        if outside <= ROUNDING * abs(upper):
            continue
        words = f"{name} = {value:.6g} is outside its bounds, {lower:.6g} and {upper:.6g}, by {outside:.1e}"
        possible = OFF * max(error, energy * abs(value))
        if outside > possible:
            context.checks.faults.append(f"{words}, more than any error of the mesh, {possible:.1e}; result marked")
        else:
            context.notes.append(f"{words}; the estimated error of the mesh is {error:.1e}: refine")


def state_error(context: AnalysisContext, responses: Sequence[Response]) -> tuple[dict[str, float], list[Response]]:
    """Return `mesh_error`, the relative error of the energy of one state, and its responses with the elements' shares.

    No error if the case asks for none, no shares if nobody does.  Collective.
    """
    if not context.case.output.mesh_error:
        return {}, list(responses)
    from feti_homog.homogenization.mesh_error import energy_errors  # with the recovery of stresses

    pairs = zip(context.loads.problems, responses, strict=False)
    keep = context.recovers_again
    errors = [energy_errors(problem.cell, [response], keep=keep) for problem, response in pairs]
    energy = sum(2 * response.stored for response in responses)
    size = max(abs(sum(getattr(each, part).item() for each in errors)) for part in ("signed", "least"))
    shared = [replace(r, shares=each.shares[:, 0] if keep else None) for r, each in zip(responses, errors, strict=True)]
    return {"mesh_error": size / energy if energy > 0 else 0.0}, shared


def check_accuracy(context: AnalysisContext) -> None:
    """Note, of a case that asks for an accuracy, the error of the cell under the first load, before any bond breaks.

    Collective.
    """
    if context.case.cell.accuracy is None or not context.case.output.mesh_error:
        return
    cell, target = context.loads.interfaces, next(target for target in context.case.targets if any(target.values()))
    try:
        state = cell.equilibrium(context.loads.load(target), context.bonds(None), cell.no_multipliers())
    except NotCarriedError:
        return  # so will the path be, unless friction carries its loads
    error, _ = state_error(context, context.loads.responses(state, 1.0))
    note_accuracy(context, error["mesh_error"])


def energy_error(stiffness: Float, errors: list[EnergyErrors]) -> dict[str, float]:
    """Return `mesh_error` of a secant stiffness, the largest relative error of the strain energy, if there is one."""
    parts = {name: _secants(errors, name) for name in ("absolute", "signed", "least")}
    return {"mesh_error": _of_energy(stiffness, parts)} if errors else {}


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
        return {name: np.asarray(value) for name, value in plain(named_constants.engineering_moduli(stiffness)).items()}
    strains = None if heat is None else -np.linalg.solve(stiffness, heat)
    records = (
        named_constants.engineering_constants(stiffness),
        named_constants.transversely_isotropic_part(stiffness, strains),
        named_constants.transverse_moduli(stiffness),
    )
    named = {name: value for record in records for name, value in plain(record).items() if value is not None}
    found = {name: np.asarray(value) for name, value in named.items()}
    compliance = np.linalg.inv(stiffness)
    found |= {f"nu3{k + 1}": -compliance[2, k] / compliance[2, 2] for k in range(2)}  # nu12, nu13 of the material
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
