"""The debonded faces of a cell, condensed to dense arrays: what rank 0 decides, and multipliers of all ranks.

A problem of the cell, in the plane or along the fibres, is condensed to jumps of some interface rows.  With H the
inverse of the dual operator of the bonded cell, prescribed jumps g on rows D leave

    lam = H (d E - g),      |UC| Sigma = L E - b^T g,      b = (H d)_D,

L the bonded stiffness times the area: the cell stores x.S x / 2 of x = (g, E), S = [[H_DD, -b], [-b^T, L]].  The matrix
of `coulomb_faces` is that of the plane, and behind it in generalized plane strain that of `AxialFaces`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI
from scipy.linalg import block_diag, lu_factor, lu_solve

from feti_homog.errors import CaseError
from feti_homog.feti.dual_solution import DualSolution
from feti_homog.feti.solver_plan import WITHOUT_INVERSE
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN, BondState, Equilibrium, Status, coulomb_errors
from feti_homog.interface.friction.coulomb_faces import CoulombFaces
from feti_homog.interface.friction.status_system import HELD, OPEN_FACE, REFINEMENTS, STICK
from feti_homog.interface.loads import Load, Macroscopic
from feti_homog.system.parallel.distributed_arrays import allreduce_sum, gather_rows
from feti_homog.typing import Float, Int

# Stiffness, relative to that with all bonds, that is what rounding leaves of none.
NO_STIFFNESS = 1e-10


class CondensedProblem:
    """One problem with the rows that `take` was last given.

    Attributes:
        interface: its contact problem.
        rows: (n,) global rows D.
        first: global number of the first row of this rank.
    """

    def __init__(self, interface: ContactProblem) -> None:
        """Find the response of the bonded cell to its loads.  Collective.

        Raises:
            CaseError: the solver has no inverse of the dual operator.
        """
        self.interface, self.solver = interface, interface.solver
        if self.solver.exact_inverse is None:
            raise CaseError(WITHOUT_INVERSE)
        self._inverse, self.first = self.solver.exact_inverse, self.solver.jump_operator.owned[0]
        self._response = self._inverse.multipliers(self.solver.d, np.eye(len(self.solver.problem.loads)))
        bonded = self.solver.torn_stiffness + allreduce_sum(self.solver.comm, self.solver.d.T @ self._response)
        self._bonded = (bonded + bonded.T) / 2
        self._some: tuple[Int, Float] | None = None

    def take(self, rows: Int, springs: Float) -> tuple[Float, Float, Float]:
        """Return H_DD (n, n) with springs (n,) beside it, b (n, v) and L (v, v) of the same rows.  Collective."""
        self.rows, self._some = rows, None
        self._columns, K = self._inverse.columns(rows)
        K[np.diag_indices(len(K))] += springs
        return K, gather_rows(self.solver.comm, self._response, self.first, rows), self._bonded

    def gained(self, bonds: BondState) -> Float:
        """(k, c) compliance that damage adds to the springs, if all bonds are pulled."""
        interface, pulled = self.interface, replace(bonds, pressed=np.zeros(len(bonds.status), bool))
        more = interface.compliance(pulled) - self.solver.intact_compliance
        return np.asarray(more[interface.nodes.row[:, None] + np.arange(self.solver.jump_operator.components)])

    def multipliers(self, jump: Float, strain: Float) -> Float:
        """(owned rows,) lam of jumps (n,) and strains (v,)."""
        return np.asarray(self._response @ strain - self._columns @ jump)

    def some_multipliers(self, own: Int, jump: Float, strain: Float) -> Float:
        """(k, c) lam at the places `own` (k, c) among the owned rows; their columns are kept for this array."""
        if self._some is None or self._some[0] is not own:
            self._some = own, self._columns[own.ravel()]
        return self._response[own] @ strain - (self._some[1] @ jump).reshape(own.shape)

    def solution(self, bonds: BondState, jump: Float, strain: Float) -> DualSolution:
        """Return the multipliers, and the jumps that they leave by the dual operator itself.  Collective."""
        solver, lam = self.solver, self.multipliers(jump, strain)
        torn = solver.d @ strain
        left, opened = torn - solver.operator.apply(lam), np.zeros(len(lam))
        mine = (self.rows >= self.first) & (self.rows < self.first + len(lam))
        opened[self.rows[mine] - self.first] = jump[mine]
        alpha = np.zeros(solver.natural.kernel_dimension)
        if len(alpha):
            alpha -= solver.natural.amplitudes(left - opened)
            left = left + solver.natural.G @ alpha
        sums = np.array([(left - opened) @ (left - opened), left @ left, torn @ torn])
        off, *sizes = np.sqrt(allreduce_sum(solver.comm, sums))
        C = self.interface.compliance(bonds)
        left = left - (C - solver.intact_compliance) * lam
        return DualSolution(strain, lam, left, alpha, 0, 2, float(off / (max(sizes) or 1.0)), C)


class AxialFaces:
    """The axial problem, a few rows and columns of the matrix S of `coulomb_faces` behind those of the plane.

    The jumps g = K^-1 b E are eliminated, K g = b E.  What nothing holds is held by a share of its own row: a share of
    the largest would measure by the stiffest spring.

    Attributes:
        problem: the axial one.
        jumps, stiffness: K^-1 b (n, v), and (v, v) of its strains, L - b^T K^-1 b.
    """

    def __init__(self, problem: CondensedProblem, rows: Int, springs: Float) -> None:
        """Take rows (n,) with springs (n,), 0 of faces that nothing ties.  Collective."""
        self.problem = problem
        K, b, L = problem.take(rows, springs)
        held = lu_factor(K + HELD * np.diag(K.diagonal()))
        self.jumps = np.zeros_like(b)
        for _ in range(1 + REFINEMENTS):
            self.jumps += lu_solve(held, b - K @ self.jumps)
        # Stiffness that is rounding beside that with all bonds would carry a load.
        diagonal, stiffness = L.diagonal(), L - b.T @ self.jumps
        roots = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        values, vectors = np.linalg.eigh((stiffness + stiffness.T) / (2.0 * np.outer(roots, roots)))
        left = (vectors * np.where(values > NO_STIFFNESS, values, 0.0)) @ vectors.T
        resists = left.diagonal() > NO_STIFFNESS
        self.stiffness = np.asarray(left * np.outer(resists * roots, resists * roots))


class SlidingCell:
    """The faces of one set of debonded nodes.

    Attributes:
        interface: the contact problem of the plane.
        friction, friction_of_damage: (k,) mu of the nodes of this rank; of the damaged share of bonds that hold.
        rows: (n,) global normal rows of the debonded nodes, rising.
        faces: of these nodes, on every rank.
    """

    def __init__(self, cell: CoupledInterfaces, friction: Float, friction_of_damage: Float) -> None:
        """Find the response of the bonded cell to its loads.  Collective; raises as `CondensedProblem`."""
        self.cell, self.interface = cell, cell.plane
        self.friction, self.friction_of_damage = friction, friction_of_damage
        self.solver = self.interface.solver
        self._plane, *self._axial = (CondensedProblem(each) for each in cell.problems)
        self._loads = len(self.solver.problem.loads)
        self.rows, self.springs = np.zeros(0, np.int64), np.zeros(0)
        self.faces = CoulombFaces(np.zeros((0, 0)), np.zeros(0))

    def take(self, bonds: BondState) -> None:
        """Have the faces of the debonded nodes, and of damaged bonds, which are on springs.  Collective."""
        comm, row, first = self.solver.comm, self.interface.nodes.row, self._plane.first
        more = np.hstack([each.gained(bonds) for each in (self._plane, *self._axial)])
        self._more = more[:, 1]
        self._damaged = (bonds.status == BONDED) & (more[:, :2] > 0.0).any(axis=1)
        self._own = np.flatnonzero((bonds.status != BONDED) | self._damaged)
        self._held = np.flatnonzero(bonds.status == BONDED)
        problems = (self._plane, *self._axial)
        rows = [(each.interface.nodes.row[self._held], each.solver.jump_operator.components) for each in problems]
        self._held_rows = [own[:, None] + np.arange(components) for own, components in rows]
        pulled = (more > 0.0) & self._damaged[:, None]
        self._springs = springs = np.divide(1.0, more, out=np.zeros_like(more), where=pulled)
        friction = np.where(self._damaged, self.friction_of_damage, self.friction)
        along = [each.first + each.interface.nodes.row for each in self._axial]
        own = np.column_stack([first + row, friction, *along, springs])[self._own]
        whole = np.concatenate(comm.allgather(own))
        whole = whole[np.argsort(whole[:, 0])]
        faces, before, held = self.faces, self.rows, self.springs
        self.rows, springs = whole[:, 0].astype(np.int64), whole[:, -more.shape[1] :]
        self.springs = springs[:, :2].ravel()
        self._place = np.searchsorted(self.rows, first + row[self._own])
        K, b, L = self._plane.take((self.rows[:, None] + np.arange(2)).ravel(), self.springs)
        nodes = whole[:, 2].astype(np.int64)
        self._along = [AxialFaces(each, nodes, springs[:, 2]) for each in self._axial]
        S = block_diag(L, *(each.stiffness for each in self._along))
        b = np.pad(b, [(0, 0), (0, len(S) - self._loads)])
        self.faces = CoulombFaces(np.block([[K, -b], [-b.T, S]]), whole[:, 1])
        if len(before) and np.isin(before, self.rows).all():
            self._follow(faces, before, held)

    def _follow(self, faces: CoulombFaces, rows: Int, springs: Float) -> None:
        """Go on from faces of rows (n',), which are here too, on springs (2n',)."""
        pairs = (2 * np.searchsorted(self.rows, rows)[:, None] + np.arange(2)).ravel()
        loads = np.arange(self.faces.loads.start, self.faces.loads.stop)
        # Entries on other springs, and loads whose stiffness all jumps change.
        differs = np.repeat((self.springs[pairs] != springs).reshape(-1, 2).any(axis=1), 2)
        other = np.concatenate([pairs[differs], loads[self._loads :]])
        self.faces.follow(faces, np.concatenate([pairs, loads]), other)

    def begin(self, bonds: BondState, strain: Float) -> tuple[Status, Float]:
        """Return the statuses (n,) of the faces of the bonds, and scaled x (m,), with a strain (v,).  Collective.

        Without a history the faces just touch.
        """
        self.take(bonds)
        jump = np.zeros((len(bonds.status), 2)) if bonds.gap_and_slip is None else bonds.gap_and_slip
        apart = np.where(self._damaged, ~bonds.pressed, bonds.status == OPEN)
        own = np.column_stack([np.where(apart, OPEN_FACE, bonds.sliding_signs), jump])[self._own]
        whole = np.concatenate(self.solver.comm.allgather(np.column_stack([self._place, own])))
        whole = whole[np.argsort(whole[:, 0])]
        status: Status = whole[:, 1].astype(np.int8)
        return status, np.concatenate([whole[:, 2:].ravel(), strain]) * self.faces.size

    def bonds(self, before: BondState, status: Status, x: Float) -> BondState:
        """Return the state of the nodes of this rank with statuses (n,) and scaled x of the faces."""
        own, jump = status[self._place], np.zeros((len(before.status), 2))
        jump[self._own] = self._jumps_of(x).reshape(-1, 2)[self._place]
        nodes, sliding = before.status.copy(), np.zeros(len(before.status), np.int8)
        holds, pressed = self._damaged[self._own], before.pressed.copy()
        nodes[self._own] = np.where(holds, BONDED, np.where(own == OPEN_FACE, OPEN, CLOSED))
        rubs = self.faces.friction[self._place] > 0.0
        sliding[self._own] = np.where((own != OPEN_FACE) & rubs, own, STICK)
        pressed[self._own] = np.where(holds, own != OPEN_FACE, pressed[self._own])
        return replace(before, status=nodes, pressed=pressed, gap_and_slip=jump, sliding=sliding)

    def stored(self, x: Float) -> float:
        """Return the energy per area of the cell in scaled x."""
        return float(x @ self.faces.product(x)) / (2.0 * self.cell.area)

    def stretched(self, x: Float) -> float:
        """Return the energy per area of the springs in scaled x by which damaged bonds have become softer."""
        return float(self.springs @ self._jumps_of(x) ** 2) / (2.0 * self.cell.area)

    def _jumps_of(self, x: Float) -> Float:
        """(2n,) jumps in the plane of scaled x."""
        return np.asarray((x / self.faces.size)[: self.faces.loads.start])

    def traction(self, x: Float) -> Float:
        """(k, 2) or (k, 3) traction of scaled x at the bonds of this rank, also along the fibre; 0 where they broke.

        Of damaged bonds it is that of the share that holds.
        """
        force = np.zeros((len(self.friction), sum(rows.shape[1] for rows in self._held_rows)))
        parts = zip(self._held_rows, self._parts(x), strict=True)
        force[self._held] = np.hstack([problem.some_multipliers(rows, *own) for rows, (problem, own) in parts])
        damaged, slip = self._damaged[self._own], self._jumps_of(x)[1::2][self._place]
        node, C = self._own[damaged], self.solver.intact_compliance[self.interface.nodes.row[self._own[damaged]] + 1]
        force[node, 1] = (C * force[node, 1] + slip[damaged]) / (C + self._more[node])
        return np.asarray(force / self.interface.nodes.length[:, None])

    def _parts(self, x: Float) -> list[tuple[CondensedProblem, tuple[Float, Float]]]:
        """Return each problem with its jumps and strains of scaled x."""
        jump, plane, along = np.split(x / self.faces.size, 2 * len(self.rows) + np.array([0, self._loads]))
        return [(self._plane, (jump, plane)), *((each.problem, (each.jumps @ along, along)) for each in self._along)]

    def released_along(self, before: Macroscopic, after: Macroscopic) -> float:
        """Return the energy per area that a break at constant load loses along fibres."""
        parts = (Macroscopic(each.strain[self._loads :], each.stress[self._loads :]) for each in (before, after))
        return next(parts).released_to(next(parts))

    def macroscopic(self, x: Float) -> Macroscopic:
        """Return the strains and stresses (v,) of scaled x."""
        loads, size = self.faces.loads, self.faces.size
        return Macroscopic((x / size)[loads], (self.faces.product(x) * size)[loads] / self.cell.area)

    def given(self, load: Load) -> Float:
        """(v,) scaled values of a load."""
        size = self.faces.size[self.faces.loads]
        return np.where(load.by_stress, self.cell.area * load.values / size, load.values * size)

    def equilibrium(self, loads: Sequence[Load], bonds: BondState, x: Float) -> Equilibrium:
        """Return the state of scaled x, with its certificate, under the last of the loads up to it.  Collective."""
        states, of_problems = list[Equilibrium](), list(zip(*map(self.cell.parts, loads), strict=True))
        scales = [each.scales for each in self.cell.problems]
        asked = [np.max([own.asked(load) for load in of], axis=0) for own, of in zip(scales, of_problems, strict=True)]
        # What rounding leaves of an unloaded problem is that of the others.
        most = max(own.imposed_strain(strain).max() for own, strain in zip(scales, asked, strict=True))
        for of, strains, (problem, (jump, strain)) in zip(of_problems, asked, self._parts(x), strict=True):
            solution = problem.solution(bonds, jump, strain)
            strains[: problem.solver.problem.strains] = most
            certificate = problem.interface.certificate(bonds, solution, strains)
            states.append(Equilibrium(of[-1], bonds, solution, 0, 1, 0, certificate, strains))
        plane, *axial = states
        # Rigid motions that neither a bond nor a compressed face resists, nor its friction.
        row, is_closed = self.interface.nodes.row, bonds.status == CLOSED
        is_pressed = is_closed & (plane.solution.lam[row] < -self.interface.scales.force_noise(plane.solution))
        active = self.interface.active(np.where(is_closed & ~is_pressed, OPEN, bonds.status).astype(np.int8))
        active[row[is_pressed & (self.friction > 0.0)] + 1] = 1.0
        plane = replace(plane, free_motions=int(self.solver.natural.free_motions(active).shape[1]))
        excess = {"kkt_friction": self._excess(bonds, states, x)}
        return replace(plane, certificate=plane.certificate | excess, axial=next(iter(axial), None))

    def _excess(self, bonds: BondState, states: Sequence[Equilibrium], x: Float) -> float:
        """Return the largest of `coulomb_errors` of scaled x, relative to the largest traction.  Collective."""
        traction = self.cell.traction([each.solution for each in states])
        components = [each.solver.jump_operator.components for each in self.cell.problems]
        # By the jumps of x: what F lambda leaves of them would be divided by a vanishing compliance.
        parts = zip(self._parts(x), components, strict=True)
        jumps = np.hstack([jump.reshape(-1, c) for (_, (jump, _)), c in parts])
        force, own = traction.copy(), self._own
        force[own] -= jumps[self._place] * self._springs[own] / self.interface.nodes.length[own, None]
        friction = np.where(self._damaged, self.friction_of_damage, self.friction)
        off = coulomb_errors(force, friction, bonds.sliding_signs)
        largest = self.interface.scales.over_interface(np.abs(traction).max(axis=1, initial=0.0))
        for each, state in zip(self.cell.problems, states, strict=True):
            stress = each.scales.bond_stress(each.acting(bonds, state.solution.strain, state.asked))
            largest = np.maximum(largest, stress)
        off = np.where((bonds.status == BONDED) & ~self._damaged, 0.0, off) / np.where(largest > 0.0, largest, 1.0)
        return float(self.solver.comm.allreduce(off.max(initial=0.0), MPI.MAX))
