"""Constants that follow from the stiffness of a linear cell: moduli and bounds in the plane, constants in space."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from feti_homog.analysis.cell_records import StiffnessBounds
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.materials import bounds
from feti_homog.materials.constants import engineering_moduli
from feti_homog.materials.laws import plane_stiffness
from feti_homog.typing import Float


def constants(cell: TornCell, secants: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of `Result` that follow from `effective_stiffness` and `thermal_stress`. Collective."""
    if len(cell.problems) > 1:
        from feti_homog.analysis import constants_in_space  # with closed estimates that nothing else needs

        return constants_in_space.constants(cell, secants)
    return {} if cell.case.interfaces else _moduli_and_bounds(cell, secants["effective_stiffness"])


def _moduli_and_bounds(cell: TornCell, stiffness: Float) -> dict[str, Any]:
    """Return the moduli of L^ef and the bounds of the phases. Collective."""
    fractions = cell.fractions()
    case, shares = cell.case, list(fractions.values())
    phases = [plane_stiffness(case.material_of(phase), case.analysis.plane) for phase in fractions]
    isotropic = all(bounds.is_isotropic(phase) for phase in phases)
    found: dict[str, Any] = {"moduli": engineering_moduli(stiffness)}
    # With voids the lower bounds are zero.
    if not cell.summary.voids:
        found["bounds"] = StiffnessBounds(
            voigt=bounds.voigt(shares, phases),
            reuss=bounds.reuss(shares, phases),
            hashin_shtrikman=bounds.hashin_shtrikman(shares, phases) if isotropic else None,
        )
    return found
