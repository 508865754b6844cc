"""The load at which the first bond of a linear cell breaks: tractions are t0 + f t1, f being the factor of the load.

Utilisation is homogeneous of degree one in the tractions, so without t0 the factor is 1 / utilisation(t1).  With t0,
strengths have closed forms.  Energies of springs are a convex function u along a ray, which passes 1 once, and

    (1 - u(t0)) / u(t1)  <=  f  <=  (1 + u(-t0)) / u(t1),

for u is subadditive: only bonds whose lower bound is below the least upper bound are searched.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.interface.contact.contact_problem import BONDED, Status
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.laws.bond_criterion import BondCriterion
from feti_homog.interface.laws.energy_criterion import EnergyCriterion
from feti_homog.interface.laws.strength_criterion import StrengthCriterion
from feti_homog.interface.laws.tip_criterion import TipCriterion, Tips
from feti_homog.interface.path.leg_prediction import BISECTIONS
from feti_homog.interface.path.path_points import UTILISATION_TIE
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class TipEnergies:
    """What the breaks of bonds beside debonded arcs release, whose faces do not touch.

    Attributes:
        number: (k,) of the tip that a node is, or -1.
        tips: they.
    """

    number: Int
    tips: Tips

    def utilisation(self, springs: EnergyCriterion, traction: Float, tip: Int) -> Float:
        """(p,) sqrt of what the breaks of bonds release / (G_c l), for tractions (p, c) at the tips (p,), of which
        `springs` are."""
        tips = self.tips.chosen(tip)
        released = tips.released(traction, contact=False)
        return np.asarray(np.sqrt(released / (springs.toughness * tips.length)) * springs.mode_factor(traction))


@dataclass(frozen=True)
class OnsetCriterion:
    """What breaks the bonds of a cell whose debonded faces do not touch.

    Attributes:
        bonds: strengths, or energies of springs.
        bonded: (k,) which nodes of this rank have a bond.
        tips: where what a break releases counts instead.
    """

    bonds: StrengthCriterion | EnergyCriterion
    bonded: Bool
    tips: TipEnergies | None

    @classmethod
    def of(cls, criterion: BondCriterion, cell: CoupledInterfaces, status: Status) -> OnsetCriterion:
        """That of a criterion with these bonds.  Collective."""
        bonded = np.asarray(status == BONDED)
        if not isinstance(criterion, TipCriterion):
            return cls(criterion, bonded, None)
        tips = criterion.tips(cell, status)
        number = np.full(len(status), -1)
        number[tips.node] = np.arange(len(tips.node))
        return cls(criterion.springs, bonded, TipEnergies(number, tips))

    def utilisation(self, traction: Float, node: Int) -> Float:
        """(p,) share of what breaks them that tractions (p, c) at the nodes (p,) use; 0 of debonded ones."""
        bonds = self.bonds.at(node)
        used = bonds.utilisation(traction)
        if self.tips is not None and isinstance(bonds, EnergyCriterion):
            tip = self.tips.number[node]
            at = np.flatnonzero(tip >= 0)
            used[at] = self.tips.utilisation(bonds.at(at), traction[at], tip[at])
        return np.where(self.bonded[node], used, 0.0)

    def factors(self, ahead: Float, least: Float, before: Float | None = None) -> Float:
        """(n, k) the f >= 0 at which each bond breaks under each of n rays of tractions `before` (k, c) + f `ahead`
        (n, k, c); inf where none does, or where it is not the first by far.

        Utilisations by `ahead` of at most `least`, (n,) or (n, k), are none.  `before` alone breaks nothing.
        """
        n, k, c = ahead.shape
        ray, node = np.divmod(np.arange(n * k), max(k, 1))
        used, found = self.utilisation(ahead.reshape(-1, c), node), np.full(n * k, np.inf)
        loaded = np.flatnonzero(used > np.broadcast_to(least.reshape(n, -1), (n, k)).ravel())
        if before is None:
            found[loaded] = 1.0 / used[loaded]
        elif isinstance(self.bonds, StrengthCriterion):
            bonds = self.bonds.at(node[loaded])
            found[loaded] = bonds.factor(before[node[loaded]], ahead.reshape(-1, c)[loaded])
        else:
            rays = _Rays(before[node[loaded]], ahead.reshape(-1, c)[loaded], node[loaded], ray[loaded])
            found[loaded] = self._searched(rays, used[loaded], n)
        return found.reshape(n, k)

    def _searched(self, rays: _Rays, used: Float, n: int) -> Float:
        """(p,) factors of bonds by halving an interval, inf of those that break later than another of their ray."""
        lower = (1.0 - self.utilisation(rays.before, rays.node)) / used
        upper = (1.0 + self.utilisation(-rays.before, rays.node)) / used
        is_tip = np.zeros(len(used), bool) if self.tips is None else self.tips.number[rays.node] >= 0
        first = np.full(n, np.inf)
        np.minimum.at(first, rays.number[~is_tip], upper[~is_tip])
        near = np.flatnonzero((lower <= first[rays.number] * (1.0 + UTILISATION_TIE)) | is_tip)
        found, rays = np.full(len(used), np.inf), rays.chosen(near)
        low, high = np.zeros(len(near)), upper[near]
        for _ in range(BISECTIONS):  # what a tip releases need not be subadditive
            below = self.utilisation(rays.at(high), rays.node) < 1.0
            if not below.any():
                break
            high[below] *= 2.0
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            broken = self.utilisation(rays.at(middle), rays.node) > 1.0
            low, high = np.where(broken, low, middle), np.where(broken, middle, high)
        found[near] = high
        return found


@dataclass(frozen=True)
class _Rays:
    """Tractions `before` + f `ahead` (p, c) at the nodes (p,), and the number (p,) of the ray of each."""

    before: Float
    ahead: Float
    node: Int
    number: Int

    def at(self, factor: Float) -> Float:
        return np.asarray(self.before + factor[:, None] * self.ahead)

    def chosen(self, which: Int) -> _Rays:
        return _Rays(self.before[which], self.ahead[which], self.node[which], self.number[which])
