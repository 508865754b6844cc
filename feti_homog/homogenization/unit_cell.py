"""The torn cell: from a case to subdomains on their ranks and a solver that is set up for them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from mpi4py import MPI

from feti_homog.cell.outline import MERGED
from feti_homog.cell.refinement import Lattice
from feti_homog.cell.submesh import Submesh
from feti_homog.common.mpi_errors import agree, on_root_only
from feti_homog.common.progress import Progress
from feti_homog.config.case import Case
from feti_homog.config.materials import plane_stiffness
from feti_homog.feti.decomposition.shared_entities import SharedEntities
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.solver import FetiSolver
from feti_homog.feti.thresholds import DEFAULTS, Thresholds
from feti_homog.homogenization import cost_model
from feti_homog.homogenization.domain_partition import Plan, coarse_mesh, deal
from feti_homog.interface import debonded_arcs
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class TornCell:
    """The cell on all ranks; `subdomains` are this rank's."""

    comm: MPI.Intracomm
    case: Case
    plan: Plan
    lattice: Lattice
    subdomains: list[Subdomain]
    solver: FetiSolver

    @cached_property
    def offsets(self) -> Int:
        """Where each subdomain begins in this rank's vectors of degrees of freedom."""
        return np.cumsum([0, *(len(s.Q) for s in self.subdomains)])

    @cached_property
    def directions(self) -> Float:
        """(k,) directions in degrees of this rank's interface nodes about the centres of their fibres."""
        nodes = self.solver.jump_operator.nodes
        return debonded_arcs.angles(nodes.points, nodes.fibre, self.plan.centres, self.plan.period)

    def debonded(self, opening: float | None) -> Bool:
        """(k,) which of this rank's interface nodes are debonded from the start: none without an [interface].

        Arcs without an angle have that `opening`; None if there are none.
        """
        nodes = self.solver.jump_operator.nodes
        # The mesher moves a tip to a vertex that is as near as this.
        moved = nodes.vertex & (self.case.cell.file is None)
        near = np.where(moved, np.degrees(MERGED), debonded_arcs.SAME)
        number = nodes.fibre - self.plan.first_fibre + 1
        cracks = nodes.precracked & (self.case.interface is not None)
        return cracks | debonded_arcs.debonded(self.case.arcs, opening, number, self.directions, near)

    def areas(self) -> dict[str, float]:
        """Meshed area of each phase; collective."""
        local = dict.fromkeys(self.plan.phases, 0.0)
        for s in self.subdomains:
            local[s.submesh.phase] += s.area
        return {phase: self.comm.allreduce(area) for phase, area in local.items()}

    def total(self, number: int) -> int:
        """Sum of a number over ranks; collective."""
        return int(self.comm.allreduce(number))


def tear(case: Case, comm: MPI.Intracomm, progress: Progress, thresholds: Thresholds = DEFAULTS) -> TornCell:
    """The torn cell of a case, its subdomains factored.  Collective.

    Raises:
        CaseError, MeshError: on every rank.
    """
    plan, shared, lattice, subdomains = assembled(case, comm, progress)
    with progress.stage("factor") as words:
        solver = FetiSolver(comm, shared, subdomains, lattice, cost_model.applications(case), thresholds)
        words.append(f"{solver.jump_operator.total} multipliers, coarse dimension {solver.coarse.coarse_dimension}")
    return TornCell(comm, case, plan, lattice, subdomains, solver)


def assembled(
    case: Case, comm: MPI.Intracomm, progress: Progress
) -> tuple[Plan, SharedEntities, Lattice, list[Subdomain]]:
    """Mesh the cell on rank 0, deal out its pieces, and refine and assemble them where they are.  Collective.

    Returns the plan, what this rank's pieces share with others, the lattice of the refinement, and the subdomains.
    Raises as `tear`.
    """
    lattice = Lattice.of(case.cell.refine, case.cell.order)
    with progress.stage("mesh") as words:
        mesh = on_root_only(comm, coarse_mesh, case)
        shares = on_root_only(comm, deal, case, mesh, lattice, comm.size)
        plan, pieces, shared = comm.scatter(shares or [])
        if mesh is not None and len(mesh.debonded_edges) and case.interface is None:
            words.append("its debonded curve is bonded, for there is no [interface]")
        words.append(f"{plan.coarse_triangles} triangles, {plan.bodies} bodies, {plan.subdomains} subdomains")
        del mesh, shares
    with progress.stage("assemble") as words:
        subdomains = agree(comm, _assemble, case, pieces, lattice)
        dofs = comm.allreduce(sum(len(s.Q) for s in subdomains))
        words.append(f"{dofs} degrees of freedom, refine = {case.cell.refine}, order = {case.cell.order}")
    return plan, shared, lattice, subdomains


def _assemble(case: Case, pieces: list[Submesh], lattice: Lattice) -> list[Subdomain]:
    plane = case.analysis.plane
    return [Subdomain.build(p, lattice, plane_stiffness(case.material_of(p.phase), plane)) for p in pieces]


def describe(case: Case, n_ranks: int) -> str:
    """What a run of the case on `n_ranks` ranks would do, in words; on rank 0."""
    lattice = Lattice.of(case.cell.refine, case.cell.order)
    shares = deal(case, coarse_mesh(case), lattice, n_ranks)
    plan = shares[0][0]
    triangles = [sum(len(p.triangles) for p in pieces) for _, pieces, _ in shares]
    nodes = [t * lattice.intervals**2 // 2 for t in triangles]
    own = [len(pieces) for _, pieces, _ in shares]
    taken = cost_model.estimate(
        [2 * n for n in nodes], own, plan.coarse_triangles, plan.bodies, cost_model.applications(case)
    )
    lines = [
        f"case       {case.name}: {case.analysis.type}, plane {case.analysis.plane}",
        f"cell       {plan.width:g} x {plan.height:g}, phases {', '.join(plan.phases)}",
        f"mesh       {plan.coarse_triangles} coarse triangles, {plan.coarse_triangles * len(lattice.triangles)} "
        f"elements of order {case.cell.order}, about {2 * sum(nodes)} degrees of freedom",
        *([f"fibres     {len(plan.centres) - plan.first_fibre}, numbered from 1"] if case.interface else []),
        f"tearing    {plan.bodies} bodies, {plan.subdomains} subdomains, {shares[0][2].total} multipliers",
        *(
            f"rank {rank:<5} {len(pieces)} subdomains, about {2 * n} degrees of freedom"
            for rank, ((_, pieces, _), n) in enumerate(zip(shares, nodes, strict=True))
        ),
        *cost_model.words(taken, n_ranks),
        *(f"warning    {warning}" for warning in case.warnings()),
        "the case is valid",
    ]
    return "\n".join(lines)
