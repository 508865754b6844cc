"""What follows from a stiffness in space: constants by their usual names, and what closed estimates say of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from feti_homog.config.materials import expansion, spatial_stiffness
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.mechanics.estimates.constituents import Fibres, Springs
from feti_homog.mechanics.estimates.fibre_bounds import fibre_bounds
from feti_homog.mechanics.estimates.methods import estimates
from feti_homog.mechanics.spatial_constants import (
    TransverselyIsotropic,
    engineering_constants,
    is_transversely_isotropic,
    transversely_isotropic_part,
)


def constants(cell: TornCell, analysis: Mapping[str, Any], fractions: Mapping[str, float]) -> dict[str, Any]:
    """The keys of result.json that follow from `effective_stiffness` and `thermal_stress`.  Collective.

    Where faces touch without tension the stiffness is a secant that need not be symmetric, and has its inverse alone.
    Estimates and bounds are of cells without debonding.
    """
    stiffness, thermal = analysis["effective_stiffness"], analysis.get("thermal_stress")
    compliance = np.linalg.inv(stiffness)
    found: dict[str, Any] = {"compliance": compliance}
    if "effective_stiffness_compression" in analysis:
        return found
    strains = None if thermal is None else -compliance @ thermal
    found["constants"] = engineering_constants(stiffness)
    found["transversely_isotropic"] = transversely_isotropic_part(stiffness, strains)
    if strains is not None:
        found["thermal_expansion"] = strains
    if not cell.sum_over_ranks(int(cell.debonded(None).sum())):
        found |= _comparisons(cell, fractions)
    return found


def _comparisons(cell: TornCell, fractions: Mapping[str, float]) -> dict[str, Any]:
    """Estimates, and bounds of rigidly bonded phases: both of transversely isotropic ones."""
    phases = {phase: _constants_of(cell, phase) for phase in fractions}
    matrix, *others = cell.summary.phases
    found: dict[str, Any] = {}
    springs = {phase: _springs(cell, phase) for phase in others}
    if None not in springs.values() or not _has_springs(cell):
        fibres = [Fibres(fractions[phase], phases[phase], springs[phase]) for phase in others]
        found["estimates"] = estimates(phases[matrix], fibres)
    if not _has_springs(cell) and all(map(is_transversely_isotropic, phases.values())):
        found["fibre_bounds"] = fibre_bounds(list(fractions.values()), list(phases.values()))
    return found


def _constants_of(cell: TornCell, phase: str) -> TransverselyIsotropic:
    material = cell.case.material_of(phase)
    return transversely_isotropic_part(spatial_stiffness(material), expansion(material))


def _has_springs(cell: TornCell) -> bool:
    bond = cell.case.interface
    return bond is not None and not (bond.normal_stiffness is None and bond.tangential_stiffness is None)


def _springs(cell: TornCell, phase: str) -> Springs | None:
    """Those of the fibres of a phase; None without any, or if its fibres have no common radius."""
    bond, summary = cell.case.interface, cell.summary
    radii = summary.radii[summary.constituent_phase == summary.phases.index(phase)]
    if bond is None or not _has_springs(cell) or np.ptp(radii) != 0.0:
        return None
    tangential = bond.tangential_stiffness or math.inf
    return Springs(bond.normal_stiffness or math.inf, tangential, tangential, float(radii[0]))
