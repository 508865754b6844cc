"""A cell under loads of all its problems: in the plane and, in generalized plane strain, along the fibres.

Phases have x3 as a plane of symmetry, so the problems have only the bonds in common: who is in contact is decided in
the plane, and a debonded node carries no traction along the fibre.

Damaged bonds hold while their damaged share rubs, after Alfano & Sacco (2006).  At damage d and total slip s, stiffness
K, the share 1 - d bears (1 - d) K s, and the other f = K (s - s_i), bounded by Coulomb's law with the whole pressure.
With g = d s_i that is a face of the jump g on the spring 1 / (C - C_0) of the damage, whose force beside it is f:
lam = g / (C - C_0) + f,  s = C_0 lam + g.  The solution has r = s - C lam.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from feti_homog.feti.decomposition.constraint_layout import InterfaceNodes
from feti_homog.feti.dual_solution import DualSolution
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.states import BONDED, BondState, Equilibrium
from feti_homog.interface.loads import Load, Macroscopic, Multipliers
from feti_homog.typing import Float


class CoupledInterfaces:
    """The interfaces of a cell in its problems.

    Strains and stresses (n,) are those of the plane problem, then those of the axial one.

    Attributes:
        plane: with contact.
        problems: `plane` and, where there is one, that of the displacement along the fibres, without contact.
    """

    def __init__(self, plane: ContactProblem, *axial: ContactProblem) -> None:
        self.plane, self.problems = plane, (plane, *axial)

    @property
    def comm(self) -> MPI.Intracomm:
        """All ranks."""
        return self.plane.solver.comm

    @property
    def nodes(self) -> InterfaceNodes:
        """Interface nodes that this rank owns."""
        return self.plane.nodes

    @property
    def area(self) -> float:
        """Area of the cell."""
        return float(self.plane.size.prod())

    @property
    def loads(self) -> tuple[str, ...]:
        """Names of the n strains."""
        return tuple(name for each in self.problems for name in each.solver.problem.loads)

    def no_multipliers(self) -> Multipliers:
        """Return those of an unloaded cell."""
        return tuple(np.zeros(each.solver.rows) for each in self.problems)

    def linear(self, load: Load, bonds: BondState, start: Multipliers) -> tuple[DualSolution, ...]:
        """Return the dual problems with the states as they are. Collective."""
        triples = zip(self.problems, self.parts(load), start, strict=True)
        return tuple(each.linear(own, bonds, lam) for each, own, lam in triples)

    def equilibrium(self, load: Load, bonds: BondState, start: Multipliers) -> Equilibrium:
        """Return the state under a load, with `bonds` a first guess of who is in contact. Collective."""
        loads = self.parts(load)
        state = self.plane.equilibrium(loads[0], bonds, start[0])
        for axial, along, lam in zip(self.problems[1:], loads[1:], start[1:], strict=True):
            state = replace(state, axial=axial.equilibrium(along, state.bonds, lam))
        return state

    def completed(self, state: Equilibrium) -> Equilibrium:
        """Return a state with the amplitudes and jumps that F lambda gives, where it has none.  Collective."""
        plane, *others = state.problems
        pairs = zip(self.problems[1:], others, strict=False)
        axial = next((each.completed(own) for each, own in pairs), None)
        return replace(self.plane.completed(plane), axial=axial)

    def parts(self, load: Load) -> list[Load]:
        """Return the load of each problem."""
        return load.parts([len(each.solver.problem.loads) for each in self.problems])

    def leg_start(self, origin: Macroscopic, before: Load | None, end: Load) -> Load:
        """Return the begin of a leg, the waypoint before, which the last point, `origin`, need not meet.  Collective.

        Components that are given in another way now are as that has them, stresses without the solver's error.
        """
        parts = np.split(origin.strain, [len(self.plane.solver.problem.loads)])
        scales = [each.scales for each in self.problems]
        noise = [np.full(len(own), each.stress_noise(own)) for own, each in zip(parts, scales, strict=False)]
        stress = np.where(np.abs(origin.stress) > np.concatenate(noise), origin.stress, 0.0)
        values = np.where(end.by_stress, stress, origin.strain)
        if before is not None:
            values = np.where(before.by_stress == end.by_stress, before.values, values)
        return Load(values, end.by_stress)

    def traction(self, solutions: Sequence[DualSolution]) -> Float:
        """(k, 2) normal and tangential traction, tension positive, or (k, 3) with that along the fibre."""
        return np.hstack([each.traction(own) for each, own in zip(self.problems, solutions, strict=True)])

    def macroscopic(self, solutions: Sequence[DualSolution]) -> Macroscopic:
        """Strains and stresses.  Collective."""
        stresses = [each.stress(own) for each, own in zip(self.problems, solutions, strict=True)]
        return Macroscopic(np.concatenate([own.strain for own in solutions]), np.concatenate(stresses))

    def least_bonded_stress(self, strains: Float) -> Float:
        """(m, n) stresses under strains (m, n) of the least stiffness with all bonds.  Collective."""
        parts = np.split(strains, [len(self.plane.solver.problem.loads)], axis=1)
        pairs = zip(parts, self.problems, strict=False)
        return np.hstack([own @ each.scales.least_bonded_stiffness for own, each in pairs])


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
