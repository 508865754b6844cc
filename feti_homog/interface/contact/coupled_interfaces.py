"""A cell under loads of all its problems: in the plane and, in generalized plane strain, along the fibres.

Phases have x3 as a plane of symmetry, so the problems have only the bonds in common: who is in contact is decided in
the plane, and a debonded node carries no traction along the fibre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from feti_homog.feti.decomposition.constraint_layout import InterfaceNodes
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.states import BondState, Equilibrium
from feti_homog.interface.loads.coupled_solution import CoupledSolution, Multipliers
from feti_homog.interface.loads.load import Load
from feti_homog.interface.loads.macroscopic import Macroscopic
from feti_homog.typing import Float


@dataclass(frozen=True)
class CoupledInterfaces:
    """The interfaces of a cell in its problems; strains and stresses (n,) are those of the plane problem, then those
    of the axial one.

    Attributes:
        plane: with contact.
        axial: those of the displacement along the fibres, without; None if there is none.
    """

    plane: ContactProblem
    axial: ContactProblem | None = None

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
        """Of the cell."""
        return float(self.plane.size.prod())

    @property
    def loads(self) -> tuple[str, ...]:
        """Names of the n strains."""
        return tuple(name for each in self.problems for name in each.solver.problem.loads)

    @property
    def problems(self) -> tuple[ContactProblem, ...]:
        """The interfaces of each problem."""
        return (self.plane,) if self.axial is None else (self.plane, self.axial)

    def no_multipliers(self) -> Multipliers:
        """Those of an unloaded cell."""
        along = 0 if self.axial is None else self.axial.solver.rows
        return Multipliers(np.zeros(self.plane.solver.rows), np.zeros(along))

    def linear(self, load: Load, bonds: BondState, start: Multipliers) -> CoupledSolution:
        """The dual problems with the states as they are.  Collective."""
        in_plane, along = load.parts(len(self.plane.solver.problem.loads))
        plane = self.plane.linear(in_plane, bonds, start.plane)
        return CoupledSolution(plane, None if self.axial is None else self.axial.linear(along, bonds, start.axial))

    def equilibrium(self, load: Load, bonds: BondState, start: Multipliers) -> Equilibrium:
        """The state under a load, with `bonds` a first guess of who is in contact.  Collective."""
        in_plane, along = load.parts(len(self.plane.solver.problem.loads))
        state = self.plane.equilibrium(in_plane, bonds, start.plane)
        if self.axial is None:
            return state
        return replace(state, axial=self.axial.equilibrium(along, state.bonds, start.axial))

    def leg_start(self, origin: Macroscopic, before: Load | None, end: Load) -> Load:
        """Where a leg begins: at the waypoint before, which the last point, `origin`, need not meet; components that
        are given in another way now are as that has them, stresses without the solver's error.  Collective."""
        parts = np.split(origin.strain, [len(self.plane.solver.problem.loads)])
        scales = [each.scales for each in self.problems]
        noise = [np.full(len(own), each.stress_noise(own)) for own, each in zip(parts, scales, strict=False)]
        stress = np.where(np.abs(origin.stress) > np.concatenate(noise), origin.stress, 0.0)
        values = np.where(end.by_stress, stress, origin.strain)
        if before is not None:
            values = np.where(before.by_stress == end.by_stress, before.values, values)
        return Load(values, end.by_stress)

    def traction(self, found: CoupledSolution) -> Float:
        """(k, 2) normal and tangential traction, tension positive, or (k, 3) with that along the fibre."""
        in_plane = self.plane.traction(found.plane)
        if self.axial is None or found.axial is None:
            return in_plane
        return np.hstack([in_plane, self.axial.traction(found.axial)])

    def macroscopic(self, found: CoupledSolution) -> Macroscopic:
        """Strains and stresses.  Collective."""
        pairs = [(found.plane.strain, self.plane.stress(found.plane))]
        if self.axial is not None and found.axial is not None:
            pairs.append((found.axial.strain, self.axial.stress(found.axial)))
        strains, stresses = zip(*pairs, strict=True)
        return Macroscopic(np.concatenate(strains), np.concatenate(stresses))

    def least_bonded_stress(self, strains: Float) -> Float:
        """(m, n) stresses under strains (m, n) of the least stiffness with all bonds.  Collective."""
        parts = np.split(strains, [len(self.plane.solver.problem.loads)], axis=1)
        pairs = zip(parts, self.problems, strict=False)
        return np.hstack([own @ each.scales.least_bonded_stiffness for own, each in pairs])
