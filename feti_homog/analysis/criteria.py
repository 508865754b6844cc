"""What breaks the bonds of a case."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from feti_homog.case.interface_section import InterfaceSection
from feti_homog.errors import CaseError
from feti_homog.feti.preconditioners.influence import Influence
from feti_homog.homogenization.bonds import axial_stiffness
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.laws.bond_criterion import BondCriterion
from feti_homog.interface.laws.energy_criterion import EnergyCriterion
from feti_homog.interface.laws.strength_criterion import StrengthCriterion
from feti_homog.interface.laws.tip_criterion import TipCriterion
from feti_homog.typing import Float, Int


def criterion_of(cell: TornCell, grows: bool = False) -> BondCriterion:
    """What breaks the bonds of a cell, in which debonding that `grows` makes tips of its own.  Collective.

    Raises:
        CaseError: tips of debonding ask for what the solver does not have.
    """
    bonds = cell.case.interfaces
    if not bonds:
        return StrengthCriterion(math.inf, math.inf, "max")
    pair = cell.solver.jump_operator.nodes.pair
    if bonds[0].criterion != "energy":
        return _strengths(bonds, pair)
    has_tips = grows or cell.sum_over_ranks(int(cell.debonded(None).sum())) > 0
    has_tips &= cell.solver.jump_operator.global_rows > 0
    springs = _springs(bonds, pair)
    return _at_tips(cell, springs) if bonds[0].growth == "released" and has_tips else springs


def _strengths(bonds: Sequence[InterfaceSection], pair: Int) -> StrengthCriterion:
    return StrengthCriterion(
        _of_nodes([bond.normal_strength for bond in bonds], pair),
        _of_nodes([bond.tangential_strength for bond in bonds], pair),
        bonds[0].criterion,
        _of_nodes([bond.axial_strength or bond.tangential_strength for bond in bonds], pair),
    )


def _springs(bonds: Sequence[InterfaceSection], pair: Int) -> EnergyCriterion:
    return EnergyCriterion(
        _of_nodes([bond.normal_stiffness for bond in bonds], pair),
        _of_nodes([bond.tangential_stiffness for bond in bonds], pair),
        _of_nodes([bond.toughness for bond in bonds], pair),
        _of_nodes([bond.mode_sensitivity for bond in bonds], pair),
        _of_nodes([axial_stiffness(bond) for bond in bonds], pair),
    )


def _of_nodes(values: Sequence[float | None], pair: Int) -> float | Float:
    """The values of interfaces at the nodes (k,) with the interfaces `pair` (k,), None being inf: one for all, if there
    is one interface."""
    finite = [math.inf if value is None else value for value in values]
    return finite[0] if len(finite) == 1 else np.array(finite)[pair]


def _at_tips(cell: TornCell, springs: EnergyCriterion) -> TipCriterion:
    """Raises CaseError if the solver has no inverse of the dual operator."""
    inverses = [each.solver.preconditioner for each in cell.problems]
    known = [inverse for inverse in inverses if isinstance(inverse, Influence)]
    if len(known) < len(inverses):
        raise CaseError('[interface] growth = "released": needs -feti_pc_type influence; or growth = "springs"')
    return TipCriterion(springs, *known)
