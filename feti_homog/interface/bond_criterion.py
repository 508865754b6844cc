"""When bonds break."""

from __future__ import annotations

from feti_homog.interface.energy_criterion import EnergyCriterion
from feti_homog.interface.strength_criterion import StrengthCriterion

BondCriterion = StrengthCriterion | EnergyCriterion
"""Its `utilisation` tells how much of their strength tractions use: convex and homogeneous of degree one in them."""
