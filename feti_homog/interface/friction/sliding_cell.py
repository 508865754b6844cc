"""The debonded faces of a cell, condensed to dense arrays: what rank 0 decides, and multipliers of all ranks.

With H the inverse of the dual operator of the bonded cell, prescribed jumps g on the rows D of debonded nodes leave

    lam = H (d E - g),      |UC| Sigma = L E - b^T g,      b = (H d)_D,

L the bonded stiffness times the area: the matrix S of `coulomb_faces` is [[H_DD, -b], [-b^T, L]].
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.feti.dual_solution import DualSolution
from feti_homog.interface.contact.contact_certificate import kkt_errors
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
        self.take(np.full(len(friction), BONDED, np.int8))

    def take(self, status: Status) -> None:
        """Have the faces of the debonded nodes of a status (k,).  Collective."""
        comm, row = self.solver.comm, self.interface.nodes.row
        self._own = np.flatnonzero(status != BONDED)
        own = np.stack([self._first + row[self._own], self.friction[self._own]], axis=1)
        rows, friction = np.concatenate(comm.allgather(own)).T
        order = np.argsort(rows)
        self.rows = rows[order].astype(np.int64)
        self._place = np.searchsorted(self.rows, self._first + row[self._own])
        pairs = self._pairs
        self._columns, K = self._inverse.columns(pairs)
        b = gather_rows(comm, self._response, self._first, pairs)
        self.faces = CoulombFaces(np.block([[K, -b], [-b.T, self._bonded]]), friction[order])

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
        self.take(bonds.status)
        jump = np.zeros((len(bonds.status), 2)) if bonds.gap_and_slip is None else bonds.gap_and_slip
        own = np.column_stack([jump, np.where(bonds.status == OPEN, OPEN_FACE, bonds.sliding_signs)])[self._own]
        whole = np.concatenate(self.solver.comm.allgather(np.column_stack([self._place, own])))
        whole = whole[np.argsort(whole[:, 0])]
        status: Status = whole[:, 3].astype(np.int8)
        return status, np.concatenate([whole[:, 1:3].ravel(), strain]) * self.faces.size

    def bonds(self, before: BondState, status: Status, x: Float) -> BondState:
        """Return the state of the nodes of this rank with statuses (n,) and scaled x of the faces."""
        own, jump = status[self._place], np.zeros((len(before.status), 2))
        jump[self._own] = (x / self.faces.size)[: 2 * len(status)].reshape(-1, 2)[self._place]
        nodes, sliding = before.status.copy(), np.zeros(len(before.status), np.int8)
        nodes[self._own] = np.where(own == OPEN_FACE, OPEN, CLOSED)
        sliding[self._own] = np.where(own == OPEN_FACE, STICK, own)
        return replace(before, status=nodes, gap_and_slip=jump, sliding=sliding)

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

    def solution(self, x: Float) -> DualSolution:
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
        return DualSolution(strain, lam, left, alpha, 0, 2, residual, solver.operator.compliance)

    def equilibrium(self, load: Load, bonds: BondState, x: Float) -> Equilibrium:
        """Return the state of scaled x, with its certificate.  Collective."""
        solution, interface = self.solution(x), self.interface
        debonded = bonds.status != BONDED
        certificate = kkt_errors(
            self.solver.comm,
            interface.traction(solution),
            interface.nodes.length,
            solution.jump[interface.nodes.row],
            debonded,
            bonds.status == CLOSED,
            interface.scales.imposed(solution.strain),
            interface.scales.bond_stress(solution.strain),
            interface.scales.over_interface,
        )
        return Equilibrium(load, bonds, solution, 0, 1, 0, certificate)
