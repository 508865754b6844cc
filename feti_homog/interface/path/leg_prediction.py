"""What comes next if the response stays as it is: the first bond that breaks, the first face that closes or opens."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.floating_bodies import admissible_share, shares_to_zero
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN, Equilibrium
from feti_homog.interface.laws.bond_law import BISECTIONS, BondLaw
from feti_homog.interface.loads.coupled_solution import CoupledSolution


def first_break(cell: CoupledInterfaces, law: BondLaw, state: Equilibrium, ahead: CoupledSolution) -> float:
    """Share of the way to `ahead` at which the first bond reaches its strength, or inf.  Collective.

    Utilisation is convex along a straight way, so below 1 here and above 1 there it passes 1 once: bisection.
    """
    here, there = cell.traction(state.solutions), cell.traction(ahead)
    utilisation = law.utilisation(cell, state.bonds)
    over = (state.status == BONDED) & (utilisation(there) > 1.0)
    step, low, high = there - here, np.zeros(len(here)), np.ones(len(here))
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
    if not interface.contact:
        return 1.0, 1.0
    solver, nodes = interface.solver, interface.nodes
    tension = np.maximum(interface.scales.force_noise(state.solution), interface.scales.force_noise(ahead))
    closed = state.status == CLOSED
    shares = [shares_to_zero(-state.solution.lam[nodes.row][closed], -ahead.lam[nodes.row][closed], tension[closed])]
    is_open, here, there = state.status == OPEN, state.solution.jump[nodes.row], ahead.jump[nodes.row]
    noise = max(interface.scales.gap_noise(state.solution.strain), interface.scales.gap_noise(ahead.strain))
    if solver.natural.unconstrained_modes.shape[1]:
        shares.append(admissible_share(solver.comm, solver.natural, nodes, is_open, here, there, noise))
    else:
        shares.append(shares_to_zero(here[is_open], there[is_open], noise))
    least = np.min(shares, axis=0)
    solver.comm.Allreduce(MPI.IN_PLACE, least, MPI.MIN)
    return float(least[0]), float(least[1])
