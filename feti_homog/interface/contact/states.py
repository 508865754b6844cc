"""Interface states: bonds with memory, the equilibrium under one load, and the KKT certificate.

The certificate (`kkt_errors`, `coulomb_errors`) measures how well a state satisfies the conditions of contact and of
friction, independent of the search that found the state.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from feti_homog.feti import DualSolution
from feti_homog.interface.loads import Load, LoadScales, Multipliers
from feti_homog.typing import Bool, Float

Status = NDArray[np.int8]


class Contact(IntEnum):
    """The contact state of an interface node: bonded, or debonded with faces that touch or are apart."""

    BONDED = 0
    CLOSED = 1
    OPEN = 2


BONDED, CLOSED, OPEN = Contact


@dataclass(frozen=True)
class BondState:
    """The state of this rank's k interface nodes.

    Attributes:
        status: (k,) BONDED, CLOSED (debonded faces touch) or OPEN (debonded faces are apart).
        history: (k, h) internal variables of the bond law, from its `begin`; h = 0 without memory.
        pressed: (k,) bonds under compression, with the normal stiffness of undamaged bonds.
        gap_and_slip: (k, 2) with friction, jumps of debonded faces and the jumps that damage adds to bonds, 0 at intact
            bonds; None without friction.
        sliding: (k,) sign with which the slip grows, 0 at nodes that do not slide; None without friction.
    """

    status: Status
    history: Float
    pressed: Bool
    gap_and_slip: Float | None = None
    sliding: Status | None = None

    @property
    def sliding_signs(self) -> Status:
        """The signs `sliding` (k,), 0 without friction."""
        return np.zeros(len(self.status), np.int8) if self.sliding is None else self.sliding

    def flipped(self, which: Bool) -> BondState:
        """Return the bonds with the opposite contact state at the nodes in the mask `which` (k,).

        Debonded nodes open or close; pulled bonds become pressed, and pressed bonds pulled.
        """
        bonded = self.status == BONDED
        status = np.where(which & ~bonded, CLOSED + OPEN - self.status, self.status).astype(np.int8)
        return replace(self, status=status, pressed=self.pressed ^ (which & bonded))

    def differs(self, other: BondState) -> Bool:
        """Mark the nodes (k,) whose contact state, status or pressure, differs from the state in `other`."""
        return np.asarray((self.status != other.status) | (self.pressed != other.pressed))


@dataclass(frozen=True)
class Equilibrium:
    """The equilibrium of the cell under one load.

    Attributes:
        load: prescribed load.
        bonds: states of this rank's interface nodes.
        solution: dual solution of the last solve.
        iterations, solves: numbers of Krylov iterations and dual problems.
        free_motions: number of rigid motions that no interface force resists.
        certificate: errors by `kkt_errors`; with friction also `kkt_friction`.
        asked: (v,) sizes of the strains that the load causes in the bonded cell; with friction, the largest sizes for
            all loads up to this load.
        axial: equilibrium along the fibres with the same bonds, in generalized plane strain; else None.
    """

    load: Load
    bonds: BondState
    solution: DualSolution
    iterations: int
    solves: int
    free_motions: int
    certificate: dict[str, float]
    asked: Float
    axial: Equilibrium | None = None

    @property
    def status(self) -> Status:
        """The contact status (k,) of the nodes."""
        return self.bonds.status

    @property
    def problems(self) -> tuple[Equilibrium, ...]:
        """The equilibrium of each problem, the plane problem first."""
        return (self,) if self.axial is None else (self, self.axial)

    @property
    def solutions(self) -> tuple[DualSolution, ...]:
        """The dual solution of each problem."""
        return tuple(state.solution for state in self.problems)

    @property
    def multipliers(self) -> Multipliers:
        """The multipliers of each problem."""
        return tuple(solution.lam for solution in self.solutions)

    @property
    def converged(self) -> bool:
        """Whether the Krylov method converged in all problems."""
        return all(solution.reason > 0 for solution in self.solutions)


def kkt_errors(
    scales: LoadScales, traction: Float, gap: Float, debonded: Bool, closed: Bool, acting: Float
) -> dict[str, float]:
    """Measure the largest violations of the KKT conditions on debonded faces, absolute if no load acts.  Collective.

    `kkt_penetration` measures gap >= 0: -gap relative to the imposed displacement.  `kkt_tension` measures force <= 0:
    the normal force of a closed node relative to the interface's largest traction times its longest tributary length.
    `kkt_complementarity` measures force gap = 0: |force gap| relative to the interface's largest force times the
    displacement.  Scales of traction are at least the imposed stress: without forces, tractions are rounding errors.

    Args:
        traction, gap: (k, 2) normal and tangential traction at this rank's nodes, tension positive, and (k,) gap.
        debonded, closed: (k,) nodes that have to satisfy the conditions, and nodes with faces that touch.
        acting: (v,) sizes of the loads that impose displacement and stress.
    """
    comm, length = scales.solver.comm, scales.solver.jump_operator.nodes.length
    stress, over_interface = scales.bond_stress(acting), scales.over_interface
    force = traction[:, 0] * length
    largest_traction = np.maximum(over_interface(np.abs(traction).max(axis=1, initial=0.0)), stress)
    largest_force = np.maximum(over_interface(np.abs(force)), stress * over_interface(length))
    # If no load acts, errors are absolute.
    displacement = scales.imposed(acting) or 1.0
    largest_traction, largest_force = (np.where(size > 0.0, size, 1.0) for size in (largest_traction, largest_force))
    penetration = np.where(debonded, -gap, 0.0).max(initial=0.0) / displacement
    tension = np.where(debonded & closed, force / (largest_traction * scales.longest), 0.0).max(initial=0.0)
    work = np.where(debonded, np.abs(force * gap) / (largest_force * displacement), 0.0).max(initial=0.0)
    worst = np.array([penetration, tension, work])
    comm.Allreduce(MPI.IN_PLACE, worst, MPI.MAX)
    return dict(zip(("kkt_penetration", "kkt_tension", "kkt_complementarity"), worst.tolist(), strict=True))


def coulomb_errors(force: Float, friction: Float, sliding: Status) -> Float:
    """Measure by how much each node's tractions (k,) violate Coulomb's law.

    For shear t and pressure p: |t| <= mu p in stick, t = s mu p in slip; along the fibres any shear violates the law.

    Args:
        force: (k, c) normal, tangential and axial traction of faces, without the springs of damaged bonds.
        friction, sliding: (k,) mu, and the sign s with which the slip grows, 0 for faces that stick.
    """
    limit, shear = friction * np.maximum(-force[:, 0], 0.0), force[:, 1]
    excess = np.where(sliding == 0, np.maximum(np.abs(shear) - limit, 0.0), np.abs(sliding * shear - limit))
    along = np.abs(force[:, 2:]).max(axis=1, initial=0.0)
    return np.asarray(np.maximum(excess, along))
