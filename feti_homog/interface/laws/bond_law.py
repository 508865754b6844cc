"""Base classes of bond laws: utilisation by tractions, the state after a break, and the fracture energy.

A law is a dataclass of constants, numbers or arrays (k,) by node; `BondState.history` has the internal variables.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from importlib import import_module
from typing import Any, ClassVar, Self

import numpy as np

from feti_homog.case import bond_laws, interface_section
from feti_homog.interface.contact import BondState, CoupledInterfaces
from feti_homog.typing import Bool, Float, Int

# Relative difference of utilisations below which bonds break together: in a symmetric cell the solver errs by less.
UTILISATION_TIE = 1e-6
# Number of halvings of a unit interval, or of Newton steps, that exhausts double precision.
MOST_STEPS = 60
# Exponent of the fibre factor for keys with these endings.  Laws remain similar, because all openings grow by the
# factor too, and the process zone keeps its length.
POWERS = {"strength": 1, "toughness": 2}
Sections = Sequence[interface_section.InterfaceSection]


@dataclasses.dataclass(frozen=True)
class SectionValues:
    """The values of [interface] keys at nodes (k,) in the sections `bonds`, with section indices `pair` (k,).

    Strengths are multiplied by `factor`, a number or (k,), of the node's fibre, and toughnesses by `factor` squared.
    """

    bonds: Sections
    pair: Int
    factor: float | Float

    def __call__(self, key: str, *more: str) -> float | Float:
        """Return the value of the first key that each node's section sets, a number or (k,); inf if it sets none."""
        sections = self.everywhere(key, *more)
        values = float(sections[0]) if len(sections) == 1 else sections[self.pair]
        power = POWERS.get(key.rpartition("_")[2], 0)
        return values * self.factor**power if power else values

    def everywhere(self, key: str, *more: str) -> Float:
        """Return the value (s,) of the first key set in each of s sections, without factors; (inf,) for no sections."""
        values = []
        for bond in self.bonds:
            candidates = [getattr(bond, name) for name in (key, *more)]
            values.append(next((value for value in candidates if value is not None), math.inf))
        return np.array(values or [math.inf], float)

    def common(self, key: str) -> Any:
        """Return the value of a key that must be equal in all sections."""
        return getattr(self.bonds[0], key)


@dataclasses.dataclass(frozen=True)
class BondLaw(ABC):
    """Base class of bond laws, for all bonds of a cell, with defaults for laws without memory.

    Attributes:
        has_toughness: whether bonds have a fracture energy, see `fracture`.
        has_tips: whether results compare the fracture energy with the energy release rates at debonding tips.
        is_convex: whether `share` is convex, so that the utilisation rises through 1 at most once on a straight path.
        break_names: names of the columns in `breaks`; tractions with two components have no axial column.
    """

    has_toughness: ClassVar[bool] = False
    has_tips: ClassVar[bool] = False
    is_convex: ClassVar[bool] = True
    break_names: ClassVar[Sequence[str]] = ("normal", "tangential", "axial")

    @abstractmethod
    def share(self, traction: Float) -> Float:
        """Return the utilisation (p,) of bonds under tractions (p, c); a bond breaks at 1.

        The c components are normal (positive in tension), tangential and, if c = 3, axial.  The utilisation is
        homogeneous of degree one.
        """

    @abstractmethod
    def breaks(self, traction: Float) -> Float:
        """Return modes of breaks under tractions (p, c): component utilisations (p, c), or angles (p, 1) in degrees."""

    @classmethod
    @abstractmethod
    def of_keys(cls, value: SectionValues) -> Self:
        """Make the law from the values of its [interface] keys."""

    def at(self, node: Int) -> Self:
        """Return the law at the nodes with indices (p,)."""
        values: dict[str, Any] = {k: value[node] for k, value in vars(self).items() if isinstance(value, np.ndarray)}
        return dataclasses.replace(self, **values)

    def begin(self, k: int) -> Float:
        """Return the initial internal variables (k, h) of `k` intact bonds."""
        return np.zeros((k, 0))

    def in_state(self, cell: CoupledInterfaces, bonds: BondState) -> BondLaw:
        """Return the law at this rank's nodes in a bond state.  Collective; methods of the returned law are not."""
        return self

    def convex(self, p: int) -> Bool:
        """Return the mask (p,) of nodes at which `share` is a convex function of the traction."""
        return np.full(p, self.is_convex)

    def after(self, bonds: BondState, which: Bool, traction: Float) -> tuple[Float, Bool]:
        """Break the bonds in the mask `which` (k,) under tractions (k, c).

        Return the new internal variables (k, h), and the mask (k,) of bonds that part.
        """
        return bonds.history, which

    def softening(self, bonds: BondState, pulled: Bool) -> Float | None:
        """Return the ratio C / C_0 (k, 3) of spring compliance with and without damage; None if C never changes.

        Springs are in tension at the nodes in the mask `pulled` (k,), else in compression.
        """
        return None

    def fracture(self, bonds: BondState, which: Bool, traction: Float) -> Float:
        """Return the fracture energy per area (p,) of p bonds `which` (k,) at tractions (k, c); 0 without toughness."""
        return np.zeros(int(which.sum()))

    def damage(self, bonds: BondState) -> Float | None:
        """Return the damage (k,), from 0, intact, to 1, broken; None for laws without softening."""
        return None

    @property
    def overshoot(self) -> float:
        """The fraction by which the traction of the first break exceeds the peak of the law; 0 without saw teeth."""
        return 0.0

    def onset(self) -> BondLaw:
        """Return the law that predicts the first damage of intact bonds."""
        return self

    def mode_angle(self, traction: Float) -> Float:
        """Return the mode angle psi (p,) of tractions (p, c), in radians.

        The angle is 0 under a normal traction alone, and pi/2 in shear without tension, with or without pressure.
        """
        shear = np.linalg.norm(traction[:, 1:], axis=1)
        return np.asarray(np.arctan2(shear, np.maximum(traction[:, 0], 0.0)))

    def first_factor(self, before: Float, direction: Float) -> Float | None:
        """Return the smallest load factors f (p,) that break each bond, in closed form; None without a closed form.

        The traction `before` + f `direction` (p, c) breaks the bond at the factor f >= 0; f is inf if the bond never
        breaks.  The traction `before` must break no bond.
        """
        return None

    def crossing(self, before: Float, direction: Float, low: Float, high: Float) -> Float:
        """Find the load factors f (p,) at which bonds break, by bisection of [`low`, `high`] (p,).

        A bond breaks under `before` + f `direction` (p, c), not at `low`; a factor `high` without a break is doubled.
        """
        high = high.copy()
        for _ in range(MOST_STEPS):
            below = self.share(before + high[:, None] * direction) < 1.0
            if not below.any():
                break
            high[below] *= 2.0
        for _ in range(MOST_STEPS):
            middle = (low + high) / 2
            broken = self.share(before + middle[:, None] * direction) > 1.0
            low, high = np.where(broken, low, middle), np.where(broken, middle, high)
        return high


class SpringLaw(BondLaw):
    """Base class of laws in which undamaged springs break at a critical energy, which depends on the mode.

    A traction along the fibre adds to the slip energy, because the law treats all directions of shear in the same way.

    Attributes:
        normal_stiffness, tangential_stiffness, axial_stiffness: k_n, k_t, k_a, stress per length.
    """

    normal_stiffness: float | Float
    tangential_stiffness: float | Float
    axial_stiffness: float | Float

    has_toughness: ClassVar[bool] = True
    break_names: ClassVar[Sequence[str]] = ("psi",)

    def energies(self, traction: Float) -> tuple[Float, Float]:
        """Return the energies per area (p,) of opening and of slip in the springs under tractions (p, c)."""
        opening = np.maximum(traction[:, 0], 0.0) ** 2 / (2.0 * self.normal_stiffness)
        slip = traction[:, 1] ** 2 / (2.0 * self.tangential_stiffness)
        if traction.shape[1] == 3:
            slip = slip + traction[:, 2] ** 2 / (2.0 * self.axial_stiffness)
        return np.asarray(opening), np.asarray(slip)

    def mode_angle(self, traction: Float) -> Float:
        """Return the mode angle psi (p,) in radians of tractions (p, c): slip takes sin^2 psi of the spring energy."""
        opening, slip = self.energies(traction)
        return np.asarray(np.arctan2(np.sqrt(slip), np.sqrt(opening)))

    def breaks(self, traction: Float) -> Float:
        """Return the mode angles psi (p, 1) of tractions (p, c), in degrees."""
        return np.degrees(self.mode_angle(traction))[:, None]


def law_class(name: str) -> type[BondLaw]:
    """Return the class of the law with this name in `case.bond_laws`."""
    module, cls = bond_laws.LAWS[name].implementation.split(".")
    law: type[BondLaw] = getattr(import_module(f"{__package__}.{module}"), cls)
    return law


def law_of_sections(bonds: Sections, pair: Int, factor: float | Float = 1.0) -> BondLaw:
    """Make the bond law at nodes from the arguments of `SectionValues`; without sections no bond breaks."""
    name = bonds[0].criterion if bonds else bond_laws.DEFAULT
    return law_class(name).of_keys(SectionValues(bonds, pair, factor))
