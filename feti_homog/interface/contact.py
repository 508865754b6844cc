"""Unilateral, frictionless contact of debonded faces: the states that satisfy the KKT conditions.

A debonded node is open (gap >= 0, no force) or closed (gap = 0, force <= 0, compression).  Which, is found by
block principal pivoting (Judice & Pires, Computers & Operations Research 21, 1994) on the dual problem, which
is strictly convex: all wrong nodes change state at once while their number falls, else only the first one
does (Murty's rule), so that no cycle is possible.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from feti_homog.feti.decomposition.jump_operator import InterfaceNodes
from feti_homog.feti.dual_solution import DualSolution
from feti_homog.feti.solver import FetiSolver
from feti_homog.interface.rigid_placement import Placement, place
from feti_homog.typing import Bool, Float

Status = NDArray[np.int8]

BONDED, CLOSED, OPEN = 0, 1, 2

# Wrong by more than this many solver tolerances; below, the sign is noise.
NOISE = 10.0
# Block pivots that may pass without fewer wrong nodes than ever before.
PATIENCE = 10
# Solves after which the search is given up; the certificate then tells how far off it is.
MOST_SOLVES = 500


@dataclass(frozen=True)
class Equilibrium:
    """The cell under one macroscopic strain with the contact states that hold there.

    Attributes:
        status: (k,) BONDED, CLOSED or OPEN of the interface nodes that this rank owns.
        solution: of the last dual problem; its multipliers and jumps are those of the state.
        iterations, solves: Krylov iterations and dual problems that it took.
        loose: rigid motions that no interface force resists.
        certificate: errors of the KKT conditions: `kkt_penetration` relative to the largest imposed displacement,
            `kkt_tension` on a closed node relative to the largest traction, `kkt_complementarity`, the
            largest product of force and gap relative to the product of both scales.
    """

    status: Status
    solution: DualSolution
    iterations: int
    solves: int
    loose: int
    certificate: dict[str, float]


@dataclass
class _Pivots:
    """Block principal pivoting: who of the wrong nodes changes state."""

    comm: MPI.Intracomm
    fewest: float = np.inf
    patience: int = PATIENCE

    def choose(self, wrong: Bool, count: int) -> Bool:
        """The nodes to flip; collective."""
        if count < self.fewest:
            self.fewest, self.patience = count, PATIENCE
            return wrong
        if self.patience > 0:
            self.patience -= 1
            return wrong
        here = int(np.argmax(wrong)) if wrong.any() else -1
        rank = self.comm.allreduce(self.comm.rank if here >= 0 else self.comm.size, MPI.MIN)
        alone = np.zeros_like(wrong)
        if rank == self.comm.rank:
            alone[here] = True
        return alone


@dataclass(frozen=True)
class Interface:
    """All fibre-matrix interfaces of the torn cell.

    Attributes:
        solver: of the dual problem.
        contact: false lets debonded faces overlap.
        size: (2,) of the cell, for the scale of displacements.
    """

    solver: FetiSolver
    contact: bool
    size: Float
    nodes: InterfaceNodes = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "nodes", self.solver.jump_operator.nodes)

    def active(self, status: Status) -> Float:
        """(owned rows,) 1 for the multipliers that act: both of a bonded node, the normal one of a closed node."""
        mask = np.ones(self.solver.rows)
        mask[self.nodes.row] = status != OPEN
        mask[self.nodes.row + 1] = status == BONDED
        return mask

    def debond(self, status: Status, which: Bool, lam: Float) -> Status:
        """The status after the bonds of `which` have broken; under tension they start open."""
        force = lam[self.nodes.row]
        released = np.where((force < 0) & self.contact, CLOSED, OPEN).astype(np.int8)
        return np.where(which & (status == BONDED), released, status)

    def traction(self, solution: DualSolution) -> Float:
        """(k, 2) normal and tangential traction, tension positive."""
        pair = self.nodes.row[:, None] + np.arange(2)
        return np.asarray(solution.lam[pair] / self.nodes.length[:, None])

    def jump(self, solution: DualSolution) -> Float:
        """(k, 2) gap and slip, matrix minus fibre."""
        return np.asarray(solution.jump[self.nodes.row[:, None] + np.arange(2)])

    def linear(self, strain: Float, status: Status, start: Float) -> DualSolution:
        """The dual problem with the states as they are; `start` are first multipliers (owned rows,)."""
        self.solver.activate(self.active(status))
        return self.solver.solve(strain, start)

    def is_linear(self, status: Status) -> bool:
        """Whether no face can come to touch another; collective."""
        return not (self.contact and self.solver.comm.allreduce(bool((status != BONDED).any()), MPI.LOR))

    def equilibria(self, strains: Float, status: Status, starts: Sequence[Float]) -> list[Equilibrium]:
        """Solve a linear problem for every strain of (k, 3) together.  Collective."""
        self.solver.activate(self.active(status))
        free = self.solver.natural.unconstrained_modes.shape[1]
        solutions = self.solver.solve_many(strains, np.stack(starts, axis=1))
        return [Equilibrium(status, s, s.iterations, 1, free, self._certificate(status, s)) for s in solutions]

    def equilibrium(self, strain: Float, status: Status, start: Float) -> Equilibrium:
        """Solve for the strain (3,), with `status` a first guess of who is in contact.  Collective."""
        comm, pivots = self.solver.comm, _Pivots(self.solver.comm)
        iterations = solves = 0
        while True:
            solution = self.linear(strain, status, start)
            iterations, solves = iterations + solution.iterations, solves + 1
            loose = Placement.none(len(status))
            if self.contact and self.solver.natural.unconstrained_modes.shape[1]:
                loose = place(comm, self.solver.natural, self.nodes, status == OPEN, solution, self._tolerance(strain))
                solution = replace(
                    solution, alpha=solution.alpha + loose.alpha, jump=solution.jump + loose.jump(self.solver.natural)
                )
            wrong = self._wrong(status, solution) | loose.squeezed if self.contact else np.zeros(len(status), bool)
            count = comm.allreduce(int(wrong.sum()))
            if count == 0 or solves == MOST_SOLVES or solution.reason < 0:
                break
            flip = pivots.choose(wrong, count)
            status = np.where(flip, CLOSED + OPEN - status, status).astype(np.int8)
            start = solution.lam
        free = self.solver.natural.unconstrained_modes.shape[1]
        return Equilibrium(status, solution, iterations, solves, free, self._certificate(status, solution))

    def _tolerance(self, strain: Float) -> float:
        """Gaps smaller than this are noise."""
        return NOISE * self.solver.rtol * self.imposed(strain)

    def imposed(self, strain: Float) -> float:
        """Largest displacement E y that the strain imposes on the cell."""
        E = np.array([[strain[0], strain[2] / 2], [strain[2] / 2, strain[1]]])
        corners = self.size * np.array([[1, 0], [0, 1], [1, 1]])
        return float(np.abs(corners @ E).max())

    def _wrong(self, status: Status, solution: DualSolution) -> Bool:
        force, gap = solution.lam[self.nodes.row], solution.jump[self.nodes.row]
        largest = self.solver.comm.allreduce(np.abs(solution.lam).max(initial=0.0), MPI.MAX)
        pulled = (status == CLOSED) & (force > NOISE * self.solver.rtol * largest)
        return pulled | ((status == OPEN) & (gap < -self._tolerance(solution.strain)))

    def _certificate(self, status: Status, solution: DualSolution) -> dict[str, float]:
        traction, gap = self.traction(solution), solution.jump[self.nodes.row]
        force = solution.lam[self.nodes.row]
        faces = (status != BONDED) & self.contact
        worst = np.array(
            [
                np.where(faces, -gap, 0.0).max(initial=0.0),
                np.where(faces & (status == CLOSED), traction[:, 0], 0.0).max(initial=0.0),
                np.where(faces, np.abs(force * gap), 0.0).max(initial=0.0),
                np.abs(traction).max(initial=0.0),
                np.abs(force).max(initial=0.0),
            ]
        )
        self.solver.comm.Allreduce(MPI.IN_PLACE, worst, MPI.MAX)
        penetration, tension, product, largest_traction, largest_force = (float(w) for w in worst)
        scale = self.imposed(solution.strain) or 1.0
        return {
            "kkt_penetration": penetration / scale,
            "kkt_tension": tension / (largest_traction or 1.0),
            "kkt_complementarity": product / ((largest_force or 1.0) * scale),
        }
