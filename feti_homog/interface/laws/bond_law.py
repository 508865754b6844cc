"""Laws of bonds: how much of its strength a traction uses, what a bond becomes that used all of it, what that costs.

A law is a dataclass of constants, one of all nodes or (k,) of each; `BondState.history` has what changes.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Sequence
from importlib import import_module
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from feti_homog.case.bond_laws import LAWS
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BondState
from feti_homog.typing import Bool, Float, Int

# Halvings of an interval of length one, after which double precision ends.
BISECTIONS = 60


class KeyValues(Protocol):
    """Values of a key of [interface] at the nodes, those of the next key where a section has none, inf without any."""

    def __call__(self, key: str, *others: str) -> float | Float:
        """Return one value of all nodes, or (k,) of each."""

    def everywhere(self, key: str, *others: str) -> Float:
        """(s,) values of all sections, the same on every rank."""

    def common(self, key: str) -> Any:
        """Return the value in which all sections agree, as the case has it."""


@dataclasses.dataclass(frozen=True)
class BondLaw(ABC):
    """Law of all bonds of a cell.  The defaults are those of a law without memory.

    Attributes:
        has_toughness: bonds have a fracture energy, which `fracture` gives.
        has_tips: the energies that drive the tips of debonding on are compared with it.
        is_convex: `share` is, and so passes 1 once on a straight way.
        break_names: what `breaks` gives of tractions with two or three components.
    """

    has_toughness: ClassVar[bool] = False
    has_tips: ClassVar[bool] = False
    is_convex: ClassVar[bool] = True
    break_names: ClassVar[Sequence[str]] = ("normal", "tangential", "axial")

    @abstractmethod
    def share(self, traction: Float) -> Float:
        """(p,) share of the strength that tractions (p, c) use at the nodes of the law; 1 breaks.

        c = 2 are normal, tension positive, and tangential, 3 also along the fibre.  Homogeneous of degree one in the
        traction; 0 of none.
        """

    @abstractmethod
    def breaks(self, traction: Float) -> Float:
        """(p, d) how bonds break under tractions (p, c), with the first d of `break_names`."""

    @classmethod
    @abstractmethod
    def of_keys(cls, value: KeyValues) -> Self:
        """Make the law of the keys of [interface]."""

    def at(self, node: Int) -> Self:
        """Return the law of the nodes (p,), one after the other."""
        values: dict[str, Any] = {k: value[node] for k, value in vars(self).items() if isinstance(value, np.ndarray)}
        return dataclasses.replace(self, **values)

    def begin(self, k: int) -> Float:
        """(k, h) internal variables of k intact bonds."""
        return np.zeros((k, 0))

    def in_state(self, cell: CoupledInterfaces, bonds: BondState) -> BondLaw:
        """Return the law of the nodes of this rank in a state of all bonds.  Collective; its methods are not."""
        return self

    def convex(self, p: int) -> Bool:
        """(p,) True where `share` is sure to be a convex function of the traction, for p nodes."""
        return np.full(p, self.is_convex)

    def after(self, bonds: BondState, which: Bool, traction: Float) -> tuple[Float, Bool]:
        """(k, h) internal variables after some bonds used all of their strength, and which bonds (k,) part.

        These are the bonds `which` (k,) under tractions (k, c).
        """
        return bonds.history, which

    def softening(self, bonds: BondState, pulled: Bool) -> Float | None:
        """(k, 3) C / C_0 of the normal, tangential and axial springs of bonds `pulled` (k,) or pressed.

        None of a law that never changes C.
        """
        return None

    def fracture(self, bonds: BondState, which: Bool, traction: Float) -> Float:
        """(p,) energies per area that the p bonds `which` (k,) take to break under tractions (k, c) of any size."""
        return np.zeros(int(which.sum()))

    def damage(self, bonds: BondState) -> Float | None:
        """(k,) 0 of intact bonds to 1 of broken ones; None of a law that does not soften."""
        return None

    @property
    def overshoot(self) -> float:
        """Excess of the traction of the first step of damage over the peak of the law, relative to that."""
        return 0.0

    def onset(self) -> BondLaw:
        """Return the criterion by which an intact bond is first damaged."""
        return self

    def mode_angle(self, traction: Float) -> Float:
        """(p,) psi of tractions (p, c), in radians: 0 opens, pi/2 shears, under pressure too."""
        shear = np.linalg.norm(traction[:, 1:], axis=1)
        return np.asarray(np.arctan2(shear, np.maximum(traction[:, 0], 0.0)))

    def first_factor(self, before: Float, ahead: Float) -> Float | None:
        """(p,) the least f >= 0 at which `before` + f `ahead`, tractions (p, c), break, inf where none does.

        None of a law that has no formula for it. `before` breaks nothing.
        """
        return None

    def crossing(self, before: Float, ahead: Float, high: Float) -> Float:
        """(p,) f at which `before` + f `ahead` (p, c) reach 1, by halving [0, `high`] (p,), which grows if it must."""
        low, high = np.zeros(len(high)), high.copy()
        for _ in range(BISECTIONS):
            below = self.share(before + high[:, None] * ahead) < 1.0
            if not below.any():
                break
            high[below] *= 2.0
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            broken = self.share(before + middle[:, None] * ahead) > 1.0
            low, high = np.where(broken, low, middle), np.where(broken, middle, high)
        return high


class SpringLaw(BondLaw):
    """Law of bonds that break by the energies of their undamaged springs.

    A traction along the fibre adds to the energy of slip: all shear counts alike.

    Attributes:
        normal_stiffness, tangential_stiffness, axial_stiffness: k_n, k_t, k_a, stress per length.
    """

    normal_stiffness: float | Float
    tangential_stiffness: float | Float
    axial_stiffness: float | Float

    has_toughness: ClassVar[bool] = True
    break_names: ClassVar[Sequence[str]] = ("psi",)

    def energies(self, traction: Float) -> tuple[Float, Float]:
        """(p,) energies of springs that open and that slip, under tractions (p, c)."""
        opening = np.maximum(traction[:, 0], 0.0) ** 2 / (2.0 * self.normal_stiffness)
        slip = traction[:, 1] ** 2 / (2.0 * self.tangential_stiffness)
        if traction.shape[1] == 3:
            slip = slip + traction[:, 2] ** 2 / (2.0 * self.axial_stiffness)
        return np.asarray(opening), np.asarray(slip)

    def mode_angle(self, traction: Float) -> Float:
        """(p,) psi of tractions (p, c), in radians: sin^2 psi is the share of slip in the energy."""
        opening, slip = self.energies(traction)
        return np.asarray(np.arctan2(np.sqrt(slip), np.sqrt(opening)))

    def breaks(self, traction: Float) -> Float:
        """(p, 1) psi of tractions (p, c), in degrees."""
        return np.degrees(self.mode_angle(traction))[:, None]


def law_class(name: str) -> type[BondLaw]:
    """Class of the law with this name in `case.bond_laws`."""
    module, cls = LAWS[name].implementation.split(".")
    found: type[BondLaw] = getattr(import_module(f"{__package__}.{module}"), cls)
    return found
