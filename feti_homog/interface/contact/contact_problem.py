"""Unilateral, frictionless contact of debonded faces: the search for open and closed nodes.

With the normal force of a node, tension positive, and its pressure p = -force, the KKT conditions of debonded faces are

    gap >= 0,    p >= 0,    gap p = 0.

The dual problem sets p = 0 at an open node and gap = 0 at a closed node, so every solution meets the third condition.
An open node that overlaps and a closed node under tension violate the inequalities (`ContactProblem._violations`), and
have the wrong status.  Block principal pivoting (Judice & Pires, Computers & Operations Research 21, 1994) on the
strictly convex dual problem corrects wrong statuses: all wrong nodes change at once while the number of wrong nodes
falls, or else only the first wrong node (Murty's rule).  Without free fibres gap = q + A p with a positive definite A,
so that no set of statuses returns and the search ends.  With free fibres A is semi-definite; the search may not end.

A damaged bond is pulled (compliance C, force >= 0) or pressed (compliance C_0 as without damage, force <= 0).  With
s = jump - C_0 force >= 0 and w = s / (C - C_0) - force >= 0, s w = 0: the conditions of a debonded node, for which C is
infinite.  So one search finds the states of faces and of damaged bonds.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from mpi4py import MPI

from feti_homog.errors import NotCarriedError
from feti_homog.feti import DualSolution, FetiSolver
from feti_homog.feti.decomposition import constraint_layout
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN, BondState, Equilibrium, Status, kkt_errors
from feti_homog.interface.loads import NEGLIGIBLE, Load, LoadScales, solve_load, unresisted
from feti_homog.typing import Bool, Float, Int

# Number of block pivots, counted from the last one with progress; the literature usually allows ten without progress.
BLOCK_PIVOTS = 11
# Number of dual problems after which the search gives up; the certificate then shows the errors.
MAX_CONTACT_SOLVES = 500


@dataclass(frozen=True)
class ContactProblem:
    """The contact problem of all interfaces, with k nodes on this rank.

    Methods that solve set the state of `solver`, and also raise like `FetiSolver.set_state` and `solve_many`.

    Attributes:
        solver: dual solver.
        contact: whether faces resist overlap; if not, damaged bonds are still stiff under pressure.
        size: (2,) cell size, a scale of displacements.
        softening: maps bonds and a mask (k,) of tension to compliance ratios (k, 3) by damage, or None if all are 1.
        block_pivots: number of block pivots before single nodes change, counted from the last pivot with progress.
    """

    solver: FetiSolver
    contact: bool
    size: Float
    softening: Callable[[BondState, Bool], Float | None] | None = None
    block_pivots: int = BLOCK_PIVOTS
    _last: list[tuple[BondState, tuple[Float, Float] | None]] = field(default_factory=list, compare=False, repr=False)

    @property
    def nodes(self) -> constraint_layout.InterfaceNodes:
        """The interface nodes of this rank."""
        return self.solver.jump_operator.nodes

    def active(self, status: Status) -> Float:
        """Mark the active multipliers (owned rows,) by 1, all others by 0.

        Multipliers of debonded nodes are inactive, except the normal multipliers of closed nodes with `contact`.
        """
        mask = np.ones(self.solver.rows)
        mask[self._pairs] = (status == BONDED)[:, None]
        if self.contact:
            mask[self.nodes.row] = status != OPEN
        return mask

    def prepare(self, bonds: BondState) -> None:
        """Set the solver to the active multipliers and spring compliances of the bonds.  Collective."""
        self.solver.set_state(self.active(bonds.status), self.compliance(bonds))

    def compliance(self, bonds: BondState) -> Float:
        """Return the spring compliance C (owned rows,) in a bond state; without damage, the solver's own array."""
        C, factors = self.solver.intact_compliance, self._factors(bonds)
        if factors is None:
            return C
        # Normal and tangential springs belong to the plane problem, axial ones to the axial problem.
        columns = slice(2) if self.solver.jump_operator.components == 2 else slice(2, 3)
        C = C.copy()
        C[self._pairs] *= np.where(bonds.pressed[:, None], factors[1], factors[0])[:, columns]
        return C

    def _factors(self, bonds: BondState) -> tuple[Float, Float] | None:
        """Return C / C_0 (k, 3) of pulled and of pressed bonds, kept for the last `bonds`; None if all are 1."""
        if self._last and self._last[0][0] is bonds:
            return self._last[0][1]
        factors = None
        if self.softening is not None:
            pulled = np.ones(len(bonds.status), bool)
            soft, stiff = self.softening(bonds, pulled), self.softening(bonds, ~pulled)
            factors = None if soft is None or stiff is None else (soft, stiff)
        self._last[:] = [(bonds, factors)]
        return factors

    def _gained(self, bonds: BondState) -> Float:
        """Return the compliance C - C_0 (k,) that damage adds to normal springs; 0 without damage or normal springs."""
        factors = self._factors(bonds)
        if factors is None or self.solver.jump_operator.components != 2:
            return np.zeros(len(bonds.status))
        C = self.solver.intact_compliance[self.nodes.row]
        return np.where(bonds.status == BONDED, C * (factors[0] - factors[1])[:, 0], 0.0)

    def damaged(self, bonds: BondState) -> Bool:
        """Mark the bonds (k,) with normal springs that are softer in tension than in compression, due to damage."""
        return self._gained(bonds) > 0.0

    def debond(self, status: Status, which: Bool, lam: Float) -> Status:
        """Return the statuses (k,) after the bonds in the mask `which` (k,) part.

        With `contact`, nodes whose normal multiplier in `lam` (owned rows,) is negative, a pressure, become CLOSED; all
        other parted nodes become OPEN.
        """
        force = lam[self.nodes.row]
        released = np.where((force < 0) & self.contact, CLOSED, OPEN).astype(np.int8)
        return np.where(which & (status == BONDED), released, status)

    def traction(self, solution: DualSolution) -> Float:
        """Return tractions, tension positive: normal and tangential (k, 2), or axial (k, 1) in the axial problem."""
        return np.asarray(solution.lam[self._pairs] / self.nodes.length[:, None])

    def jump(self, solution: DualSolution) -> Float:
        """Return gap and slip (k, 2), matrix minus fibre; in the axial problem the slip along the fibre (k, 1)."""
        return np.asarray(solution.opening[self._pairs])

    def stress(self, solution: DualSolution) -> Float:
        """Return the macroscopic stresses (v,), conjugate to all loads, from multipliers alone.  Collective."""
        return np.asarray(self.solver.stress_integral(solution) / self.size.prod())

    @cached_property
    def scales(self) -> LoadScales:
        """The scales of load effects.  Collective when first read."""
        return LoadScales(self.solver, self.size)

    @cached_property
    def _pairs(self) -> Int:
        """The owned rows (k, c) of the interface nodes."""
        return self.nodes.row[:, None] + np.arange(self.solver.jump_operator.components)

    def linear(self, load: Load, bonds: BondState, start: Float) -> DualSolution:
        """Solve the dual problem at fixed statuses, from multipliers `start` (owned rows,).  Collective.

        Raises NotCarriedError if nothing carries the stresses of the load.
        """
        self.prepare(bonds)
        return solve_load(self.scales, load, start)

    def completed(self, state: Equilibrium) -> Equilibrium:
        """Return the state with jumps and rigid-body amplitudes alpha, from its balanced multipliers.  Collective.

        Free fibres then move as in `FloatingBodies.place`, with its exceptions.  A state with alpha is returned itself.
        """
        if state.solution.alpha is not None:
            return state
        self.prepare(state.bonds)
        complete = self.solver.completed(self.solver.jumps.balanced(state.solution))
        return replace(state, solution=self._place_free_fibres(state.bonds, complete)[0])

    def is_linear(self, status: Status) -> bool:
        """Return whether contact states cannot change: no faces are debonded, or faces may overlap.  Collective."""
        return not (self.contact and self._any(status != BONDED))

    def equilibria(self, strains: Float, bonds: BondState, starts: Sequence[Float]) -> list[Equilibrium]:
        """Solve for equilibria under n strains (n, v) at fixed statuses, from n multipliers `starts`.  Collective."""
        self.prepare(bonds)
        solutions = self.solver.solve_many(strains, np.stack(starts, axis=1))
        pairs = zip(strains, solutions, strict=True)
        return [self._equilibrium(Load.strain(E), bonds, solution, solution.iterations, 1) for E, solution in pairs]

    def equilibrium(self, load: Load, bonds: BondState, start: Float) -> Equilibrium:
        """Find statuses and solution under a load, from guessed bonds and multipliers `start`.  Collective.

        If open faces do not carry the load, a second search closes them.  Raises like `linear`, `FloatingBodies.place`.
        """
        try:
            return self._search(load, bonds, start)
        except NotCarriedError:
            closed = np.where(bonds.status == OPEN, CLOSED, bonds.status).astype(np.int8)
            if not self.contact or not self._any(closed != bonds.status):
                raise
        return self._search(load, replace(bonds, status=closed), start)

    def _search(self, load: Load, bonds: BondState, start: Float) -> Equilibrium:
        """Flip wrong statuses until no node violates the KKT conditions.  Collective; raises like `equilibrium`.

        The search gives up after MAX_CONTACT_SOLVES dual problems, or after a solve without convergence.
        """
        comm, fewest, pivots = self.solver.comm, np.inf, 0
        iterations = solves = 0
        while True:
            solution = self.linear(load, bonds, start)
            iterations, solves = iterations + solution.iterations, solves + 1
            solution, squeezes = self._place_free_fibres(bonds, solution)
            wrong = squeezes | self._violations(bonds, solution)
            count = comm.allreduce(int(wrong.sum()))
            if count == 0 or solves == MAX_CONTACT_SOLVES or solution.reason < 0:
                return self._equilibrium(load, bonds, solution, iterations, solves)
            pivots -= 1
            if count < fewest:
                fewest, pivots = count, self.block_pivots
            if pivots <= 0:
                # Only the first wrong node changes, on the first rank that has a wrong node.
                rank = comm.allreduce(comm.rank if wrong.any() else comm.size, MPI.MIN)
                place = np.argmax(wrong) if rank == comm.rank else -1
                wrong = np.arange(len(wrong)) == place
            bonds, start = bonds.flipped(wrong), solution.lam

    def undetermined(self, state: Equilibrium) -> Bool:
        """Mark strains (v,) that debonded faces leave free under given stresses; none with friction.  Collective."""
        has_history, by_stress = state.bonds.gap_and_slip is not None, state.load.by_stress
        if has_history or not by_stress.any() or not self._any(state.status != BONDED):
            return np.zeros(len(by_stress), bool)

        self.prepare(state.bonds)
        stiffness = self.scales.mean_stiffness * float(self.size.prod())
        return unresisted(self.solver, by_stress, stiffness)

    def _any(self, which: Bool) -> bool:
        """Return whether the mask `which` marks a node on any rank.  Collective."""
        return bool(self.solver.comm.allreduce(bool(which.any()), MPI.LOR))

    def _place_free_fibres(self, bonds: BondState, solution: DualSolution) -> tuple[DualSolution, Bool]:
        """Move free fibres to open all overlaps, and mark open nodes (k,) that squeeze a fibre.  Collective.

        Return the solution with new alpha and jumps, and the mask (k,).  Raises like `FloatingBodies.place`.
        """
        coarse = self.solver.natural
        if not (self.contact and coarse.unconstrained_modes.shape[1]):
            return solution, np.zeros(len(bonds.status), bool)
        from feti_homog.interface.contact.floating_bodies import FloatingBodies  # few cells have free fibres

        noise = self.scales.gap_noise(solution.strain)
        bodies = FloatingBodies(self.solver.comm, coarse, self.nodes, bonds.status == OPEN, noise)
        motion, squeezes = bodies.place(solution)
        alpha = None if solution.alpha is None else motion + solution.alpha
        return replace(solution, alpha=alpha, jump=solution.jump + coarse.G @ motion), squeezes

    def _violations(self, bonds: BondState, solution: DualSolution) -> Bool:
        """Mark the nodes (k,) that violate gap >= 0 or pressure >= 0 beyond the solver's error.  Collective.

        The status of a debonded node selects the condition.  A damaged bond must be in tension if it counts as pulled,
        under pressure if it counts as pressed.
        """
        status, damaged = bonds.status, self.damaged(bonds)
        if not self.contact and not self._any(damaged):
            return np.zeros(len(status), bool)
        gap, pressure = solution.jump[self.nodes.row], -solution.lam[self.nodes.row]
        gap_noise, pressure_noise = self.scales.gap_noise(solution.strain), self.scales.force_noise(solution)
        overlap = (status == OPEN) & self.contact & (gap < -gap_noise)
        tension = ((status == CLOSED) | (damaged & bonds.pressed)) & (pressure < -pressure_noise)
        compression = damaged & ~bonds.pressed & (pressure > pressure_noise)
        return np.asarray(overlap | tension | compression)

    def _equilibrium(
        self, load: Load, bonds: BondState, solution: DualSolution, iterations: int, solves: int
    ) -> Equilibrium:
        """Return the final state with the certificate and the number of free rigid motions.  Collective.

        Bonds and pressed faces resist motions.  Closed nodes without a force hold no fibre, and become open if a fibre
        is free without these nodes.  If there is room, this fibre then moves to the least sum of squared jumps.
        """
        asked, status, coarse = self.scales.asked(load), bonds.status, self.solver.natural
        motions, idle = coarse.unconstrained_modes, np.zeros(len(status), bool)
        if self.contact and self._any(status == CLOSED):
            idle = (status == CLOSED) & (solution.lam[self.nodes.row] >= -self.scales.force_noise(solution))
        if self._any(idle):
            before = motions
            motions = coarse.free_motions(self.active(np.where(idle, OPEN, status).astype(np.int8)))
            # The squares are the diagonal of the projector on the motions, which rises where a body becomes free.
            after, squares = (np.asarray(Z.power(2).sum(axis=1)).ravel() for Z in (motions, before))
            freed = np.isin(coarse.body, coarse.body[after - squares > NEGLIGIBLE])
            idle &= (abs(coarse.G[self.nodes.row]) + abs(coarse.G[self.nodes.row + 1])) @ freed > 0
            bonds = replace(bonds, status=np.where(idle, OPEN, status).astype(np.int8))
            if self._any(idle):
                # The search left the fibre at one of many admissible positions.
                self.prepare(bonds)
                complete = self.solver.completed(self.solver.jumps.balanced(solution))
                moved, squeezes = self._place_free_fibres(bonds, complete)
                solution = solution if self._any(squeezes | self._violations(bonds, moved)) else moved
        certificate = self.certificate(bonds, solution, asked)
        return Equilibrium(load, bonds, solution, iterations, solves, motions.shape[1], certificate, asked)

    def certificate(self, bonds: BondState, solution: DualSolution, asked: Float) -> dict[str, float]:
        """Measure the errors in the KKT conditions by `kkt_errors`; `asked` as in `Equilibrium`.  Collective."""
        status, gained, acting = bonds.status, self._gained(bonds), self.scales.acting(solution.strain, asked)
        damaged = gained > 0.0
        # A pulled bond opens by the damage; under pressure the bond would overlap.
        overlap = np.minimum(gained * solution.lam[self.nodes.row], 0.0)
        gap = np.where(damaged & ~bonds.pressed, overlap, solution.jump[self.nodes.row])
        debonded = ((status != BONDED) & self.contact) | damaged
        closed = (status == CLOSED) | (damaged & bonds.pressed)
        return kkt_errors(self.scales, self.traction(solution), gap, debonded, closed, acting)
