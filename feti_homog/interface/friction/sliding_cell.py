"""The debonded faces of a cell, condensed to dense arrays: what rank 0 decides, and multipliers of all ranks.

With H the inverse of the dual operator of the bonded cell, prescribed jumps g on the rows D of debonded nodes leave

    lam = H (d E - g),      |UC| Sigma = L E - b^T g,      b = (H d)_D,

L the bonded stiffness times the area: the matrix S of `coulomb_faces` is [[H_DD, -b], [-b^T, L]].
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from mpi4py import MPI

from feti_homog.errors import CaseError
from feti_homog.feti.dual_solution import DualSolution
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN, BondState, Equilibrium, Status
from feti_homog.interface.friction.coulomb_faces import CoulombFaces
from feti_homog.interface.friction.status_system import OPEN_FACE, STICK
from feti_homog.interface.loads.load import Load
from feti_homog.parallel.distributed_arrays import allreduce_sum, gather_rows
from feti_homog.typing import Float, Int


class SlidingCell:
    """The faces of one set of debonded nodes.

    Attributes:
        interface: the contact problem of the plane.
        friction: (k,) mu of the nodes of this rank.
        rows: (n,) global normal rows of the debonded nodes, rising.
        faces: of these nodes, on every rank.
    """

    def __init__(self, interface: ContactProblem, friction: Float) -> None:
        """Find the response of the bonded cell to its loads.  Collective.

        Raises:
            CaseError: the solver has no inverse of the dual operator.
        """
        self.interface, self.friction = interface, friction
        self.solver = interface.solver
        if self.solver.exact_inverse is None:
            raise CaseError("[interface] friction: needs -feti_pc_type influence, with which this cell may not fit")
        self._inverse = self.solver.exact_inverse
        self._first = self.solver.jump_operator.owned[0]
        loads = np.eye(len(self.solver.problem.loads))
        self._response = self._inverse.multipliers(self.solver.d, loads)
        bonded = self.solver.torn_stiffness + allreduce_sum(self.solver.comm, self.solver.d.T @ self._response)
        self._bonded = (bonded + bonded.T) / 2

    def take(self, bonds: BondState) -> None:
        """Have the faces of the debonded nodes, and of damaged bonds, which are on springs.  Collective."""
        comm, row = self.solver.comm, self.interface.nodes.row
        pulled = replace(bonds, pressed=np.zeros(len(row), bool))
        more = (self.interface.compliance(pulled) - self.solver.intact_compliance)[row[:, None] + np.arange(2)]
        self._damaged = (bonds.status == BONDED) & (more > 0.0).any(axis=1)
        self._own = np.flatnonzero((bonds.status != BONDED) | self._damaged)
        springs = np.divide(1.0, more, out=np.zeros_like(more), where=(more > 0.0) & self._damaged[:, None])
        friction = np.where(self._damaged, 0.0, self.friction)
        own = np.column_stack([self._first + row, friction, springs])[self._own]
        rows, friction, *both = np.concatenate(comm.allgather(own)).T
        order = np.argsort(rows)
        self.rows, self.springs = rows[order].astype(np.int64), np.stack(both, axis=1)[order].ravel()
        self._place = np.searchsorted(self.rows, self._first + row[self._own])
        pairs = self._pairs
        self._columns, K = self._inverse.columns(pairs)
        b = gather_rows(comm, self._response, self._first, pairs)
        self.faces = CoulombFaces(np.block([[K + np.diag(self.springs), -b], [-b.T, self._bonded]]), friction[order])

    @property
    def _pairs(self) -> Int:
        """(2n,) global rows of the debonded nodes."""
        return np.asarray((self.rows[:, None] + np.arange(2)).ravel())

    @cached_property
    def area(self) -> float:
        """Area of the cell."""
        return float(self.interface.size.prod())

    def begin(self, bonds: BondState, strain: Float) -> tuple[Status, Float]:
        """Return the statuses (n,) of the faces of the bonds, and scaled x (m,), with a strain (v,).  Collective.

        Without a history the faces just touch.
        """
        self.take(bonds)
        jump = np.zeros((len(bonds.status), 2)) if bonds.gap_and_slip is None else bonds.gap_and_slip
        apart = np.where(self._damaged, ~bonds.pressed, bonds.status == OPEN)
        own = np.column_stack([jump, np.where(apart, OPEN_FACE, bonds.sliding_signs)])[self._own]
        whole = np.concatenate(self.solver.comm.allgather(np.column_stack([self._place, own])))
        whole = whole[np.argsort(whole[:, 0])]
        status: Status = whole[:, 3].astype(np.int8)
        return status, np.concatenate([whole[:, 1:3].ravel(), strain]) * self.faces.size

    def bonds(self, before: BondState, status: Status, x: Float) -> BondState:
        """Return the state of the nodes of this rank with statuses (n,) and scaled x of the faces."""
        own, jump = status[self._place], np.zeros((len(before.status), 2))
        jump[self._own] = (x / self.faces.size)[: 2 * len(status)].reshape(-1, 2)[self._place]
        nodes, sliding = before.status.copy(), np.zeros(len(before.status), np.int8)
        holds, pressed = self._damaged[self._own], before.pressed.copy()
        nodes[self._own] = np.where(holds, BONDED, np.where(own == OPEN_FACE, OPEN, CLOSED))
        sliding[self._own] = np.where((own == OPEN_FACE) | holds, STICK, own)
        pressed[self._own] = np.where(holds, own != OPEN_FACE, pressed[self._own])
        return replace(before, status=nodes, pressed=pressed, gap_and_slip=jump, sliding=sliding)

    def stretched(self, x: Float) -> float:
        """Return the energy per area of the springs in scaled x by which damaged bonds have become softer."""
        jump = (x / self.faces.size)[: 2 * len(self.rows)]
        return float(self.springs @ jump**2) / (2.0 * self.area)

    def multipliers(self, x: Float) -> Float:
        """(owned rows,) lam of scaled x."""
        plain, last = x / self.faces.size, 2 * len(self.rows)
        return np.asarray(self._response @ plain[last:] - self._columns @ plain[:last])

    def strain(self, x: Float) -> Float:
        """(v,) E of scaled x."""
        return np.asarray((x / self.faces.size)[2 * len(self.rows) :])

    def stress(self, x: Float) -> Float:
        """(v,) Sigma of scaled x."""
        return np.asarray(((self.faces.S @ x) * self.faces.size)[2 * len(self.rows) :] / self.area)

    def given(self, load: Load) -> Float:
        """(v,) scaled values of a load."""
        size = self.faces.size[2 * len(self.rows) :]
        return np.where(load.by_stress, self.area * load.values / size, load.values * size)

    def solution(self, bonds: BondState, x: Float) -> DualSolution:
        """Return the multipliers, and the jumps that they leave by the dual operator itself.  Collective."""
        solver, lam, strain = self.solver, self.multipliers(x), self.strain(x)
        left = solver.d @ strain - solver.operator.apply(lam)
        opened, last = np.zeros(len(lam)), 2 * len(self.rows)
        pairs = self._pairs
        mine = (pairs >= self._first) & (pairs < self._first + len(lam))
        opened[pairs[mine] - self._first] = (x / self.faces.size)[:last][mine]
        alpha = np.zeros(solver.natural.kernel_dimension)
        if len(alpha):
            alpha -= solver.natural.amplitudes(left - opened)
            left = left + solver.natural.G @ alpha
        norms = allreduce_sum(solver.comm, np.array([(left - opened) @ (left - opened), left @ left]))
        torn = solver.d @ strain
        size = np.sqrt(max(norms[1], allreduce_sum(solver.comm, np.array([torn @ torn]))[0]))
        residual = float(np.sqrt(norms[0]) / (size or 1.0))
        C = self.interface.compliance(bonds)
        return DualSolution(strain, lam, left - (C - solver.intact_compliance) * lam, alpha, 0, 2, residual, C)

    def equilibrium(self, load: Load, bonds: BondState, x: Float) -> Equilibrium:
        """Return the state of scaled x, with its certificate.  Collective."""
        solution = self.solution(bonds, x)
        certificate = self.interface.certificate(bonds, solution) | {"kkt_friction": self._excess(bonds, solution)}
        return Equilibrium(load, bonds, solution, 0, 1, 0, certificate)

    def _excess(self, bonds: BondState, solution: DualSolution) -> float:
        """Return how far shear on debonded faces is beyond mu p, or off s mu p, relative to the largest traction.

        Collective.
        """
        normal, shear = self.interface.traction(solution).T
        limit, scales = self.friction * np.maximum(-normal, 0.0), self.interface.scales
        largest = scales.over_interface(np.maximum(np.abs(normal), np.abs(shear)))
        largest = np.maximum(largest, scales.bond_stress(self.interface.acting(bonds, solution.strain)))
        sliding = bonds.sliding_signs
        off = np.where(sliding == 0, np.maximum(np.abs(shear) - limit, 0.0), np.abs(sliding * shear - limit))
        off = np.where(bonds.status == BONDED, 0.0, off) / np.where(largest > 0.0, largest, 1.0)
        return float(self.solver.comm.allreduce(off.max(initial=0.0), MPI.MAX))
