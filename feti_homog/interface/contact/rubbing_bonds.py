"""Damaged bonds that hold while their damaged share rubs, after Alfano & Sacco (2006).

At damage d and total slip s, stiffness K, the share 1 - d bears (1 - d) K s, and the other f = K (s - s_i), bounded by
Coulomb's law with the whole pressure.  With g = d s_i that is a face of the jump g on the spring 1 / (C - C_0) of the
damage, whose force beside it is f:  lam = g / (C - C_0) + f,  s = C_0 lam + g.  The solution has r = s - C lam.
"""

from __future__ import annotations

import numpy as np

from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, Equilibrium
from feti_homog.typing import Float


def slipped(interface: ContactProblem, state: Equilibrium) -> Float:
    """(owned rows,) r of the tangential rows of damaged bonds, 0 elsewhere, and on paths without friction."""
    r = np.zeros(interface.solver.rows)
    if state.bonds.gap_and_slip is not None and interface.solver.jump_operator.components > 1:
        rows = interface.nodes.row[state.status == BONDED] + 1
        rows = rows[state.solution.compliance[rows] > interface.solver.intact_compliance[rows]]
        r[rows] = state.solution.jump[rows]
    return r


def energy_beside_springs(interface: ContactProblem, state: Equilibrium) -> float:
    """Return what C_0 lam^2 + g^2 / (C - C_0) is more than lam C lam on this rank: r^2 / (C - C_0) + 2 r lam."""
    r, more = slipped(interface, state), state.solution.compliance - interface.solver.intact_compliance
    own = np.flatnonzero(r)
    return float(r[own] @ (r[own] / more[own] + 2.0 * state.solution.lam[own]))


def held_traction(cell: CoupledInterfaces, state: Equilibrium) -> Float:
    """(k, c) traction of the nodes of this rank; of damaged bonds s / C, that of the share that holds."""
    traction, r = cell.traction(state.solutions), slipped(cell.plane, state)[cell.nodes.row + 1]
    own = np.flatnonzero(r)
    C = state.solution.compliance[cell.nodes.row[own] + 1]
    traction[own, 1] += r[own] / C / cell.nodes.length[own]
    return traction
