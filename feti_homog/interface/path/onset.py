"""Ends of a straight response: the first bond breaks, or the contact begins to change.

The first bond of a linear cell breaks under tractions t0 + f t1, f being the factor of the load.  The utilisation u is
homogeneous of degree one in the tractions, so without t0 the factor is 1 / u(t1).  With t0, laws with a formula for it
use that.  Others are convex along a ray, pass 1 once, and

    (1 - u(t0)) / u(t1)  <=  f  <=  (1 + u(-t0)) / u(t1),

for u is subadditive: only bonds whose lower bound is below the least upper bound are searched.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.floating_bodies import FloatingBodies, shares_to_zero
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN, BondState, Equilibrium
from feti_homog.interface.laws.bond_law import BISECTIONS, BondLaw
from feti_homog.interface.path.path_points import UTILISATION_TIE
from feti_homog.typing import Bool, Float, Int

# Parts of a straight way in which a utilisation that is not convex is looked at.
PARTS = 32


@dataclass(frozen=True)
class Onset:
    """First break of the bonds of a cell whose debonded faces do not touch.

    Attributes:
        bonds: law of the nodes of this rank in the state of the bonds.
        bonded: (k,) which nodes have a bond.
    """

    bonds: BondLaw
    bonded: Bool

    @classmethod
    def of(cls, law: BondLaw, cell: CoupledInterfaces, bonds: BondState) -> Onset:
        """Make the onset of a law with these bonds.  Collective."""
        return cls(law.in_state(cell, bonds), np.asarray(bonds.status == BONDED))

    def utilisation(self, traction: Float, node: Int) -> Float:
        """(p,) share of what breaks them that tractions (p, c) at the nodes (p,) use; 0 of debonded ones."""
        return np.where(self.bonded[node], self.bonds.at(node).share(traction), 0.0)

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
            if known is None:
                known = self._searched(before[at], along, at, ray[loaded], used[loaded], n)
            found[loaded] = known
        return found.reshape(n, k)

    def _searched(self, before: Float, ahead: Float, node: Int, ray: Int, used: Float, n: int) -> Float:
        """(p,) factors of bonds by halving an interval, inf of those that break later than another of their ray.

        Tractions are `before` + f `ahead` (p, c) at the nodes (p,) on the rays (p,) of n.
        """
        bonds = self.bonds.at(node)
        lower, upper = (1.0 - bonds.share(before)) / used, (1.0 + bonds.share(-before)) / used
        first, is_convex = np.full(n, np.inf), bonds.convex(len(used))
        np.minimum.at(first, ray[is_convex], upper[is_convex])
        near = np.flatnonzero((lower <= first[ray] * (1.0 + UTILISATION_TIE)) | ~is_convex)
        found = np.full(len(used), np.inf)
        found[near] = bonds.at(near).crossing(before[near], ahead[near], upper[near])
        return found


def first_break(cell: CoupledInterfaces, law: BondLaw, bonds: BondState, here: Float, there: Float) -> float:
    """Share of the way between tractions (k, c) at which the first bond reaches its strength, or inf.  Collective.

    Utilisation that is convex along a straight way, below 1 here and above 1 there, passes 1 once: bisection.  Others
    are bisected up to the first of some equal parts at whose end they are above 1.
    """
    law, bonded = law.in_state(cell, bonds), bonds.status == BONDED
    step, low, high = there - here, np.zeros(len(here)), np.full(len(here), np.inf)
    parts = 1 if law.convex(len(here)).all() else PARTS
    for k in range(1, parts + 1):
        passes = bonded & (law.share(here + k / parts * step) > 1.0) & np.isinf(high)
        low, high = np.where(passes, (k - 1) / parts, low), np.where(passes, k / parts, high)
    over = np.isfinite(high)
    high = np.where(over, high, 1.0)
    for _ in range(BISECTIONS if over.any() else 0):
        middle = (low + high) / 2
        broken = law.share(here + middle[:, None] * step) > 1.0
        low, high = np.where(broken, low, middle), np.where(broken, middle, high)
    return float(cell.comm.allreduce(high[over].min(initial=np.inf), MPI.MIN))


def first_change(interface: ContactProblem, state: Equilibrium, ahead: DualSolution) -> tuple[float, float]:
    """Shares of the way to `ahead` at which the contact begins to change, and at which that is beyond doubt; or 1, 1.

    Beyond doubt means that a tension or an overlap is twice what counts as the solver's error.  A closed node opens
    when its force is none; open nodes of a fibre that is held close when their gap is none, those of a free
    fibre when it has no more room (its gaps are not unique).  Collective.
    """
    solver, nodes = interface.solver, interface.nodes
    tension = np.maximum(interface.scales.force_noise(state.solution), interface.scales.force_noise(ahead))
    # Damaged bonds turn from pulled to pressed, or back, where their force is none.
    damaged = interface.damaged(state.bonds)
    at = (state.status == CLOSED) | damaged
    pressure = np.where(damaged & ~state.bonds.pressed, 1.0, -1.0)[at]
    here, there = (pressure * lam[nodes.row][at] for lam in (state.solution.lam, ahead.lam))
    shares = [shares_to_zero(here, there, tension[at])]
    # Faces without contact overlap.
    is_open = (state.status == OPEN) & interface.contact
    here, there = state.solution.jump[nodes.row], ahead.jump[nodes.row]
    noise = max(interface.scales.gap_noise(state.solution.strain), interface.scales.gap_noise(ahead.strain))
    if interface.contact and solver.natural.unconstrained_modes.shape[1]:
        shares.append(FloatingBodies(solver.comm, solver.natural, nodes, is_open, noise).admissible_share(here, there))
    else:
        shares.append(shares_to_zero(here[is_open], there[is_open], noise))
    least = np.min(shares, axis=0)
    solver.comm.Allreduce(MPI.IN_PLACE, least, MPI.MIN)
    return float(least[0]), float(least[1])
