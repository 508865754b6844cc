"""Unilateral, frictionless contact of debonded faces: the states that satisfy the KKT conditions.

A debonded node is open (gap >= 0, no force) or closed (gap = 0, force <= 0, compression).  Block principal pivoting
(Judice & Pires, Computers & Operations Research 21, 1994) on the strictly convex dual problem finds its state: all
wrong nodes change at once while their number falls, else only the first one (Murty's rule).  Without free fibres the
gaps are q + A p with contact pressures p and a positive definite A, so that no set of states returns and the search
ends.  With free fibres A is semi-definite, and an end is not proven.

A damaged bond is pulled (compliance C, force >= 0) or pressed (compliance C_0 as without damage, force <= 0).  With
s = jump - C_0 force >= 0 and w = s / (C - C_0) - force >= 0, s w = 0: the conditions of a debonded node, for which C is
infinite.  So one search finds both.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from mpi4py import MPI

from feti_homog.errors import NotCarriedError
from feti_homog.feti import DualSolution, FetiSolver
from feti_homog.feti.decomposition import constraint_layout
from feti_homog.interface.contact.load_scales import LoadScales
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN, BondState, Equilibrium, Status, kkt_errors
from feti_homog.interface.loads import Load
from feti_homog.typing import Bool, Float, Int

# Smallest squared amplitude with which a body takes part in new motions of size one.
LEAST_SHARE_OF_MOTION = 1e-6
# Block pivots in a row, from the last progress on: ten without progress are usual in the literature.
BLOCK_PIVOTS = 11
# Dual problems after which the search stops, with errors in its certificate.
MAX_CONTACT_SOLVES = 500


@dataclass(frozen=True)
class ContactProblem:
    """All interfaces of the torn cell.

    Attributes:
        solver: dual solver.
        contact: false lets debonded faces overlap; damaged bonds are stiff under pressure all the same.
        size: (2,) cell size, a scale of displacements.
        softening: maps bonds, and (k,) True for tension, to C / C_0 (k, 3) of springs, or None if all are 1.
        block_pivots: number of block pivots, from the last progress on, before single nodes change; 0 begins with
            single nodes.
    """

    solver: FetiSolver
    contact: bool
    size: Float
    softening: Callable[[BondState, Bool], Float | None] | None = None
    block_pivots: int = BLOCK_PIVOTS
    _kept: list[tuple[BondState, tuple[Float, Float] | None]] = field(default_factory=list, compare=False, repr=False)

    @property
    def nodes(self) -> constraint_layout.InterfaceNodes:
        """Interface nodes that this rank owns."""
        return self.solver.jump_operator.nodes

    def active(self, status: Status) -> Float:
        """(owned rows,) 1 for active multipliers: all at a bonded node, the normal one at a closed node."""
        mask = np.ones(self.solver.rows)
        mask[self._pairs] = (status == BONDED)[:, None]
        if self.contact:
            mask[self.nodes.row] = status != OPEN
        return mask

    def prepare(self, bonds: BondState) -> None:
        """Adapt the dual problem to these bonds.  Collective."""
        self.solver.set_state(self.active(bonds.status), self.compliance(bonds))

    def compliance(self, bonds: BondState) -> Float:
        """(owned rows,) spring compliance C with these bonds."""
        C, factors = self.solver.intact_compliance, self._factors(bonds)
        if factors is None:
            return C
        # Normal and tangential springs belong to the plane problem, axial ones to the axial problem.
        columns = slice(2) if self.solver.jump_operator.components == 2 else slice(2, 3)
        C = C.copy()
        C[self._pairs] *= np.where(bonds.pressed[:, None], factors[1], factors[0])[:, columns]
        return C

    def _factors(self, bonds: BondState) -> tuple[Float, Float] | None:
        """(k, 3) C / C_0 of pulled and of pressed bonds; None without softening.  The last are stored."""
        if not (self._kept and self._kept[0][0] is bonds):
            pulled, soft, stiff = np.ones(len(bonds.status), bool), None, None
            if self.softening is not None:
                soft, stiff = self.softening(bonds, pulled), self.softening(bonds, ~pulled)
            self._kept[:] = [(bonds, None if soft is None or stiff is None else (soft, stiff))]
        return self._kept[0][1]

    def _gained(self, bonds: BondState) -> Float:
        """(k,) normal compliance of damaged bonds in tension minus compression; 0 at other nodes, and along fibres."""
        factors = self._factors(bonds)
        if factors is None or self.solver.jump_operator.components != 2:
            return np.zeros(len(bonds.status))
        C = self.solver.intact_compliance[self.nodes.row]
        return np.where(bonds.status == BONDED, C * (factors[0] - factors[1])[:, 0], 0.0)

    def damaged(self, bonds: BondState) -> Bool:
        """(k,) damaged bonds, softer under tension than under compression."""
        return self._gained(bonds) > 0.0

    def debond(self, status: Status, which: Bool, lam: Float) -> Status:
        """Return the status after the bonds `which` broke; under tension they start open."""
        force = lam[self.nodes.row]
        released = np.where((force < 0) & self.contact, CLOSED, OPEN).astype(np.int8)
        return np.where(which & (status == BONDED), released, status)

    def traction(self, solution: DualSolution) -> Float:
        """(k, c) traction: normal and tangential, tension positive; or along the fibre."""
        return np.asarray(solution.lam[self._pairs] / self.nodes.length[:, None])

    def jump(self, solution: DualSolution) -> Float:
        """(k, c) gap and slip, matrix minus fibre; or slip along the fibre."""
        return np.asarray(solution.opening[self._pairs])

    def stress(self, solution: DualSolution) -> Float:
        """(v,) Sigma, and work conjugates of other loads, from the multipliers alone.  Collective."""
        return np.asarray(self.solver.stress_integral(solution) / self.size.prod())

    @cached_property
    def scales(self) -> LoadScales:
        """Scales of load effects.  Its properties, when first used, and methods are collective."""
        return LoadScales(self.solver, self.size)

    @cached_property
    def _pairs(self) -> Int:
        """(k, c) rows of the bonds."""
        return self.nodes.row[:, None] + np.arange(self.solver.jump_operator.components)

    def linear(self, load: Load, bonds: BondState, start: Float) -> DualSolution:
        """Solve the dual problem with fixed states, from multipliers `start` (owned rows,).  Collective.

        Raises:
            NotCarriedError: nothing carries the load's stresses.
        """
        from feti_homog.interface.contact import mixed_load  # unit loads are solved together

        self.prepare(bonds)
        return mixed_load.solve(self.scales, load, start)

    def completed(self, state: Equilibrium) -> Equilibrium:
        """Return a state with amplitudes and jumps by F lambda, where they lack.  Collective."""
        if state.solution.alpha is not None:
            return state
        self.prepare(state.bonds)
        return replace(state, solution=self._placed(state.bonds, self.solver.completed(state.solution))[0])

    def is_linear(self, status: Status) -> bool:
        """Return whether no faces can begin to touch.  Collective."""
        return not (self.contact and self._any(status != BONDED))

    def equilibria(self, strains: Float, bonds: BondState, starts: Sequence[Float]) -> list[Equilibrium]:
        """Solve a linear problem for every strain of (k, 3) together.  Collective."""
        self.prepare(bonds)
        solutions = self.solver.solve_many(strains, np.stack(starts, axis=1))
        return [
            self._equilibrium(Load.strain(strain), bonds, solution, solution.iterations, 1)
            for strain, solution in zip(strains, solutions, strict=True)
        ]

    def equilibrium(self, load: Load, bonds: BondState, start: Float) -> Equilibrium:
        """Solve for the load, with `bonds` as a first guess of contact states.  Collective; raises as `linear`."""
        try:
            return self._searched(load, bonds, start)
        except NotCarriedError:
            closed = np.where(bonds.status == OPEN, CLOSED, bonds.status).astype(np.int8)
            if not self.contact or not self._any(closed != bonds.status):
                raise
        # Touching faces may carry loads that open ones do not.
        return self._searched(load, bonds.with_status(closed), start)

    def _searched(self, load: Load, bonds: BondState, start: Float) -> Equilibrium:
        """Search the equilibrium from these states on.  Collective; raises as `linear`."""
        comm, fewest, pivots = self.solver.comm, np.inf, 0
        iterations = solves = 0
        while True:
            solution = self.linear(load, bonds, start)
            iterations, solves = iterations + solution.iterations, solves + 1
            solution, wrong = self._placed(bonds, solution)
            count = comm.allreduce(int(wrong.sum()))
            if count == 0 or solves == MAX_CONTACT_SOLVES or solution.reason < 0:
                return self._equilibrium(load, bonds, solution, iterations, solves)
            pivots -= 1
            if count < fewest:
                fewest, pivots = count, self.block_pivots
            if pivots <= 0:
                # The first wrong node of the lowest rank with one.
                rank = comm.allreduce(comm.rank if wrong.any() else comm.size, MPI.MIN)
                wrong = np.arange(len(wrong)) == (np.argmax(wrong) if rank == comm.rank else -1)
            bonds, start = bonds.flipped(wrong), solution.lam

    def undetermined(self, state: Equilibrium) -> Bool:
        """(v,) undetermined strains: their stresses are prescribed, and open faces allow any value.  Collective."""
        has_history, by_stress = state.bonds.gap_and_slip is not None, state.load.by_stress
        if has_history or not by_stress.any() or not self._any(state.status != BONDED):
            return np.zeros(len(by_stress), bool)
        from feti_homog.interface.contact import mixed_load  # few loads prescribe stresses

        self.prepare(state.bonds)
        stiffness = self.scales.mean_stiffness * float(self.size.prod())
        return mixed_load.unresisted(self.solver, by_stress, stiffness)

    def _any(self, which: Bool) -> bool:
        """Return whether any rank has a node in `which`.  Collective."""
        return bool(self.solver.comm.allreduce(bool(which.any()), MPI.LOR))

    def _placed(self, bonds: BondState, solution: DualSolution) -> tuple[DualSolution, Bool]:
        """Return the solution with free fibres in their room, and (k,) nodes that break the KKT conditions."""
        status, damaged = bonds.status, self.damaged(bonds)
        pressed = np.zeros(len(status), bool)
        if not self.contact and not self._any(damaged):
            return solution, pressed
        coarse, noise = self.solver.natural, self.scales.gap_noise(solution.strain)
        if self.contact and coarse.unconstrained_modes.shape[1]:
            from feti_homog.interface.contact.floating_bodies import FloatingBodies  # few fibres are free

            bodies = FloatingBodies(self.solver.comm, coarse, self.nodes, status == OPEN, noise)
            moved, pressed = bodies.place(solution)
            alpha = None if solution.alpha is None else moved + solution.alpha
            solution = replace(solution, alpha=alpha, jump=solution.jump + coarse.G @ moved)
        force, gap = solution.lam[self.nodes.row], solution.jump[self.nodes.row]
        force_noise, meets = self.scales.force_noise(solution), (status == OPEN) & self.contact
        pulled = ((status == CLOSED) | (damaged & bonds.pressed)) & (force > force_noise)
        overlaps = (meets & (gap < -noise)) | (damaged & ~bonds.pressed & (force < -force_noise))
        return solution, pulled | overlaps | pressed

    def _equilibrium(
        self, load: Load, bonds: BondState, solution: DualSolution, iterations: int, solves: int
    ) -> Equilibrium:
        """Return the final state with its certificate and free rigid motions.  Collective.

        Bonds and faces under compression resist motions.  Nodes of a fibre that touch its hole without a force count as
        open if the fibre moves without them, for they do not fix it; otherwise they stay closed.  The fibre then lies
        where its faces part least, if it has room there.
        """
        asked, status, coarse = self.scales.asked(load), bonds.status, self.solver.natural
        motions, idle = coarse.unconstrained_modes, np.zeros(len(status), bool)
        if self.contact and self._any(status == CLOSED):
            idle = (status == CLOSED) & (solution.lam[self.nodes.row] >= -self.scales.force_noise(solution))
        if self._any(idle):
            before = motions
            motions = coarse.free_motions(self.active(np.where(idle, OPEN, status).astype(np.int8)))
            # The squares are the diagonal of the projector on the motions, which rises if a body becomes free.
            shares, without = (np.asarray(Z.power(2).sum(axis=1)).ravel() for Z in (motions, before))
            freed = np.isin(coarse.body, coarse.body[shares - without > LEAST_SHARE_OF_MOTION])
            idle &= (abs(coarse.G[self.nodes.row]) + abs(coarse.G[self.nodes.row + 1])) @ freed > 0
            bonds = bonds.with_status(np.where(idle, OPEN, status).astype(np.int8))
            if self._any(idle):
                # The search found any of many places.
                self.prepare(bonds)
                moved, wrong = self._placed(bonds, self.solver.completed(replace(solution, alpha=None)))
                solution = solution if self._any(wrong) else moved
        certificate = self.certificate(bonds, solution, asked)
        return Equilibrium(load, bonds, solution, iterations, solves, motions.shape[1], certificate, asked)

    def certificate(self, bonds: BondState, solution: DualSolution, asked: Float) -> dict[str, float]:
        """Return errors by `kkt_errors`; `asked` as in `Equilibrium`.  Collective."""
        status, gained, acting = bonds.status, self._gained(bonds), self.acting(bonds, solution.strain, asked)
        damaged = gained > 0.0
        # A pulled bond opens by its damage; under pressure it overlaps.
        overlap = np.minimum(gained * solution.lam[self.nodes.row], 0.0)
        gap = np.where(damaged & ~bonds.pressed, overlap, solution.jump[self.nodes.row])
        debonded = ((status != BONDED) & self.contact) | damaged
        closed = (status == CLOSED) | (damaged & bonds.pressed)
        return kkt_errors(self.scales, self.traction(solution), gap, debonded, closed, acting)

    def acting(self, bonds: BondState, strain: Float, asked: Float) -> Float:
        """(v,) `LoadScales.acting` for the strain and, with friction, residual jumps.  Collective."""
        if bonds.gap_and_slip is not None:
            jump = self.solver.comm.allreduce(float(np.abs(bonds.gap_and_slip).max(initial=0.0)), MPI.MAX)
            is_strain = np.arange(len(strain)) < self.solver.problem.strains
            strain = np.maximum(np.abs(strain), np.where(is_strain, jump / self.size.max(), 0.0))
        return self.scales.acting(strain, asked)
