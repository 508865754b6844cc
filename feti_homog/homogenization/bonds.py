"""Bonds of a case: springs in the plane and along the fibres, rigid without a stiffness, and the law that breaks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.case import bond_laws
from feti_homog.case.case import Case
from feti_homog.case.interface_section import InterfaceSection
from feti_homog.feti.decomposition.jump_operator import InterfaceSprings
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.laws.registry import law_class
from feti_homog.typing import Float, Int


def springs(case: Case) -> InterfaceSprings:
    """Return those of the problem in the plane: normal and tangential."""
    return InterfaceSprings(tuple(map(plane_stiffnesses, case.interfaces)), has_softening(case))


def axial_springs(case: Case) -> InterfaceSprings:
    """Return those of the problem along the fibres."""
    return InterfaceSprings(tuple((axial_stiffness(bond),) for bond in case.interfaces), has_softening(case))


def has_softening(case: Case) -> bool:
    """Return True if the law of the bonds changes their compliance."""
    return case.interface is not None and bond_laws.LAWS[case.interface.criterion].softens


def plane_stiffnesses(bond: InterfaceSection) -> tuple[float, float]:
    """k_n and k_t."""
    return bond.normal_stiffness or math.inf, bond.tangential_stiffness or math.inf


def axial_stiffness(bond: InterfaceSection) -> float:
    """k_a, that around the fibre where it is not given."""
    return bond.axial_stiffness or bond.tangential_stiffness or math.inf


def has_springs(case: Case) -> bool:
    """Return whether any bond gives way."""
    stiffnesses = (*springs(case).stiffness, *axial_springs(case).stiffness)
    return any(math.isfinite(stiffness) for own in stiffnesses for stiffness in own)


# Power of a fibre's factor by which keys of these endings are multiplied: laws remain similar, for all openings grow by
# the factor too, and the length of the process zone stays.
POWERS = {"strength": 1, "toughness": 2}


def strength_factors(case: Case, fibres: int) -> Float:
    """(fibres,) strength of the bonds of each fibre / that of the case.

    f = (-ln(1 - U))^(1/m) / Gamma(1 + 1/m) with U of a uniform distribution, Weibull's of modulus m and mean 1, times
    the column `strength` of a table of fibres.  Fibre N takes the N-th number of the generator, whatever the cell.
    """
    factors, scatter = np.ones(fibres), case.interface.scatter if case.interface else None
    if scatter is not None:
        # A stream of its own: of one seed the arrangement takes other numbers.
        uniform = np.random.default_rng(np.random.SeedSequence(scatter.seed, spawn_key=(1,))).random(fibres)
        factors = (-np.log1p(-uniform)) ** (1.0 / scatter.shape) / math.gamma(1.0 + 1.0 / scatter.shape)
    table = case.cell.table
    if table is None:
        return factors
    from feti_homog.microstructure.periodic_table import fibre_rows  # with windows of tables

    return factors * table.strength[fibre_rows(table, case.cell.window)]


@dataclass(frozen=True)
class SectionValues:
    """Values of the keys of sections [interface] at nodes (k,), which belong to the sections `pair` (k,).

    `factor` (k,) is that of the fibre of each node, which multiplies its strengths, and squared its toughness.
    """

    bonds: Sequence[InterfaceSection]
    pair: Int
    factor: float | Float

    def __call__(self, key: str, *others: str) -> float | Float:
        """Return the value of a key, or of the next of the others, at all nodes or (k,) at each; inf without any."""
        own = self.everywhere(key, *others)
        values = float(own[0]) if len(own) == 1 else own[self.pair]
        power = POWERS.get(key.rpartition("_")[2], 0)
        return values * self.factor**power if power else values

    def everywhere(self, key: str, *others: str) -> Float:
        """(s,) values of all sections, for the factor 1."""
        given = [
            next((v for name in (key, *others) if (v := getattr(bond, name)) is not None), None) for bond in self.bonds
        ]
        return np.array([math.inf if own is None else own for own in given] or [math.inf], float)

    def common(self, key: str) -> Any:
        """Return the value of the first section, with which the others agree."""
        return getattr(self.bonds[0], key)


def bond_law(bonds: Sequence[InterfaceSection], pair: Int, factor: float | Float = 1.0) -> BondLaw:
    """Law of the bonds at the nodes (k,) of the interfaces `pair` (k,); without sections of interfaces none breaks.

    `factor` is as of `SectionValues`.
    """
    name = bonds[0].criterion if bonds else bond_laws.DEFAULT
    return law_class(name).of_keys(SectionValues(bonds, pair, factor))


def has_process_zone(case: Case) -> bool:
    """Return True if elements must resolve the length along which the bonds of a case break."""
    return case.interface is not None and bond_laws.LAWS[case.interface.criterion].has_process_zone
