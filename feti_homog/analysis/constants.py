"""Compute constants that follow from the stiffness of a linear cell, their bounds, estimates and mesh errors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import eigh

from feti_homog.analysis.cell_records import StiffnessBounds
from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.result_records import MeshErrors
from feti_homog.errors import NotCarriedError
from feti_homog.homogenization import averaging, phase_laws, unit_cell
from feti_homog.materials import engineering_constants, laws, phase_bounds
from feti_homog.microstructure import phase_names
from feti_homog.system.runtime import records
from feti_homog.typing import Float

if TYPE_CHECKING:
    from feti_homog.homogenization import mesh_estimate

Named = Mapping[str, Float]
PARTS = ("absolute", "signed", "least")
OFF = 3.0  # largest ratio of the true energy error to the estimate


def constants(cell: unit_cell.TornCell, secants: Mapping[str, Any]) -> dict[str, Any]:
    """Compute the `Result` entries that follow from stiffness and thermal stress in `secants`.  Collective.

    Returns {} for a plane cell with interfaces, and where faces touch: each stiffness column is then a secant under
    another load.  Cells with voids or debonded faces have no bounds and no estimates.
    """
    case, is_spatial = cell.case, len(cell.problems) > 1
    if "effective_stiffness_compression" in secants or (case.interfaces and not is_spatial):
        return {}
    entries = stiffness_constants(secants["effective_stiffness"], secants.get("thermal_stress"))
    fractions = cell.fractions()
    if cell.summary.voids:  # the lower bounds are zero
        return entries
    if is_spatial:
        is_debonded = cell.comm.allreduce(int(cell.debonded(None).sum())) > 0
        return entries if is_debonded or len(fractions) == 1 else entries | _comparisons(cell, fractions)
    phases = [laws.plane_stiffness(case.material_of(phase), case.analysis.plane) for phase in fractions]
    shares, isotropic = list(fractions.values()), all(map(phase_bounds.is_isotropic, phases))
    hashin_shtrikman = phase_bounds.hashin_shtrikman(shares, phases) if isotropic else None
    limits = StiffnessBounds(phase_bounds.voigt(shares, phases), phase_bounds.reuss(shares, phases), hashin_shtrikman)
    return entries | {"bounds": limits}


def stiffness_constants(stiffness: Float, thermal: Float | None) -> dict[str, Any]:
    """Compute the `Result` entries of a stiffness, (3, 3) or (6, 6), and a thermal stress, (6,) or None."""
    if len(stiffness) == 3:
        return {"moduli": engineering_constants.engineering_moduli(stiffness)}
    compliance = np.linalg.inv(stiffness)
    strains = None if thermal is None else -compliance @ thermal
    entries = {
        "compliance": compliance,
        "constants": engineering_constants.engineering_constants(stiffness),
        "transversely_isotropic": engineering_constants.transversely_isotropic_part(stiffness, strains),
        "transverse_moduli": engineering_constants.transverse_moduli(stiffness),
    }
    return entries if strains is None else entries | {"thermal_expansion": strains}


def _comparisons(cell: unit_cell.TornCell, fractions: Mapping[str, float]) -> dict[str, Any]:
    """Compute `estimates` and `fibre_bounds`, as `Result` entries, for a cell without debonded faces.

    Estimates exist where `fibre_radii` returns radii.  Bounds exist for rigid bonds between transversely isotropic
    phases.
    """
    from feti_homog.materials import estimates  # unused for bonded cells in the plane

    case, has_springs, phases = cell.case, phase_laws.has_springs(cell.case), {}
    matrix, *fibre_phases = cell.summary.phases
    for phase in fractions:
        material = case.material_of(phase)
        stiffness, expansion = laws.spatial_stiffness(material), laws.expansion(material)
        phases[phase] = engineering_constants.transversely_isotropic_part(stiffness, expansion)
    entries: dict[str, Any] = {}
    if (radii := fibre_radii(cell)) is not None:
        fibres = []
        for phase in fibre_phases:
            springs = None
            if has_springs:
                ((normal, tangential),) = phase_laws.springs(case).stiffness
                ((axial,),) = phase_laws.springs(case, cell.problems[1].solver.problem).stiffness
                springs = phase_bounds.Springs(normal, tangential, axial, radii[phase])
            fibres.append(phase_bounds.Fibres(fractions[phase], phases[phase], springs))
        entries["estimates"] = estimates.estimates(phases[matrix], fibres)
    if not has_springs and all(map(engineering_constants.is_transversely_isotropic, phases.values())):
        entries["fibre_bounds"] = phase_bounds.fibre_bounds(list(fractions.values()), list(phases.values()))
    return entries


def fibre_radii(cell: unit_cell.TornCell) -> dict[str, float] | None:
    """Return a radius for each fibre phase, or None if closed-form estimates do not apply.

    Estimates need round fibres without coatings, equal bonds for all phases and, with springs, equal radii in a phase.
    Without springs, a phase has the radius of its first fibre.
    """
    summary, case, has_springs = cell.summary, cell.case, phase_laws.has_springs(cell.case)
    radii = {phase: summary.radii[summary.constituent_phase == k] for k, phase in enumerate(summary.phases) if k}
    is_plain = phase_names.COATING not in summary.phases and all(bond.between is None for bond in case.interfaces)
    is_round = not any(np.isnan(radius).any() for radius in radii.values())  # the radii of other fibres are NaN
    # Circles are fitted to the nodes of users' meshes: equal radii differ by rounding.
    is_alike = not has_springs or all(np.allclose(radius, radius[0], atol=0.0) for radius in radii.values())
    if not (is_plain and is_round and is_alike):
        return None
    return {phase: float(radius[0]) for phase, radius in radii.items()}


def mesh_error(
    context: AnalysisContext,
    secants: Mapping[str, Any],
    of_plus: list[mesh_estimate.EnergyErrors],
    of_minus: list[mesh_estimate.EnergyErrors],
) -> dict[str, Any]:
    """Compute the `Result` entry `mesh_error`; {} without estimated errors.  Collective.

    A constant f(C) of the stiffness C has the error max(|f(C - signed) - f(C)|, |f(C - least) - f(C)|), with the
    estimated error `signed` of C, and the size `least` that remains if its parts cancel (`EnergyErrors`).  Notes an
    energy error above the accuracy of the case, and constants outside their bounds (`_note_bounds`).

    Args:
        secants: `effective_stiffness` and the entries that follow from it, as in `Result`.
        of_plus, of_minus: energy errors under plus and minus the unit loads; `of_minus` is [] unless faces touch.
    """
    if not of_plus:
        return {}
    parts = {name: _secants(of_plus, name) for name in PARTS}
    of_compression = {f"{name}_compression": entry for name, entry in _secants(of_minus, "absolute").items()}
    entries = parts["absolute"] | of_compression
    stiffness, heat = secants["effective_stiffness"], secants.get("thermal_stress")
    energy, of_constants = _energy(stiffness, parts), dict[str, float]()
    if "moduli" in secants or "constants" in secants:
        values, errors = _constants(stiffness, heat), dict[str, Any]()
        for changes in (parts["signed"], parts["least"]):
            changed_heat = None if heat is None else heat - changes["thermal_stress"]
            changed = _constants(stiffness - changes["effective_stiffness"], changed_heat)
            errors = {name: np.maximum(errors.get(name, 0.0), np.abs(changed[name] - values[name])) for name in values}
        _note_bounds(context, secants, values, errors, energy)
        if "thermal_expansion" in errors:
            entries["thermal_expansion"] = errors.pop("thermal_expansion")
        of_constants = {name: float(value) for name, value in errors.items()}
    note_accuracy(context, energy)
    return {"mesh_error": MeshErrors(**entries, energy=energy, constants=of_constants)}


def note_accuracy(context: AnalysisContext, energy: float) -> None:
    """Note which mesh suffices if `energy`, the relative energy error on rank 0, is above `accuracy`.  Collective."""
    cell = context.case.cell
    if cell.accuracy is None or (energy := context.cell.comm.bcast(energy)) <= cell.accuracy:
        return
    finer = cell.refine + math.ceil(math.log(energy / cell.accuracy, 4**cell.order))
    line = f"[cell] accuracy = {cell.accuracy:g}: the estimated error of the strain energy is {energy:.1e}"
    mesh = f"mesh_size = {cell.mesh_size:g}, refine = {finer} and order = {cell.order}"
    context.notes.append(f"{line}; {mesh} would be fine enough")


def _note_bounds(
    context: AnalysisContext, secants: Mapping[str, Any], values: Named, errors: Named, energy: float
) -> None:
    """Check constants of a stiffness against their bounds, by `note_outside`.

    A bound applies only if the cell has, within the mesh `errors`, the symmetry that the bound assumes.
    """
    limits: dict[str, Sequence[float]] = {}
    plane = secants.get("bounds")
    if plane is not None and plane.hashin_shtrikman is not None:
        C = secants["effective_stiffness"]
        is_square = max(abs(C[0, 0] - C[1, 1]), *np.abs(C[:2, 2])) <= errors["bulk"]
        is_isotropic = values["anisotropy"] <= errors["anisotropy"]
        if is_square:
            limits["bulk"] = plane.hashin_shtrikman.bulk
        if is_isotropic:
            limits["shear"] = plane.hashin_shtrikman.shear
    if secants.get("fibre_bounds") is not None and values["deviation"] <= errors["deviation"]:
        limits |= {name: pair for name, pair in records.plain(secants["fibre_bounds"]).items() if pair is not None}
    note_outside(context, limits, values, errors, energy)


def note_outside(
    context: AnalysisContext, limits: Mapping[str, Sequence[float]], values: Named, errors: Named, energy: float
) -> None:
    """Note each value outside its limits; record a fault if no mesh error explains the excess.

    The mesh explains an excess up to OFF times the estimated error of the value or, if larger, OFF `energy` |value|,
    with the relative energy error `energy`.  An excess within the tolerance of the checks may come from the solver and
    does not count.  The limits bound constants of periodic cells; cells with other boundaries are not checked, nor
    values after a failed solve or check.
    """
    if context.case.cell.boundary != "periodic" or context.checks.faults:
        return
    for name, (lower, upper) in limits.items():
        value, error = float(values[name]), float(errors[name])
        outside = max(lower - value, value - upper)
        if outside <= context.checks.tolerance("jump") * abs(value):
            continue
        line = f"{name} = {value:.6g} is outside its bounds, {lower:.6g} and {upper:.6g}, by {outside:.1e}"
        possible = OFF * max(error, energy * abs(value))
        if outside > possible:
            context.checks.faults.append(f"{line}, more than any error of the mesh, {possible:.1e}; result marked")
        else:
            context.notes.append(f"{line}; the estimated error of the mesh is {error:.1e}: refine")


def state_error(
    context: AnalysisContext, responses: Sequence[averaging.Response]
) -> tuple[dict[str, float], list[averaging.Response]]:
    """Estimate the relative mesh error of the stored energy under one load.  Collective.

    Returns {"mesh_error": error}, or {} if the case has `mesh_error = false`; and the responses (one for each problem)
    with element errors.
    """
    errors, estimated = context.response_errors([[response] for response in responses])
    if not errors:
        return {}, estimated
    energy = sum(2 * response.stored for response in responses)
    size = max(abs(sum(getattr(error, part).item() for error in errors)) for part in ("signed", "least"))
    return {"mesh_error": size / energy if energy > 0 else 0.0}, estimated


def check_accuracy(context: AnalysisContext) -> None:
    """Solve for the first nonzero load of a path; note a mesh error above the `accuracy` of the case.  Collective.

    Does nothing without `accuracy` or `mesh_error` in the case, and notes nothing if the cell does not carry the load.
    """
    if context.case.cell.accuracy is None or not context.case.output.mesh_error:
        return
    cell, target = context.loads.interfaces, next(target for target in context.case.targets if any(target.values()))
    try:
        state = cell.equilibrium(context.loads.load(target), context.bonds(None), cell.no_multipliers())
    except NotCarriedError:
        return  # the path will report the fault, unless friction carries the loads
    error, _ = state_error(context, context.loads.responses(state, 1.0))
    note_accuracy(context, error["mesh_error"])


def energy_error(stiffness: Float, errors: list[mesh_estimate.EnergyErrors]) -> dict[str, float]:
    """Return {"mesh_error": e}, with the largest relative energy error e under any strain; {} if `errors` is empty."""
    return {"mesh_error": _energy(stiffness, {name: _secants(errors, name) for name in PARTS})} if errors else {}


def _secants(errors: Sequence[mesh_estimate.EnergyErrors], name: str) -> dict[str, Float]:
    """Assemble the errors `name` (one of PARTS) of stiffness and thermal stress by `Result` entry; {} without any."""
    if not errors:
        return {}
    entries = phase_laws.secants(*(getattr(error, name) for error in errors))
    return {"effective_stiffness": entries.pop("stiffness")} | entries


def _constants(stiffness: Float, heat: Float | None) -> dict[str, Float]:
    """Compute constants of a stiffness by name; (6, 6) adds nu31, nu32 and, with a thermal stress, expansions (6,)."""
    entries = stiffness_constants(stiffness, heat)
    compliance = entries.pop("compliance", None)
    named: dict[str, Any] = {"thermal_expansion": entries.pop("thermal_expansion", None)}
    for record in entries.values():
        named |= records.plain(record)
    if compliance is not None:  # nu12 and nu13 in ply axes
        named |= {f"nu3{k + 1}": -compliance[2, k] / compliance[2, 2] for k in range(2)}
    return {name: np.asarray(value) for name, value in named.items() if value is not None}


def _energy(stiffness: Float, parts: Mapping[str, Mapping[str, Float]]) -> float:
    """Return the largest relative strain energy error under any strain.  `parts` maps each of PARTS to `_secants`.

    If the stiffness is not positive definite, returns the largest relative error under a unit strain.
    """
    symmetric = (stiffness + stiffness.T) / 2
    if np.linalg.eigvalsh(symmetric)[0] <= 0:
        return float((np.diag(parts["absolute"]["effective_stiffness"]) / np.abs(np.diag(stiffness))).max())
    errors = (parts[name]["effective_stiffness"] for name in ("signed", "least"))
    return max(float(np.abs(eigh((error + error.T) / 2, symmetric, eigvals_only=True)).max()) for error in errors)
