"""Torn cells with interfaces, and the same cells for the quadratic programme that they are checked by."""

from dataclasses import dataclass, replace

import numpy as np
from petsc4py import PETSc
from reference.quadratic_programme import QuadraticProgramme, torus_keys

from feti_homog.case import sections
from feti_homog.feti.thresholds import DEFAULTS
from feti_homog.homogenization import unit_cell
from feti_homog.homogenization.partition_policy import DEFAULT_POLICY
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.states import BONDED, OPEN, BondState
from feti_homog.mesh.arrange import arrange
from feti_homog.system.petsc.options_database import case_options
from feti_homog.system.runtime.standard_streams import Progress
from support.cases import make_case


@dataclass(frozen=True)
class ReferencedCell:
    """A torn cell and, on rank 0, its quadratic programme and that one's number of each interface node."""

    cell: TornCell
    reference: QuadraticProgramme | None
    order: np.ndarray

    def interface(self, contact):
        return interface(self.cell, contact)

    def status(self, bonded):
        """Return the status on this rank, debonded nodes open, of the reference's `bonded` (k,) on rank 0.

        Collective.
        """
        comm = self.cell.comm
        bonded = comm.bcast(bonded[self.order] if comm.rank == 0 else None)
        first = comm.exscan(self.here) or 0
        return np.where(bonded[first : first + self.here], BONDED, OPEN).astype(np.int8)

    def in_reference_order(self, values):
        """Values of the interface nodes in the reference's order, on every rank.  Collective."""
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


def tear(comm, arcs=(), thresholds=DEFAULTS, springs=(None, None), policy=DEFAULT_POLICY, **case):
    """Return the torn cell of the case that `make_case` makes. Collective.

    The tips of arcs are at its nodes, and elastic interfaces have the stiffnesses `springs`.
    """
    PETSc.garbage_cleanup(comm)
    normal, tangential = springs
    bonding = sections.InterfaceSection(debonded=tuple(arcs), normal_stiffness=normal, tangential_stiffness=tangential)
    case = replace(make_case(**case), interfaces=() if bonding is None else (bonding,))
    with case_options(case.petsc):
        return unit_cell.tear(case, comm, Progress(comm, quiet=True), thresholds, policy)


def printed(comm, capfd, **case):
    """Return on every rank the lines that a torn cell and one solve print on rank 0."""
    capfd.readouterr()
    cell = tear(comm, **case)
    cell.solver.solve(np.array([1.0, -0.5, 0.3]), np.zeros(cell.solver.rows))
    return cell, comm.bcast(capfd.readouterr().out)


def bonds(status):
    """State of bonds without memory."""
    return BondState(status, np.zeros((len(status), 0)), np.zeros(len(status), bool))


def interface(cell, contact):
    """Its interfaces."""
    return ContactProblem(cell.solver, contact, np.array([cell.summary.width, cell.summary.height]))


def build(comm, **case):
    """Return the cell of `tear` and its quadratic programme. Collective."""
    return referenced(tear(comm, **case))


def referenced(cell):
    """Return a cell of round fibres, all of them coated or none, and its quadratic programme. Collective."""
    comm, fibres = cell.comm, arrange(cell.case.cell)
    size = np.array([cell.summary.width, cell.summary.height])
    inwards = ["matrix", *(["coating"] if fibres.coated.all() else []), "fibre"]
    radii = np.array([fibres.outer_radii, fibres.radii])[-len(inwards) + 1 :]
    parts = [
        (s.mesh.points, s.mesh.triangles, s.submesh.body, inwards.index(s.submesh.phase), s.L, s.is_mixed)
        for s in cell.subdomains
    ]
    parts, points = comm.gather(parts), comm.gather(cell.solver.jump_operator.nodes.points)
    if parts is None:
        return ReferencedCell(cell, None, np.zeros(0, int))
    reference = QuadraticProgramme([part for own in parts for part in own], fibres.centres, radii, size)
    key = torus_keys(np.concatenate(points), size)
    order = np.searchsorted(reference.key, key)
    assert (np.sort(key) == reference.key).all()
    return ReferencedCell(cell, reference, order)


def energy(cell, solution):
    """Strain energy of the bodies from their displacements.  Collective."""
    E, u = solution.strain, cell.solver.displacement(solution)
    total = 0.0
    for s, offset in zip(cell.subdomains, cell.offsets, strict=False):
        own = u[offset : offset + len(s.Q)]
        total += s.area * E @ s.L @ E / 2 + E @ s.Q.T @ own + own @ (s.assemble_stiffness() @ own) / 2
    return cell.comm.allreduce(total)


def stress(cell, solution):
    """Sigma from the multipliers.  Collective."""
    return cell.solver.stress_integral(solution) / cell.summary.area
