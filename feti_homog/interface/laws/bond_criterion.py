"""When bonds break."""

from __future__ import annotations

from feti_homog.interface.laws.energy_criterion import EnergyCriterion
from feti_homog.interface.laws.strength_criterion import StrengthCriterion
from feti_homog.interface.laws.tip_criterion import TipCriterion

BondCriterion = StrengthCriterion | EnergyCriterion | TipCriterion
"""Its `law` tells how much of their strength tractions use: homogeneous of degree one in them."""


def spring_criterion(criterion: BondCriterion) -> EnergyCriterion | None:
    """The toughness and its modes, where bonds break by energy."""
    if isinstance(criterion, TipCriterion):
        return criterion.springs
    return criterion if isinstance(criterion, EnergyCriterion) else None
