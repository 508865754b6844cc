"""What breaks the bonds of a case."""

from __future__ import annotations

import math

from feti_homog.config.interface_section import InterfaceSection
from feti_homog.errors import CaseError
from feti_homog.feti.preconditioners.influence import Influence
from feti_homog.homogenization import bonds
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.bond_criterion import BondCriterion
from feti_homog.interface.energy_criterion import EnergyCriterion
from feti_homog.interface.strength_criterion import StrengthCriterion
from feti_homog.interface.tip_criterion import TipCriterion


def criterion_of(cell: TornCell) -> BondCriterion:
    """What breaks the bonds of a cell.  Collective.

    Raises:
        CaseError: tips of debonding ask for what the solver does not have.
    """
    bond = cell.case.interface
    if bond is None:
        return StrengthCriterion(math.inf, math.inf, "max")
    if bond.criterion != "energy":
        return _strengths(bond)
    has_tips = cell.case.path is not None or cell.sum_over_ranks(int(cell.debonded(None).sum())) > 0
    return _at_tips(cell, _springs(bond)) if bond.growth == "released" and has_tips else _springs(bond)


def _strengths(bond: InterfaceSection) -> StrengthCriterion:
    return StrengthCriterion(
        bond.normal_strength or math.inf,
        bond.tangential_strength or math.inf,
        bond.criterion,
        bond.axial_strength or bond.tangential_strength or math.inf,
    )


def _springs(bond: InterfaceSection) -> EnergyCriterion:
    return EnergyCriterion(
        bond.normal_stiffness or math.inf,
        bond.tangential_stiffness or math.inf,
        bond.toughness or math.inf,
        bond.mode_sensitivity,
        bonds.axial_stiffness(bond),
    )


def _at_tips(cell: TornCell, springs: EnergyCriterion) -> TipCriterion:
    """Raises CaseError if the solver has no inverse of the dual operator."""
    inverses = [each.solver.preconditioner for each in (cell, cell.axial) if each is not None]
    known = [inverse for inverse in inverses if isinstance(inverse, Influence)]
    if len(known) < len(inverses):
        raise CaseError('[interface] growth = "released": needs -feti_pc_type influence; or growth = "springs"')
    return TipCriterion(springs, *known)
