"""The load at which the first bond of a linear cell breaks: tractions are t0 + f t1, f being the factor of the load.

The utilisation u is homogeneous of degree one in the tractions, so without t0 the factor is 1 / u(t1).  With t0, laws
with a formula for it use that.  Others are convex along a ray, pass 1 once, and

    (1 - u(t0)) / u(t1)  <=  f  <=  (1 + u(-t0)) / u(t1),

for u is subadditive: only bonds whose lower bound is below the least upper bound are searched.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, BondState
from feti_homog.interface.laws.bond_law import BondLaw, Utilisation
from feti_homog.interface.path.path_points import UTILISATION_TIE
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class Onset:
    """First break of the bonds of a cell whose debonded faces do not touch.

    Attributes:
        bonds: utilisation of the nodes of this rank.
        bonded: (k,) which nodes have a bond.
    """

    bonds: Utilisation
    bonded: Bool

    @classmethod
    def of(cls, law: BondLaw, cell: CoupledInterfaces, bonds: BondState) -> Onset:
        """Make the onset of a law with these bonds.  Collective."""
        return cls(law.utilisation(cell, bonds), np.asarray(bonds.status == BONDED))

    def utilisation(self, traction: Float, node: Int) -> Float:
        """(p,) share of what breaks them that tractions (p, c) at the nodes (p,) use; 0 of debonded ones."""
        return np.where(self.bonded[node], self.bonds.at(node)(traction), 0.0)

    def factors(self, ahead: Float, least: Float, before: Float | None = None) -> Float:
        """(n, k) the f >= 0 at which each bond breaks under each of n rays of tractions.

        Tractions are `before` (k, c) + f `ahead` (n, k, c); inf where none breaks, or where it is not the first by far.

        Utilisations by `ahead` of at most `least`, (n,) or (n, k), are none.  `before` alone breaks nothing.
        """
        n, k, c = ahead.shape
        ray, node = np.divmod(np.arange(n * k), max(k, 1))
        used, found = self.utilisation(ahead.reshape(-1, c), node), np.full(n * k, np.inf)
        loaded = np.flatnonzero(used > np.broadcast_to(least.reshape(n, -1), (n, k)).ravel())
        if before is None:
            found[loaded] = 1.0 / used[loaded]
        else:
            at, along = node[loaded], ahead.reshape(-1, c)[loaded]
            known = self.bonds.at(at).first_factor(before[at], along)
            rays = _Rays(before[at], along, at, ray[loaded])
            found[loaded] = self._searched(rays, used[loaded], n) if known is None else known
        return found.reshape(n, k)

    def _searched(self, rays: _Rays, used: Float, n: int) -> Float:
        """(p,) factors of bonds by halving an interval, inf of those that break later than another of their ray."""
        bonds = self.bonds.at(rays.node)
        lower, upper = (1.0 - bonds(rays.before)) / used, (1.0 + bonds(-rays.before)) / used
        first, is_convex = np.full(n, np.inf), bonds.is_convex(len(used))
        np.minimum.at(first, rays.number[is_convex], upper[is_convex])
        near = np.flatnonzero((lower <= first[rays.number] * (1.0 + UTILISATION_TIE)) | ~is_convex)
        found = np.full(len(used), np.inf)
        found[near] = bonds.at(near).crossing(rays.before[near], rays.ahead[near], upper[near])
        return found


class _Rays(NamedTuple):
    """Tractions `before` + f `ahead` (p, c) at the nodes (p,), and the number (p,) of the ray of each."""

    before: Float
    ahead: Float
    node: Int
    number: Int
