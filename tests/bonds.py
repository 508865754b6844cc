"""Torn cells with interfaces for the tests, and the same cells for the twins."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from cells import make_case
from petsc4py import PETSc
from reference.quadratic_programme import QPTwin, keys

from feti_homog.cell.arrangement import arrange
from feti_homog.common.petsc_options import case_options
from feti_homog.common.progress import Progress
from feti_homog.config import sections
from feti_homog.feti.thresholds import DEFAULTS
from feti_homog.homogenization import unit_cell
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact import BONDED, OPEN, Interface


@dataclass(frozen=True)
class Bonds:
    """A torn cell, its twin (None but on rank 0) and, there, the twin's number of each node in the ranks' order."""

    cell: TornCell
    twin: QPTwin | None
    order: np.ndarray

    def interface(self, contact):
        return interface(self.cell, contact)

    def status(self, bonded):
        """The status on this rank, debonded nodes open, of the twin's `bonded` (k,) on rank 0.  Collective."""
        comm = self.cell.comm
        bonded = comm.bcast(bonded[self.order] if comm.rank == 0 else None)
        first = comm.exscan(self.here) or 0
        return np.where(bonded[first : first + self.here], BONDED, OPEN).astype(np.int8)

    def of_twin(self, values):
        """Values of the interface nodes in the twin's order, on every rank.  Collective."""
        parts = self.cell.comm.gather(values)
        if parts is not None:
            values = np.concatenate(parts)
            result = np.empty_like(values)
            result[self.order] = values
            return self.cell.comm.bcast(result)
        return self.cell.comm.bcast(None)

    @property
    def here(self):
        return len(self.cell.solver.jump_operator.nodes.row)

    def start(self):
        return np.zeros(self.cell.solver.rows)


def tear(comm, arcs=(), thresholds=DEFAULTS, **case):
    """The torn cell of the case that `make_case` makes, the tips of arcs at its nodes.  Collective."""
    PETSc.garbage_cleanup(comm)
    case = replace(make_case(**case), interface=sections.InterfaceSection(debonded=tuple(arcs)))
    with case_options(case.petsc):
        return unit_cell.tear(case, comm, Progress(comm, quiet=True), thresholds)


def printed(comm, capfd, **case):
    """What a torn cell and one solve print on rank 0, on every rank."""
    capfd.readouterr()
    cell = tear(comm, **case)
    cell.solver.solve(np.array([1.0, -0.5, 0.3]), np.zeros(cell.solver.rows))
    return cell, comm.bcast(capfd.readouterr().out)


def interface(cell, contact):
    """Its interfaces."""
    return Interface(cell.solver, contact, np.array([cell.plan.width, cell.plan.height]))


def build(comm, **case):
    """The cell of `tear` and its twin.  Collective."""
    cell = tear(comm, **case)
    size = np.array([cell.plan.width, cell.plan.height])
    parts = [
        (s.mesh.points, s.mesh.triangles, s.submesh.body, s.submesh.phase == "matrix", s.L) for s in cell.subdomains
    ]
    parts, points = comm.gather(parts), comm.gather(cell.solver.jump_operator.nodes.points)
    if parts is None:
        return Bonds(cell, None, np.zeros(0, int))
    fibres = arrange(cell.case.cell)
    twin = QPTwin([part for own in parts for part in own], fibres.centres, fibres.radii, size)
    key = keys(np.concatenate(points), size)
    order = np.searchsorted(twin.key, key)
    assert (np.sort(key) == twin.key).all()
    return Bonds(cell, twin, order)


def energy(cell, solution):
    """Strain energy of the cell from its displacements.  Collective."""
    E, u = solution.strain, cell.solver.displacement(solution)
    total = 0.0
    for s, offset in zip(cell.subdomains, cell.offsets, strict=False):
        own = u[offset : offset + len(s.Q)]
        total += s.area * E @ s.L @ E / 2 + E @ s.Q.T @ own + own @ (s.K @ own) / 2
    return cell.comm.allreduce(total)


def stress(cell, solution):
    """Sigma from the multipliers.  Collective."""
    return cell.solver.stress_integral(solution) / cell.plan.area
