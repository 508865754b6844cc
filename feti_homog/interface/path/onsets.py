"""Ends of a straight response: the first break of a bond, or the first contact change.

The first bond of a linear cell breaks under tractions t0 + f t1, with load factor f.  The utilisation u is homogeneous
of degree one in the tractions, so without t0 the factor is 1 / u(t1).  With t0, some laws have a formula.  In other
laws, bonds need a search; but where u is convex along a ray, it passes 1 once, and

    (1 - u(t0)) / u(t1)  <=  f  <=  (1 + u(-t0)) / u(t1),

because u is subadditive: a bond whose lower bound exceeds the smallest upper bound breaks later, and needs no search.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from feti_homog.feti import DualSolution
from feti_homog.interface.contact import BONDED, CLOSED, OPEN, BondState, ContactProblem, CoupledInterfaces, Equilibrium
from feti_homog.interface.contact.floating_bodies import FloatingBodies, shares_to_zero
from feti_homog.interface.laws.bond_law import UTILISATION_TIE, BondLaw
from feti_homog.typing import Bool, Float, Int

# Number of parts of a step at whose ends a utilisation that is not convex is evaluated.
PARTS = 32


@dataclass(frozen=True)
class Onset:
    """The conditions for the first break in a bond state in which debonded faces do not touch.

    Attributes:
        bonds: bond law at this rank's nodes in the bond state.
        bonded: (k,) nodes with a bond.
    """

    bonds: BondLaw
    bonded: Bool

    @classmethod
    def of(cls, law: BondLaw, cell: CoupledInterfaces, bonds: BondState) -> Onset:
        """Make the law in a bond state, and mark bonded nodes.  Collective; raises like `BondLaw.in_state`."""
        return cls(law.in_state(cell, bonds), np.asarray(bonds.status == BONDED))

    def utilisation(self, traction: Float, node: Int) -> Float:
        """Return the utilisation (p,) under tractions (p, c) at the nodes with indices (p,), 0 at debonded nodes."""
        return np.where(self.bonded[node], self.bonds.at(node).share(traction), 0.0)

    def factors(self, direction: Float, noise: Float, before: Float | None = None) -> Float:
        """Return the load factors f >= 0 (n, k) that break the bonds under n traction rays; inf without a break.

        Tractions are f `direction` (n, k, c), plus `before` (k, c) if given, which breaks no bond.  Utilisations under
        `direction` up to `noise`, (n,) or (n, k), count as zero.  Bonds that break after the first may have inf.
        """
        n, k, c = direction.shape
        ray, node = np.divmod(np.arange(n * k), max(k, 1))
        along = direction.reshape(-1, c)
        used, factors = self.utilisation(along, node), np.full(n * k, np.inf)
        loaded = np.flatnonzero(used > np.broadcast_to(noise.reshape(n, -1), (n, k)).ravel())
        if before is None:
            factors[loaded] = 1.0 / used[loaded]
            return factors.reshape(n, k)
        ray, node, along, used = ray[loaded], node[loaded], along[loaded], used[loaded]
        bonds, start = self.bonds.at(node), before[node]
        exact = bonds.first_factor(start, along)
        if exact is None:
            # Bisection, without bonds that break after another bond under the same ray.
            lower, upper = (1.0 - bonds.share(start)) / used, (1.0 + bonds.share(-start)) / used
            first, is_convex = np.full(n, np.inf), bonds.convex(len(used))
            np.minimum.at(first, ray[is_convex], upper[is_convex])
            rivals = np.flatnonzero((lower <= first[ray] * (1.0 + UTILISATION_TIE)) | ~is_convex)
            low, exact = np.zeros(len(rivals)), np.full(len(used), np.inf)
            exact[rivals] = bonds.at(rivals).crossing(start[rivals], along[rivals], low, upper[rivals])
        factors[loaded] = exact
        return factors.reshape(n, k)


def first_break(cell: CoupledInterfaces, law: BondLaw, bonds: BondState, before: Float, after: Float) -> float:
    """Return the fraction of a step at which the first bond breaks, inf without a break.  Collective.

    The step leads from tractions `before` (k, c) to `after`.  A convex utilisation passes 1 at a single point, which
    bisection finds; without convexity, the first part of the step that ends with a utilisation above 1 is bisected.
    """
    law, bonded = law.in_state(cell, bonds), bonds.status == BONDED
    step, low, high = after - before, np.zeros(len(before)), np.full(len(before), np.inf)
    parts = 1 if law.convex(len(before)).all() else PARTS
    for k in range(1, parts + 1):
        passes = bonded & (law.share(before + k / parts * step) > 1.0) & np.isinf(high)
        low, high = np.where(passes, (k - 1) / parts, low), np.where(passes, k / parts, high)
    over = np.flatnonzero(np.isfinite(high))
    if len(over):
        high = law.at(over).crossing(before[over], step[over], low[over], high[over])
    return float(cell.comm.allreduce(high.min(initial=np.inf), MPI.MIN))


def first_change(interface: ContactProblem, state: Equilibrium, end: DualSolution) -> tuple[float, float]:
    """Return the fractions of the step to `end` where contact begins to change, and surely has changed.

    Both are 1 without a change.  Tension or overlap of twice the solver's error is certain.  A closed node opens when
    its force vanishes; open nodes of a fixed fibre close when their gap vanishes, open nodes of a free fibre when the
    fibre has no more room (because gaps are not unique).  Collective.
    """
    solver, nodes = interface.solver, interface.nodes
    tension = np.maximum(interface.scales.force_noise(state.solution), interface.scales.force_noise(end))
    # Damaged bonds change between tension and compression when their force vanishes.
    damaged = interface.damaged(state.bonds)
    in_contact = (state.status == CLOSED) | damaged
    pressure = np.where(damaged & ~state.bonds.pressed, 1.0, -1.0)[in_contact]
    force, force_at_end = (pressure * lam[nodes.row][in_contact] for lam in (state.solution.lam, end.lam))
    shares = [shares_to_zero(force, force_at_end, tension[in_contact])]
    is_open = (state.status == OPEN) & interface.contact  # without contact, faces may overlap
    gap, gap_at_end = state.solution.jump[nodes.row], end.jump[nodes.row]
    noise = max(interface.scales.gap_noise(state.solution.strain), interface.scales.gap_noise(end.strain))
    if interface.contact and solver.natural.unconstrained_modes.shape[1]:
        bodies = FloatingBodies(solver.comm, solver.natural, nodes, is_open, noise)
        shares.append(bodies.admissible_share(gap, gap_at_end))
    else:
        shares.append(shares_to_zero(gap[is_open], gap_at_end[is_open], noise))
    first = np.min(shares, axis=0)
    solver.comm.Allreduce(MPI.IN_PLACE, first, MPI.MIN)
    return float(first[0]), float(first[1])
