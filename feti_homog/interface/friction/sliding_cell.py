"""The debonded faces of a cell, condensed to dense arrays: what rank 0 decides, and multipliers of all ranks.

The matrix S of `coulomb_faces` is that of `CondensedProblem` in the plane, and behind it in generalized plane strain
that of `AxialFaces`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI
from scipy.linalg import block_diag

from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN, BondState, Equilibrium, Status, coulomb_errors
from feti_homog.interface.friction.condensed_problem import AxialFaces, CondensedProblem
from feti_homog.interface.friction.coulomb_faces import CoulombFaces
from feti_homog.interface.friction.status_system import OPEN_FACE, STICK
from feti_homog.interface.loads import Load, Macroscopic
from feti_homog.typing import Float, Int


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
        more = np.hstack([self._gained(each, bonds) for each in (self._plane, *self._axial)])
        self._more = more[:, 1]
        self._damaged = (bonds.status == BONDED) & (more[:, :2] > 0.0).any(axis=1)
        self._own = np.flatnonzero((bonds.status != BONDED) | self._damaged)
        self._held = np.flatnonzero(bonds.status == BONDED)
        problems = (self._plane, *self._axial)
        rows = [(each.interface.nodes.row[self._held], each.solver.jump_operator.components) for each in problems]
        self._held_rows = [own[:, None] + np.arange(components) for own, components in rows]
        springs = np.divide(1.0, more, out=np.zeros_like(more), where=(more > 0.0) & self._damaged[:, None])
        self._springs = springs
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

    @staticmethod
    def _gained(problem: CondensedProblem, bonds: BondState) -> Float:
        """(k, c) compliance that damage adds to the springs of a problem, if all bonds are pulled."""
        interface = problem.interface
        pulled = replace(bonds, pressed=np.zeros(len(bonds.status), bool))
        more = interface.compliance(pulled) - problem.solver.intact_compliance
        return np.asarray(more[interface.nodes.row[:, None] + np.arange(problem.solver.jump_operator.components)])

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
        return [(self._plane, (jump, plane)), *((each.problem, each.parts(along)) for each in self._along)]

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
