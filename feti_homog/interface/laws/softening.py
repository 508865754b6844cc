"""Cohesive laws, in which damage softens bonds tooth by tooth and takes exactly the energy of the law.

Camanho, Davila, NASA/TM-2002-211737 (mixed mode); Benzeggagh, Kenane, Compos. Sci. Technol. 56 (1996) 439 (toughness);
Rots, Belletti, Invernizzi, Eng. Fract. Mech. 75 (2008) 590 (saw teeth).

W is the energy that undamaged springs k_n, k_t would store at the same opening and slip, B the fraction of W in shear;
strengths N, S, toughnesses G_n, G_t (opening, slip) and eta are constants:

    W_0 = 1 / ((1 - B) / W_n + B / W_t),  W_n = N^2 / (2 k_n),  W_t = S^2 / (2 k_t)     onset of damage,
    G_c = G_n + (G_t - G_n) B^eta                                                       energy of the law,
    traction / peak = tau(u),  sqrt(W / W_0) = x = 1 + s u,  s = (G_c / W_0 - 1) / (2 int tau)   softening,
    1 - d = tau / x                                                                     damage.

So damage d takes the energy W_0 phi, phi = 2 int_0^x tau dx - tau x.  The tooth from the damage d_j to d_j+1 breaks at
W_j = W_0 (phi_j+1 - phi_j) / (d_j+1 - d_j) and takes W_j (d_j+1 - d_j): the energy of the law between d_j and d_j+1.
"""

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.interface.contact import BondState, CoupledInterfaces
from feti_homog.interface.laws.bond_law import MOST_STEPS, SectionValues, SpringLaw
from feti_homog.interface.laws.strength import QuadraticStrength
from feti_homog.typing import Bool, Float, Int

# Largest number of teeth that the program chooses.
MOST_TEETH = 10_000
# Teeth divide an exponential branch down to this fraction of the peak; the last tooth takes the remaining energy.
EXPONENTIAL_TAIL = 0.01
NUMBERS = ("normal_stiffness", "tangential_stiffness", "normal_strength", "tangential_strength",
           "normal_toughness", "tangential_toughness", "mixing_exponent")  # fmt: skip


def numbers(value: Callable[..., float | Float]) -> dict[str, Any]:
    """Return a law's constants by name, from `value`, a function of keys; axial stiffness defaults to tangential."""
    axial = value("axial_stiffness", "tangential_stiffness")
    return {name: value(name) for name in NUMBERS} | {"axial_stiffness": axial}


@dataclass(frozen=True)
class CohesiveLaw(SpringLaw):
    """Base class of laws with softening, in which the history of a bond counts broken teeth; symbols as in the module.

    Attributes:
        normal_strength, tangential_strength: N and S.
        normal_toughness, tangential_toughness: G_n and G_t.
        mixing_exponent: eta.
        levels: damage d_0 = 0 < ... < d_n = 1 between teeth.
        level: number of broken teeth.
    """

    normal_stiffness: float | Float
    tangential_stiffness: float | Float
    axial_stiffness: float | Float
    normal_strength: float | Float
    tangential_strength: float | Float
    normal_toughness: float | Float
    tangential_toughness: float | Float
    mixing_exponent: float | Float
    levels: tuple[float, ...]
    level: float | Float = 0.0

    is_convex: ClassVar[bool] = False

    @classmethod
    def of_keys(cls, value: SectionValues) -> Self:
        """Make the law and its damage levels from the keys in [interface].  Raises CaseError as `levels_for` does."""
        law, branch = cls(**numbers(value), levels=(0.0, 1.0)), cls.branch(value)
        # The levels follow from all sections, so that all ranks agree.
        law_of_all = cls(**numbers(value.everywhere), levels=(0.0, 1.0), **branch)
        levels = law_of_all.levels_for(value.common("teeth"), value.common("softening_tolerance"))
        return replace(law, levels=levels, **branch)

    @classmethod
    def branch(cls, value: SectionValues) -> dict[str, Any]:
        """Return the dataclass fields, by name, that describe the softening branch; {} without any."""
        return {}

    def levels_for(self, teeth: int | None, tolerance: float) -> tuple[float, ...]:
        """Choose the damage levels between the teeth.

        In the pure mode with the largest G_c / W_0, successive openings have a constant ratio.  Without a number
        `teeth`, take the least number for which the first tooth exceeds the peak traction by at most the fraction
        `tolerance`.  Raises CaseError if more than MOST_TEETH teeth are necessary.
        """
        s = self._longest_branch
        for n in [teeth] if teeth else range(1, MOST_TEETH + 1):
            # Without a softening branch the bond reaches all levels at once.
            x = (1.0 + s * self.last) ** (np.arange(n) / n)
            d = 1.0 - self.shape((x - 1.0) / s) / x if s > 0.0 else np.arange(n) / n
            levels = np.append(d, 1.0)
            excess = math.sqrt(float(self._taken(levels[1:2], s)[0] / levels[1])) - 1.0
            if teeth or excess <= tolerance:
                return tuple(levels.tolist())
        raise CaseError(
            f"[interface] softening_tolerance = {tolerance:g}: even with {MOST_TEETH} teeth, the first tooth exceeds "
            f"the peak traction by the fraction {excess:.1e}; expected at least this fraction"
        )

    @property
    def _longest_branch(self) -> float:
        """The largest branch length s, defined in the module, over both pure modes and all nodes."""
        onsets = self._onsets
        ratios = self.normal_toughness / onsets[0], self.tangential_toughness / onsets[1]
        largest = max(float(np.max(ratio, initial=0.0)) for ratio in map(np.asarray, ratios))
        return max(0.0, largest - 1.0) / (2.0 * float(self.area(np.inf)))

    @property
    def overshoot(self) -> float:
        """The largest fraction by which, in pure modes, the first tooth exceeds the peak traction."""
        return float(np.sqrt(self._taken(self._damages[1:2], self._longest_branch)[0] / self.levels[1])) - 1.0

    @property
    @abstractmethod
    def last(self) -> float:
        """The argument u at the end of the last tooth, which takes all remaining energy."""

    @abstractmethod
    def shape(self, u: Float) -> Float:
        """Return the relative traction tau(u) (p,) for u (p,) >= 0, which falls from 1 at u = 0."""

    @abstractmethod
    def area(self, u: Float | float) -> Float | float:
        """Return the integral of tau from 0 to u, for one or many u (p,)."""

    @abstractmethod
    def opening(self, d: Float, s: Float | float) -> Float:
        """Return u (p,) at damage d < 1 on a branch of length s: the root of tau(u) = (1 - d) (1 + s u)."""

    def begin(self, k: int) -> Float:
        """Return the numbers of broken teeth (k, 1), zero for `k` intact bonds."""
        return np.zeros((k, 1))

    def in_state(self, cell: CoupledInterfaces, bonds: BondState) -> Self:
        """Return the law with each bond's number of broken teeth."""
        return replace(self, level=bonds.history[:, 0])

    def share(self, traction: Float) -> Float:
        """Return the utilisation sqrt(W / W_j) (p,) under tractions (p, c) at bonds with j broken teeth."""
        first, second = self.energies(traction)
        tooth = np.minimum(np.asarray(self.level, np.int64), len(self.levels) - 2)
        return np.asarray(np.sqrt((first + second) / self._breaking(traction, tooth)) / (1.0 - self._damages[tooth]))

    def after(self, bonds: BondState, which: Bool, traction: Float) -> tuple[Float, Bool]:
        """Break the next tooth of the bonds in the mask `which` (k,).

        Return the new numbers of broken teeth (k, 1), and the mask (k,) of bonds whose last tooth breaks.
        """
        history = bonds.history + which[:, None]
        return history, which & (history[:, 0] >= len(self.levels) - 1)

    def damage(self, bonds: BondState) -> Float:
        """Return the damage d (k,) of bonds, 1 for all parted bonds."""
        d = self._damages[bonds.history[:, 0].astype(np.int64)]
        return np.asarray(np.where(bonds.status == 0, d, 1.0))

    def softening(self, bonds: BondState, pulled: Bool) -> Float:
        """Return the ratio C / C_0 = 1 / (1 - d) (k, 3); 1 for broken bonds, and for normal springs without tension."""
        d = self._damages[bonds.history[:, 0].astype(np.int64)]
        factor = 1.0 / (1.0 - np.where(d < 1.0, d, 0.0))
        return np.column_stack([np.where(pulled, factor, 1.0), factor, factor])

    def fracture(self, bonds: BondState, which: Bool, traction: Float) -> Float:
        """Return the energy W_j (d_j+1 - d_j) (p,) of the next tooth of each bond in the mask `which` (k,)."""
        law, selected = self.at(np.flatnonzero(which)), traction[which]
        tooth = bonds.history[which, 0].astype(np.int64)
        return np.asarray(law._breaking(selected, tooth) * np.diff(self._damages)[tooth])

    def onset(self) -> QuadraticStrength:
        """Return the strength criterion that predicts the first damage of intact bonds."""
        axial = self.tangential_strength * np.sqrt(self.axial_stiffness / np.asarray(self.tangential_stiffness))
        return QuadraticStrength(self.normal_strength, self.tangential_strength, axial)

    @property
    def _damages(self) -> Float:
        """The damage levels (n + 1,) at the ends of n teeth."""
        return np.array(self.levels)

    @property
    def _onsets(self) -> tuple[float | Float, float | Float]:
        """The onset energies W_n and W_t, numbers or (p,)."""
        normal, tangential = self.normal_strength, self.tangential_strength
        return normal**2 / (2.0 * self.normal_stiffness), tangential**2 / (2.0 * self.tangential_stiffness)

    def _breaking(self, traction: Float, tooth: Int) -> Float:
        """Return the spring energies W_j (p,) at which teeth j break under tractions (p, c).

        `tooth` has a number j for each bond, or one number for all bonds.
        """
        first, second = self.energies(traction)
        stored = first + second
        B = np.divide(second, stored, out=np.zeros(len(stored)), where=stored > 0.0)
        onsets = self._onsets
        onset = 1.0 / ((1.0 - B) / onsets[0] + B / onsets[1])
        extra = (self.tangential_toughness - self.normal_toughness) * B**self.mixing_exponent
        s = np.maximum((self.normal_toughness + extra) / onset - 1.0, 0.0) / (2.0 * self.area(np.inf))
        low, high = self._damages[tooth], self._damages[tooth + 1]
        return np.asarray(onset * (self._taken(high, s) - self._taken(low, s)) / (high - low))

    def _taken(self, d: Float, s: Float | float) -> Float:
        """Return phi (p,), the energy that damage from 0 to d takes, divided by W_0."""
        d, s = np.asarray(d, float), np.asarray(s)
        inside = d < 1.0
        below = np.where(inside, d, 0.0)
        u = self.opening(below, s)
        partly = 1.0 + 2.0 * s * self.area(u) - (1.0 - below) * (1.0 + s * u) ** 2
        return np.asarray(np.where(inside, partly, 1.0 + 2.0 * s * self.area(np.inf)))


@dataclass(frozen=True)
class PiecewiseLinear(CohesiveLaw):
    """A law with piecewise linear tau(u), with `heights` (m,) from 1 to 0 at the arguments `knots` (m,)."""

    knots: tuple[float, ...] = (0.0, 1.0)
    heights: tuple[float, ...] = (1.0, 0.0)

    @property
    def last(self) -> float:
        """The least argument u at which tau is 0."""
        return self.knots[self.heights.index(0.0)]

    def shape(self, u: Float) -> Float:
        """Return the relative traction tau(u) (p,) for u (p,) >= 0."""
        return np.interp(u, self.knots, self.heights)

    def area(self, u: Float | float) -> Float | float:
        """Return the integral of tau from 0 to u, for one or many u (p,)."""
        u = np.minimum(u, self.last)
        knots, heights = np.array(self.knots), np.array(self.heights)
        areas = np.concatenate([[0.0], np.cumsum(np.diff(knots) * (heights[1:] + heights[:-1]) / 2.0)])
        k = np.clip(np.searchsorted(knots, u, side="right") - 1, 0, len(knots) - 2)
        return np.asarray(areas[k] + (u - knots[k]) * (heights[k] + self.shape(np.asarray(u))) / 2.0)

    def opening(self, d: Float, s: Float | float) -> Float:
        """Return u (p,) at damage d: the root of tau(u) = (1 - d) (1 + s u), on the linear piece that contains it."""
        if len(self.knots) == 2:
            return np.asarray(d / ((1.0 - d) * s + 1.0 / self.knots[1]))
        knots, heights = np.array(self.knots), np.array(self.heights)
        intact = 1.0 - np.asarray(d)
        above = heights - intact[..., None] * (1.0 + np.asarray(s)[..., None] * knots) >= 0.0
        k = np.clip(above.sum(axis=-1) - 1, 0, len(knots) - 2)
        slope = (heights[k + 1] - heights[k]) / (knots[k + 1] - knots[k])
        # tau_k + slope (u - u_k) = intact + intact s u
        return np.asarray((heights[k] - slope * knots[k] - intact) / (intact * s - slope))


@dataclass(frozen=True)
class BilinearLaw(PiecewiseLinear):
    """A law with a traction that falls to 0 on a straight line."""


@dataclass(frozen=True)
class TableLaw(PiecewiseLinear):
    """A law by a table of tractions over openings in mode I; in other modes s stretches the table to take G_c."""

    @classmethod
    def branch(cls, value: SectionValues) -> dict[str, Any]:
        """Return the knots and heights of the table, which begins at the peak traction."""
        openings, tractions = np.array(value.common("openings")), np.array(value.common("tractions"))
        return {"knots": tuple(openings / openings[0] - 1.0), "heights": tuple(tractions / tractions[0])}


@dataclass(frozen=True)
class ExponentialLaw(CohesiveLaw):
    """A law with a traction that falls exponentially: tau = exp(-u)."""

    @property
    def last(self) -> float:
        """The argument u at which the traction has fallen to EXPONENTIAL_TAIL."""
        return -math.log(EXPONENTIAL_TAIL)

    def shape(self, u: Float) -> Float:
        """Return the relative traction exp(-u) (p,) for u (p,) >= 0."""
        return np.asarray(np.exp(-u))

    def area(self, u: Float | float) -> Float | float:
        """Return the integral of tau from 0 to u, 1 - exp(-u), for one or many u (p,)."""
        return np.asarray(-np.expm1(-np.asarray(u)))

    def opening(self, d: Float, s: Float | float) -> Float:
        """Return u (p,) at damage d: the root of u + ln(1 + s u) = -ln(1 - d), by Newton's method from below."""
        right = -np.log1p(-np.asarray(d))
        u = right / (1.0 + s)
        for _ in range(MOST_STEPS):
            step = (right - u - np.log1p(s * u)) / (1.0 + s / (1.0 + s * u))
            u = u + step
            if np.abs(step).max(initial=0.0) <= 4.0 * np.finfo(float).eps * np.abs(u).max(initial=0.0):
                break
        return np.asarray(u)
