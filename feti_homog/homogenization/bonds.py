"""The springs of the bonds of a case, in the plane and along the fibres; without a stiffness bonds are rigid."""

from __future__ import annotations

import math

from feti_homog.case.case import Case
from feti_homog.case.interface_section import InterfaceSection
from feti_homog.feti.decomposition.interface_springs import InterfaceSprings


def springs(case: Case) -> InterfaceSprings:
    """Those of the problem in the plane: normal and tangential."""
    return InterfaceSprings(tuple(map(plane_stiffnesses, case.interfaces)))


def axial_springs(case: Case) -> InterfaceSprings:
    """Those of the problem along the fibres."""
    return InterfaceSprings(tuple((axial_stiffness(bond),) for bond in case.interfaces))


def plane_stiffnesses(bond: InterfaceSection) -> tuple[float, float]:
    """k_n and k_t."""
    return bond.normal_stiffness or math.inf, bond.tangential_stiffness or math.inf


def axial_stiffness(bond: InterfaceSection) -> float:
    """k_a, that around the fibre where it is not given."""
    return bond.axial_stiffness or bond.tangential_stiffness or math.inf


def has_springs(case: Case) -> bool:
    """Whether any bond gives way."""
    stiffnesses = (*springs(case).stiffness, *axial_springs(case).stiffness)
    return any(math.isfinite(stiffness) for own in stiffnesses for stiffness in own)
