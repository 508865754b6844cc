"""Constants that follow from a linear cell's stiffness, with bounds and closed-form estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.analysis.cell_records import StiffnessBounds
from feti_homog.case.case import Case
from feti_homog.homogenization import phase_laws
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.materials import bounds, laws
from feti_homog.materials import constants as named_constants
from feti_homog.microstructure.phase_names import COATING
from feti_homog.typing import Float

# Relative difference of equal radii: fibres of users' meshes are fitted to nodes.
SAME_RADIUS = 1e-6


def constants(cell: TornCell, secants: Mapping[str, Any]) -> dict[str, Any]:
    """Return `Result` entries that follow from `effective_stiffness` and `thermal_stress`.  Collective.

    None where faces touch without tension: each column is a secant under its own load.  None in the plane with
    interfaces.
    """
    case, is_spatial = cell.case, len(cell.problems) > 1
    if "effective_stiffness_compression" in secants or (case.interfaces and not is_spatial):
        return {}
    entries = stiffness_constants(secants["effective_stiffness"], secants.get("thermal_stress"))
    fractions = cell.fractions()
    if cell.summary.voids:  # the lower bounds are zero
        return entries
    if is_spatial:
        is_debonded = cell.sum_over_ranks(int(cell.debonded(None).sum())) > 0
        return entries | ({} if is_debonded or len(fractions) == 1 else _comparisons(cell, fractions))
    phases = [laws.plane_stiffness(case.material_of(phase), case.analysis.plane) for phase in fractions]
    shares, isotropic = list(fractions.values()), all(map(bounds.is_isotropic, phases))
    hashin_shtrikman = bounds.hashin_shtrikman(shares, phases) if isotropic else None
    limits = StiffnessBounds(bounds.voigt(shares, phases), bounds.reuss(shares, phases), hashin_shtrikman)
    return entries | {"bounds": limits}


def stiffness_constants(stiffness: Float, thermal: Float | None) -> dict[str, Any]:
    """Return constants from a stiffness (3, 3) or (6, 6), with the thermal stress (6,), as `Result` entries."""
    if len(stiffness) == 3:
        return {"moduli": named_constants.engineering_moduli(stiffness)}
    compliance = np.linalg.inv(stiffness)
    strains = None if thermal is None else -compliance @ thermal
    entries = {
        "compliance": compliance,
        "constants": named_constants.engineering_constants(stiffness),
        "transversely_isotropic": named_constants.transversely_isotropic_part(stiffness, strains),
        "transverse_moduli": named_constants.transverse_moduli(stiffness),
    }
    return entries if strains is None else entries | {"thermal_expansion": strains}


def _comparisons(cell: TornCell, fractions: Mapping[str, float]) -> dict[str, Any]:
    """Return closed-form estimates for round fibres, and bounds for any rigidly bonded fibres.

    Estimates exist for fibres without coatings, held in the matrix by the same bonds, with springs of one radius;
    bounds for transversely isotropic phases.
    """
    from feti_homog.materials.bounds import Fibres, Springs, fibre_bounds
    from feti_homog.materials.estimates import estimates  # bonded cells in the plane have none

    summary, case, has_springs = cell.summary, cell.case, phase_laws.has_springs(cell.case)
    matrix, *fibre_phases = summary.phases
    radii = {phase: summary.radii[summary.constituent_phase == k] for k, phase in enumerate(summary.phases)}
    phases = {}
    for phase in fractions:
        material = case.material_of(phase)
        stiffness, expansion = laws.spatial_stiffness(material), laws.expansion(material)
        phases[phase] = named_constants.transversely_isotropic_part(stiffness, expansion)
    entries: dict[str, Any] = {}
    if _has_estimates(case, summary.phases, [radii[phase] for phase in fibre_phases], has_springs):
        fibres = []
        for phase in fibre_phases:
            springs = None
            if has_springs:
                ((normal, tangential),) = phase_laws.springs(case).stiffness
                ((axial,),) = phase_laws.axial_springs(case).stiffness
                springs = Springs(normal, tangential, axial, float(radii[phase][0]))
            fibres.append(Fibres(fractions[phase], phases[phase], springs))
        entries["estimates"] = estimates(phases[matrix], fibres)
    if not has_springs and all(map(named_constants.is_transversely_isotropic, phases.values())):
        entries["fibre_bounds"] = fibre_bounds(list(fractions.values()), list(phases.values()))
    return entries


def _has_estimates(case: Case, phases: Sequence[str], radii: Sequence[Float], has_springs: bool) -> bool:
    """Return whether estimates exist for fibre `radii` in each phase, NaN if not round."""
    if COATING in phases or any(interface.between is not None for interface in case.interfaces):
        return False
    return not any(np.isnan(r).any() or (has_springs and np.ptp(r) > SAME_RADIUS * r.max()) for r in radii)
