"""The interfaces of a cell under plane loads and, in generalized plane strain, loads along the fibres.

Phases are symmetric about x3 = 0, so the problems share only the bonds: the plane problem decides contact, and a
debonded node carries no traction along the fibre.

The damaged fraction of a bond has friction (Alfano & Sacco, 2006).  At damage d, slip s and stiffness K, the fraction
1 - d bears (1 - d) K s.  The fraction d slides by s_i and bears f = K (s - s_i), bounded by Coulomb's law with the full
pressure.  With g = d s_i and spring compliances C, intact C_0, the bond is the intact spring in series with a face with
the jump g, the spring 1 / (C - C_0) and the force f: lam = g / (C - C_0) + f, s = C_0 lam + g.  `DualSolution.jump` is
r = s - C lam.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from feti_homog.feti import DualSolution
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.states import BONDED, BondState, Equilibrium
from feti_homog.interface.loads import Load, Macroscopic, Multipliers
from feti_homog.typing import Float


class CoupledInterfaces:
    """The interfaces that the plane and axial problems of a cell share.

    Strains and stresses (n,) have the plane components first, then the axial components.

    Attributes:
        plane: plane problem, with contact.
        problems: `plane` and, in generalized plane strain, the axial problem, without contact.
        comm, nodes: communicator of all ranks, and the interface nodes of this rank.
        area: cell area.
        loads: names of the n strains.
    """

    def __init__(self, plane: ContactProblem, *axial: ContactProblem) -> None:
        self.plane, self.problems = plane, (plane, *axial)
        self.comm, self.nodes, self.area = plane.solver.comm, plane.nodes, float(plane.size.prod())
        self.loads: tuple[str, ...] = sum((problem.solver.problem.loads for problem in self.problems), ())

    def no_multipliers(self) -> Multipliers:
        """Return the zero multipliers of an unloaded cell."""
        return tuple(np.zeros(problem.solver.rows) for problem in self.problems)

    def linear(self, load: Load, bonds: BondState, start: Multipliers) -> tuple[DualSolution, ...]:
        """Solve each dual problem from its multipliers in `start`, like `ContactProblem.linear`.  Collective."""
        triples = zip(self.problems, self.parts(load), start, strict=True)
        return tuple(problem.linear(part, bonds, lam) for problem, part, lam in triples)

    def equilibrium(self, load: Load, bonds: BondState, start: Multipliers) -> Equilibrium:
        """Find the equilibrium under a load, like `ContactProblem.equilibrium`.  Collective."""
        loads = self.parts(load)
        state = self.plane.equilibrium(loads[0], bonds, start[0])
        for axial, along, lam in zip(self.problems[1:], loads[1:], start[1:], strict=True):
            state = replace(state, axial=axial.equilibrium(along, state.bonds, lam))
        return state

    def completed(self, state: Equilibrium) -> Equilibrium:
        """Return the state with amplitudes and jumps in all problems, as in `ContactProblem.completed`.  Collective."""
        axial = None if state.axial is None else self.problems[1].completed(state.axial)
        return replace(self.plane.completed(state), axial=axial)

    def parts(self, load: Load) -> list[Load]:
        """Split a load into one load for each problem."""
        return load.parts([len(problem.solver.problem.loads) for problem in self.problems])

    def leg_start(self, origin: Macroscopic, before: Load | None, end: Load) -> Load:
        """Return the load at the beginning of the path leg to waypoint `end`.  Collective.

        The load has the values of the waypoint `before`.  Without `before`, or if a component changes between strain
        and stress, the value comes from the last point, `origin`; a stress within the solver's error counts as 0.
        """
        parts = np.split(origin.strain, [len(self.plane.solver.problem.loads)])
        pairs = zip(parts, self.problems, strict=False)
        scales = [np.full(len(strain), problem.scales.stress_scale(strain)) for strain, problem in pairs]
        noise = self.plane.scales.sign_noise * np.concatenate(scales)
        stress = np.where(np.abs(origin.stress) > noise, origin.stress, 0.0)
        values = np.where(end.by_stress, stress, origin.strain)
        if before is not None:
            values = np.where(before.by_stress == end.by_stress, before.values, values)
        return Load(values, end.by_stress)

    def traction(self, solutions: Sequence[DualSolution]) -> Float:
        """Return the traction (k, c), tension positive: normal, tangential and, if c = 3, axial."""
        return np.hstack([problem.traction(s) for problem, s in zip(self.problems, solutions, strict=True)])

    def macroscopic(self, solutions: Sequence[DualSolution]) -> Macroscopic:
        """Return the macroscopic strains and stresses of the solutions.  Collective."""
        stresses = [problem.stress(solution) for problem, solution in zip(self.problems, solutions, strict=True)]
        return Macroscopic(np.concatenate([solution.strain for solution in solutions]), np.concatenate(stresses))


def slipped(interface: ContactProblem, state: Equilibrium) -> Float:
    """Return r = s - C lam (owned rows,), by which slips of damaged bonds exceed their springs' slips; elsewhere 0."""
    r = np.zeros(interface.solver.rows)
    if state.bonds.gap_and_slip is not None and interface.solver.jump_operator.components > 1:
        rows = interface.nodes.row[state.status == BONDED] + 1
        rows = rows[state.solution.compliance[rows] > interface.solver.intact_compliance[rows]]
        r[rows] = state.solution.jump[rows]
    return r


def energy_beside_springs(interface: ContactProblem, state: Equilibrium) -> float:
    """Return by how much twice the energy of this rank's damaged bonds exceeds lam C lam; 0 without friction.

    Twice the energy of a bond, C_0 lam^2 + g^2 / (C - C_0), exceeds lam C lam by r^2 / (C - C_0) + 2 r lam.
    """
    r, gained = slipped(interface, state), state.solution.compliance - interface.solver.intact_compliance
    rows = np.flatnonzero(r)
    return float(r[rows] @ (r[rows] / gained[rows] + 2.0 * state.solution.lam[rows]))


def held_traction(cell: CoupledInterfaces, state: Equilibrium) -> Float:
    """Return the traction (k, c) in the intact fraction of bonds, where a damaged bond has the shear force s / C."""
    traction, r = cell.traction(state.solutions), slipped(cell.plane, state)[cell.nodes.row + 1]
    nodes = np.flatnonzero(r)
    C = state.solution.compliance[cell.nodes.row[nodes] + 1]
    traction[nodes, 1] += r[nodes] / C / cell.nodes.length[nodes]
    return traction
