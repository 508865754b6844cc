"""Constants that follow from a stiffness in space, by their usual names, and their closed estimates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from feti_homog.homogenization import bonds
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.materials.bounds import Fibres, Springs, fibre_bounds
from feti_homog.materials.constants import (
    TransverseIsotropy,
    engineering_constants,
    is_transversely_isotropic,
    transverse_moduli,
    transversely_isotropic_part,
)
from feti_homog.materials.estimates import estimates
from feti_homog.materials.laws import expansion, spatial_stiffness
from feti_homog.microstructure.phase_names import COATING
from feti_homog.typing import Bool, Float

# Radii of fibres that differ by less, relatively, are one: those of users' meshes are fitted to nodes.
SAME_RADIUS = 1e-6


def constants(cell: TornCell, secants: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of `Result` that follow from `effective_stiffness` and `thermal_stress`. Collective.

    Nothing follows where faces touch without tension: each column is a secant of its own load.  Estimates and bounds
    are of cells with fibres and without voids and debonding, estimates of round fibres.
    """
    if "effective_stiffness_compression" in secants:
        return {}
    stiffness, thermal = secants["effective_stiffness"], secants.get("thermal_stress")
    compliance = np.linalg.inv(stiffness)
    strains = None if thermal is None else -compliance @ thermal
    found: dict[str, Any] = {
        "compliance": compliance,
        "constants": engineering_constants(stiffness),
        "transversely_isotropic": transversely_isotropic_part(stiffness, strains),
        "transverse_moduli": transverse_moduli(stiffness),
    }
    if strains is not None:
        found["thermal_expansion"] = strains
    is_debonded, fractions = cell.sum_over_ranks(int(cell.debonded(None).sum())) > 0, cell.fractions()
    has_bounds = not is_debonded and not cell.summary.voids and len(fractions) > 1
    return found if not has_bounds else found | _comparisons(cell, fractions)


def _comparisons(cell: TornCell, fractions: Mapping[str, float]) -> dict[str, Any]:
    """Estimates of round fibres, and bounds of rigidly bonded ones of any section: of transversely isotropic phases.

    Estimates are of fibres without coatings that the same bonds hold in the matrix.
    """
    phases = {phase: _constants_of(cell, phase) for phase in fractions}
    matrix, *others = cell.summary.phases
    has_springs = bonds.has_springs(cell.case)
    found: dict[str, Any] = {}
    radii = {phase: cell.summary.radii[_of_phase(cell, phase)] for phase in others}
    if _is_plain(cell) and not any(_no_estimate(own, has_springs) for own in radii.values()):
        springs = {phase: _springs(cell, float(own[0])) if has_springs else None for phase, own in radii.items()}
        fibres = [Fibres(fractions[phase], phases[phase], springs[phase]) for phase in others]
        found["estimates"] = estimates(phases[matrix], fibres)
    if not has_springs and all(map(is_transversely_isotropic, phases.values())):
        found["fibre_bounds"] = fibre_bounds(list(fractions.values()), list(phases.values()))
    return found


def _is_plain(cell: TornCell) -> bool:
    """Return whether there are fibres without coatings, all in the matrix and bonded alike."""
    no_pairs = all(interface.between is None for interface in cell.case.interfaces)
    return no_pairs and COATING not in cell.summary.phases


def _of_phase(cell: TornCell, phase: str) -> Bool:
    """(constituents,) which fibres are of a phase."""
    summary = cell.summary
    return np.asarray(summary.constituent_phase == summary.phases.index(phase))


def _no_estimate(radii: Float, has_springs: bool) -> bool:
    """Return whether no estimate covers fibres of these radii, NaN where they are not round.

    With springs the estimates need one radius.
    """
    return bool(np.isnan(radii).any() or (has_springs and np.ptp(radii) > SAME_RADIUS * radii.max()))


def _constants_of(cell: TornCell, phase: str) -> TransverseIsotropy:
    material = cell.case.material_of(phase)
    return transversely_isotropic_part(spatial_stiffness(material), expansion(material))


def _springs(cell: TornCell, radius: float) -> Springs:
    """Return those of the interfaces of fibres with this radius."""
    ((normal, tangential),) = bonds.springs(cell.case).stiffness
    ((axial,),) = bonds.axial_springs(cell.case).stiffness
    return Springs(normal, tangential, axial, radius)
