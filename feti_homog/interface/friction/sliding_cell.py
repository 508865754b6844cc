"""The debonded faces of a cell, condensed to dense arrays for rank 0, and the multipliers on all ranks.

Each problem of the cell, in the plane or along the fibres, is condensed to the jumps in some interface rows.  With H
the inverse of the dual operator of the bonded cell, prescribed jumps g in rows D leave

    lam = H (d E - g),      |UC| Sigma = L E - b^T g,      b = (H d)_D,

with L the bonded stiffness times the area |UC|: the cell stores x.S x / 2 with x = (g, E), S = [[H_DD, -b], [-b^T, L]].
`coulomb_faces` uses the S of the plane problem; in generalized plane strain `AxialFaces` appends rows and columns.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI
from scipy.linalg import block_diag, lu_factor, lu_solve

from feti_homog.errors import CaseError
from feti_homog.feti import DualSolution, solver_plan
from feti_homog.interface.contact import BondState, ContactProblem, CoupledInterfaces, Equilibrium, Status
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN, coulomb_errors
from feti_homog.interface.friction.coulomb_faces import CoulombFaces
from feti_homog.interface.friction.status_system import HELD, INVERSE_ITERATIONS, OPEN_FACE, STICK, UNRESISTED
from feti_homog.interface.loads import Load, Macroscopic
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Float, Int


class CondensedProblem:
    """One problem of the cell, condensed to the rows from the last call of `take`.

    Attributes:
        interface: contact problem of the plane or of the axial displacements.
        rows: (n,) global rows D.
        first: global number of the first row of this rank.
    """

    def __init__(self, interface: ContactProblem) -> None:
        """Compute the bonded cell's response to unit loads.  Collective; raises CaseError without an `ExactInverse`."""
        self.interface, self.solver = interface, interface.solver
        if self.solver.exact_inverse is None:
            raise CaseError(solver_plan.WITHOUT_INVERSE)
        self._inverse, self.first = self.solver.exact_inverse, self.solver.jump_operator.owned[0]
        self._response = self._inverse.multipliers(self.solver.d, np.eye(len(self.solver.problem.loads)))
        glued = distributed_arrays.allreduce_sum(self.solver.comm, self.solver.d.T @ self._response)
        bonded = self.solver.torn_stiffness + glued
        self._bonded = (bonded + bonded.T) / 2
        self._some: tuple[Int, Float] | None = None

    def take(self, rows: Int, springs: Float) -> tuple[Float, Float, Float]:
        """Condense the problem to the global rows D.  Collective.

        Return H_DD (n, n) with springs (n,) added to the diagonal, b (n, v) and L (v, v).
        """
        self.rows, self._some = rows, None
        self._columns, K = self._inverse.columns(rows)
        K[np.diag_indices(len(K))] += springs
        return K, distributed_arrays.gather_rows(self.solver.comm, self._response, self.first, rows), self._bonded

    def gained(self, bonds: BondState) -> Float:
        """Return the compliance (k, c) that damage adds to the c springs of each bond in tension."""
        interface, pulled = self.interface, replace(bonds, pressed=np.zeros(len(bonds.status), bool))
        increase = interface.compliance(pulled) - self.solver.intact_compliance
        return np.asarray(increase[self.rows_of(slice(None))])

    def rows_of(self, node: Int | slice) -> Int:
        """Return the owned rows (p, c) of this rank's nodes (p,)."""
        return self.interface.nodes.row[node][:, None] + np.arange(self.solver.jump_operator.components)

    def multipliers(self, jump: Float, strain: Float) -> Float:
        """Return the multipliers lam (owned rows,) under jumps (n,) in the rows D and strains (v,)."""
        return np.asarray(self._response @ strain - self._columns @ jump)

    def some_multipliers(self, rows: Int, jump: Float, strain: Float) -> Float:
        """Compute `multipliers` in owned rows (k, c), with stored columns if `rows` is the array of the last call."""
        if self._some is None or self._some[0] is not rows:
            self._some = rows, self._columns[rows.ravel()]
        return self._response[rows] @ strain - (self._some[1] @ jump).reshape(rows.shape)

    def solution(self, bonds: BondState, jump: Float, strain: Float) -> DualSolution:
        """Return the dual solution under jumps (n,) and strains (v,); all jumps follow from lam.  Collective."""
        solver, lam = self.solver, self.multipliers(jump, strain)
        torn = solver.d @ strain
        jumps, opened = torn - solver.operator.apply(lam), np.zeros(len(lam))
        is_local = (self.rows >= self.first) & (self.rows < self.first + len(lam))
        opened[self.rows[is_local] - self.first] = jump[is_local]
        alpha = np.zeros(solver.natural.kernel_dimension)
        if len(alpha):
            alpha -= solver.natural.amplitudes(jumps - opened)
            jumps = jumps + solver.natural.G @ alpha
        sums = np.array([(jumps - opened) @ (jumps - opened), jumps @ jumps, torn @ torn])
        error, *sizes = np.sqrt(distributed_arrays.allreduce_sum(solver.comm, sums))
        C = self.interface.compliance(bonds)
        jumps = jumps - (C - solver.intact_compliance) * lam
        return DualSolution(strain, lam, jumps, alpha, 0, 2, float(error / (max(sizes) or 1.0)), C)


class AxialFaces:
    """The axial part of the matrix S of `coulomb_faces`, in which axial jumps g = K^-1 b E are eliminated.

    K is H_DD with springs; weak springs of HELD times the diagonal entry of K hold the rows.

    Attributes:
        problem: condensed axial problem.
        jumps, stiffness: K^-1 b (n, v) and L - b^T K^-1 b (v, v).
    """

    def __init__(self, problem: CondensedProblem, rows: Int, springs: Float) -> None:
        """Condense the problem to rows (n,) with springs (n,), 0 for free faces.  Collective."""
        self.problem = problem
        K, b, L = problem.take(rows, springs)
        factor = lu_factor(K + HELD * np.diag(K.diagonal()))
        self.jumps = np.zeros_like(b)
        for _ in range(1 + INVERSE_ITERATIONS):
            self.jumps += lu_solve(factor, b - K @ self.jumps)
        # Stiffnesses up to UNRESISTED are rounding of the bonded stiffness, which must not carry a load.
        diagonal, stiffness = L.diagonal(), L - b.T @ self.jumps
        roots = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        values, vectors = np.linalg.eigh((stiffness + stiffness.T) / (2.0 * np.outer(roots, roots)))
        positive = (vectors * np.where(values > UNRESISTED, values, 0.0)) @ vectors.T
        resists = positive.diagonal() > UNRESISTED
        self.stiffness = np.asarray(positive * np.outer(resists * roots, resists * roots))


class SlidingCell:
    """The debonded faces of a cell; every call of `take` replaces the set of faces.

    Vectors x (m,) are scaled, as in `FaceSystem`, with the strains of all problems last.

    Attributes:
        interface: plane contact problem.
        friction, friction_of_damage: (k,) mu at this rank's nodes, and in the damaged fraction of bonds.
        rows, springs: (n,) ascending global normal rows of faces, and (2n,) stiffnesses 1 / (C - C_0) of damaged bonds.
        faces: dense system of these faces, on every rank.
    """

    def __init__(self, cell: CoupledInterfaces, friction: Float, friction_of_damage: Float) -> None:
        """Compute the response of the bonded cell to unit loads.  Collective; raises like `CondensedProblem`."""
        self.cell, self.interface, self.solver = cell, cell.plane, cell.plane.solver
        self.friction, self.friction_of_damage = friction, friction_of_damage
        self._plane, *self._axial = (CondensedProblem(problem) for problem in cell.problems)
        self._loads = len(self.solver.problem.loads)
        self.rows, self.springs = np.zeros(0, np.int64), np.zeros(0)
        self.faces = CoulombFaces(np.zeros((0, 0)), np.zeros(0))

    def take(self, bonds: BondState) -> None:
        """Condense the cell to debonded nodes, and to damaged bonds on springs.  Collective."""
        comm, row, first = self.solver.comm, self.interface.nodes.row, self._plane.first
        problems = (self._plane, *self._axial)
        gained = np.hstack([problem.gained(bonds) for problem in problems])
        self._more = gained[:, 1]
        self._damaged = (bonds.status == BONDED) & (gained[:, :2] > 0.0).any(axis=1)
        self._face_nodes = np.flatnonzero((bonds.status != BONDED) | self._damaged)
        self._held = np.flatnonzero(bonds.status == BONDED)
        self._held_rows = [problem.rows_of(self._held) for problem in problems]
        pulled = (gained > 0.0) & self._damaged[:, None]
        self._springs = np.divide(1.0, gained, out=np.zeros_like(gained), where=pulled)
        self._mu = np.where(self._damaged, self.friction_of_damage, self.friction)
        along = [problem.first + problem.interface.nodes.row for problem in self._axial]
        table = np.column_stack([first + row, self._mu, *along, self._springs])[self._face_nodes]
        table = np.concatenate(comm.allgather(table))
        table = table[np.argsort(table[:, 0])]
        faces_before, rows_before, springs_before = self.faces, self.rows, self.springs
        self.rows, springs = table[:, 0].astype(np.int64), table[:, -gained.shape[1] :]
        self.springs = springs[:, :2].ravel()
        self._position = np.searchsorted(self.rows, first + row[self._face_nodes])
        K, b, L = self._plane.take((self.rows[:, None] + np.arange(2)).ravel(), self.springs)
        self._along = [AxialFaces(problem, table[:, 2].astype(np.int64), springs[:, 2]) for problem in self._axial]
        S = block_diag(L, *(problem.stiffness for problem in self._along))
        b = np.pad(b, [(0, 0), (0, len(S) - self._loads)])
        self.faces = CoulombFaces(np.block([[K, -b], [-b.T, S]]), table[:, 1])
        if len(rows_before) and np.isin(rows_before, self.rows).all():
            pairs = (2 * np.searchsorted(self.rows, rows_before)[:, None] + np.arange(2)).ravel()
            loads = np.arange(self.faces.loads.start, self.faces.loads.stop)
            # Entries whose springs differ, and the axial loads, whose stiffness depends on all jumps.
            differs = np.repeat((self.springs[pairs] != springs_before).reshape(-1, 2).any(axis=1), 2)
            other = np.concatenate([pairs[differs], loads[self._loads :]])
            self.faces.follow(faces_before, np.concatenate([pairs, loads]), other)

    def begin(self, bonds: BondState, strain: Float) -> tuple[Status, Float]:
        """Condense the cell to `bonds`, and return face statuses (n,) and x (m,) at a strain (v,).  Collective.

        Without stored jumps all gaps and slips are zero.
        """
        self.take(bonds)
        jump = np.zeros((len(bonds.status), 2)) if bonds.gap_and_slip is None else bonds.gap_and_slip
        is_apart = np.where(self._damaged, ~bonds.pressed, bonds.status == OPEN)
        table = np.column_stack([np.where(is_apart, OPEN_FACE, bonds.sliding_signs), jump])[self._face_nodes]
        table = np.concatenate(self.solver.comm.allgather(np.column_stack([self._position, table])))
        table = table[np.argsort(table[:, 0])]
        status: Status = table[:, 1].astype(np.int8)
        return status, np.concatenate([table[:, 2:].ravel(), strain]) * self.faces.size

    def bonds(self, before: BondState, status: Status, x: Float) -> BondState:
        """Return this rank's bonds with face statuses (n,) and the jumps in x; damaged bonds stay BONDED."""
        nodes, face = self._face_nodes, status[self._position]
        holds, rubs = self._damaged[nodes], self.faces.friction[self._position] > 0.0
        jump, sliding = np.zeros((len(before.status), 2)), np.zeros(len(before.status), np.int8)
        jump[nodes] = self._jumps_of(x).reshape(-1, 2)[self._position]
        sliding[nodes] = np.where((face != OPEN_FACE) & rubs, face, STICK)
        contact, pressed = before.status.copy(), before.pressed.copy()
        contact[nodes] = np.where(holds, BONDED, np.where(face == OPEN_FACE, OPEN, CLOSED))
        pressed[nodes] = np.where(holds, face != OPEN_FACE, pressed[nodes])
        return replace(before, status=contact, pressed=pressed, gap_and_slip=jump, sliding=sliding)

    def stored(self, x: Float) -> float:
        """Return the energy per area that the cell stores in the state x."""
        return float(x @ self.faces.product(x)) / (2.0 * self.cell.area)

    def stretched(self, x: Float) -> float:
        """Return the energy per area in the plane springs 1 / (C - C_0) of damaged bonds in the state x."""
        return float(self.springs @ self._jumps_of(x) ** 2) / (2.0 * self.cell.area)

    def _jumps_of(self, x: Float) -> Float:
        """Return the unscaled jumps (2n,) of x in the plane."""
        return np.asarray((x / self.faces.size)[: self.faces.loads.start])

    def traction(self, x: Float) -> Float:
        """Return tractions (k, c) in the intact fraction of bonds, with the axial one if c = 3; 0 at debonded nodes."""
        force = np.zeros((len(self.friction), sum(rows.shape[1] for rows in self._held_rows)))
        parts = zip(self._held_rows, self._parts(x), strict=True)
        force[self._held] = np.hstack([problem.some_multipliers(rows, *answer) for rows, (problem, answer) in parts])
        damaged, slip = self._damaged[self._face_nodes], self._jumps_of(x)[1::2][self._position]
        node = self._face_nodes[damaged]
        C = self.solver.intact_compliance[self.interface.nodes.row[node] + 1]
        force[node, 1] = (C * force[node, 1] + slip[damaged]) / (C + self._more[node])
        return np.asarray(force / self.interface.nodes.length[:, None])

    def _parts(self, x: Float) -> list[tuple[CondensedProblem, tuple[Float, Float]]]:
        """Return each condensed problem with its unscaled jumps (n,) and strains (v,) in x."""
        jump, plane, along = np.split(x / self.faces.size, 2 * len(self.rows) + np.array([0, self._loads]))
        axial = [(faces.problem, (faces.jumps @ along, along)) for faces in self._along]
        return [(self._plane, (jump, plane)), *axial]

    def released_along(self, before: Macroscopic, after: Macroscopic) -> float:
        """Return the energy per area that a break at constant load releases in the axial problem, if any."""
        axial = [Macroscopic(state.strain[self._loads :], state.stress[self._loads :]) for state in (before, after)]
        return axial[0].released_to(axial[1])

    def macroscopic(self, x: Float) -> Macroscopic:
        """Return the macroscopic strains and stresses (v,) of all problems in the state x."""
        loads, size = self.faces.loads, self.faces.size
        return Macroscopic((x / size)[loads], (self.faces.product(x) * size)[loads] / self.cell.area)

    def given(self, load: Load) -> Float:
        """Return the prescribed values (v,) of a load: strains scaled like x, stresses scaled like S x."""
        size = self.faces.size[self.faces.loads]
        return np.where(load.by_stress, self.cell.area * load.values / size, load.values * size)

    def equilibrium(self, loads: Sequence[Load], bonds: BondState, x: Float) -> Equilibrium:
        """Return the equilibrium in state x under the last of `loads`.  Collective.

        Errors are relative to the largest effects of all `loads`; `kkt_friction` is the largest of `coulomb_errors`
        over the largest traction.
        """
        of_problems = list(zip(*map(self.cell.parts, loads), strict=True))
        scales, asked = [problem.scales for problem in self.cell.problems], list[Float]()
        for scale, problem_loads in zip(scales, of_problems, strict=True):
            asked.append(np.max([scale.asked(load) for load in problem_loads], axis=0))
        # Rounding in an unloaded problem is as large as in the loaded problem.
        largest_strain = max(scale.imposed_strain(strain).max() for scale, strain in zip(scales, asked, strict=True))
        # Forces of springs come from the jumps in x: jumps by F lambda would be divided by a vanishing compliance.
        states, acting, jumps = list[Equilibrium](), list[Float](), list[Float]()
        for problem_loads, strains, (problem, (jump, strain)) in zip(of_problems, asked, self._parts(x), strict=True):
            solution = problem.solution(bonds, jump, strain)
            strains[: problem.solver.problem.strains] = largest_strain
            certificate = problem.interface.certificate(bonds, solution, strains)
            states.append(Equilibrium(problem_loads[-1], bonds, solution, 0, 1, 0, certificate, strains))
            acting.append(problem.interface.scales.acting(strain, strains))
            jumps.append(jump.reshape(-1, problem.solver.jump_operator.components))
        plane, *axial = states
        # Bonds, compressed faces and the friction on these faces resist rigid motions.
        row, is_closed = self.interface.nodes.row, bonds.status == CLOSED
        noise = scales[0].force_noise(replace(plane.solution, strain=acting[0]))
        is_pressed = is_closed & (plane.solution.lam[row] < -noise)
        active = self.interface.active(np.where(is_closed & ~is_pressed, OPEN, bonds.status).astype(np.int8))
        active[row[is_pressed & (self.friction > 0.0)] + 1] = 1.0
        plane = replace(plane, free_motions=int(self.solver.natural.free_motions(active).shape[1]))
        traction, node = self.cell.traction([state.solution for state in states]), self._face_nodes
        largest = scales[0].over_interface(np.abs(traction).max(axis=1, initial=0.0))
        largest = np.max([largest, *(scale.bond_stress(of) for scale, of in zip(scales, acting, strict=True))], axis=0)
        forces = np.hstack(jumps)[self._position] * self._springs[node]
        traction[node] -= forces / self.interface.nodes.length[node, None]
        excess = coulomb_errors(traction, self._mu, bonds.sliding_signs)
        excess = np.where((bonds.status == BONDED) & ~self._damaged, 0.0, excess)
        excess /= np.where(largest > 0.0, largest, 1.0)
        error = {"kkt_friction": float(self.solver.comm.allreduce(excess.max(initial=0.0), MPI.MAX))}
        return replace(plane, certificate=plane.certificate | error, axial=axial[0] if axial else None)
