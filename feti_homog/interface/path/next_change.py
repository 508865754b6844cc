"""End of a straight response: the first bond breaks, or the contact begins to change."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.floating_bodies import admissible_share, shares_to_zero
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN, BondState, Equilibrium
from feti_homog.interface.laws.bond_law import BISECTIONS, BondLaw
from feti_homog.interface.loads.load import CoupledSolution
from feti_homog.typing import Float

# Parts of a straight way in which a utilisation that is not convex is looked at.
PARTS = 32


def first_break(cell: CoupledInterfaces, law: BondLaw, state: Equilibrium, ahead: CoupledSolution) -> float:
    """Share of the way to `ahead` at which the first bond reaches its strength, or inf.  Collective.

    Utilisation that is convex along a straight way, below 1 here and above 1 there, passes 1 once: bisection.  Others
    are bisected up to the first of some equal parts at whose end they are above 1.
    """
    return first_break_between(cell, law, state.bonds, cell.traction(state.solutions), cell.traction(ahead))


def first_break_between(cell: CoupledInterfaces, law: BondLaw, bonds: BondState, here: Float, there: Float) -> float:
    """Return the same of the way between tractions (k, c).  Collective."""
    utilisation, bonded = law.utilisation(cell, bonds), bonds.status == BONDED
    step, low, high = there - here, np.zeros(len(here)), np.full(len(here), np.inf)
    parts = 1 if utilisation.is_convex(len(here)).all() else PARTS
    for k in range(1, parts + 1):
        passes = bonded & (utilisation(here + k / parts * step) > 1.0) & np.isinf(high)
        low, high = np.where(passes, (k - 1) / parts, low), np.where(passes, k / parts, high)
    over = np.isfinite(high)
    high = np.where(over, high, 1.0)
    for _ in range(BISECTIONS if over.any() else 0):
        middle = (low + high) / 2
        broken = utilisation(here + middle[:, None] * step) > 1.0
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
        shares.append(admissible_share(solver.comm, solver.natural, nodes, is_open, here, there, noise))
    else:
        shares.append(shares_to_zero(here[is_open], there[is_open], noise))
    least = np.min(shares, axis=0)
    solver.comm.Allreduce(MPI.IN_PLACE, least, MPI.MIN)
    return float(least[0]), float(least[1])
