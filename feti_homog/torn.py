"""The torn cell: from a case to subdomains on their ranks and a solver that is set up for them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from feti_homog import case as cases
from feti_homog import cost
from feti_homog.case import Case
from feti_homog.cell.centres import fibre_centres
from feti_homog.cell.mesh import CoarseMesh
from feti_homog.cell.outline import MERGED
from feti_homog.cell.piece import Piece, cut
from feti_homog.cell.refine import Lattice
from feti_homog.cell.torus import Torus, edge_pairs
from feti_homog.errors import CaseError
from feti_homog.feti.decomposition import decompose, pieces_for_count, pieces_for_size
from feti_homog.feti.shared import Shared, share
from feti_homog.feti.solver import FetiSolver
from feti_homog.feti.subdomain import Subdomain
from feti_homog.interface import arcs
from feti_homog.material import plane_stiffness
from feti_homog.parallel import agree, on_root_only
from feti_homog.progress import Progress

Int = NDArray[np.int64]
Float = NDArray[np.float64]
Bool = NDArray[np.bool_]

# Typical numbers, for the choice between implicit and explicit operators.
ITERATIONS_OF_A_SOLVE, SOLVES_OF_A_CONTACT, SOLVES_OF_A_PATH = 20, 3, 100
# Degrees of freedom of a piece that make set-up and solve fastest, unless there would be more than so many pieces: the
# coarse problem grows faster than they do; a piece gets `NARROW` of its boundary to other bodies at most.  A body is
# cut that is larger than a piece by a factor, or, where bonds break, whose boundary is too long for dense matrices.
FASTEST, MOST, NARROW, LARGE, WIDE = 3000, 4000, 500, 2.5, 2500
FIBRES_OF = {"square": 1, "hexagonal": 2}


@dataclass(frozen=True)
class Plan:
    """What rank 0 tells every rank of the whole cell.

    Fibre number 1 of the case file is the constituent `first_fibre`; `centres` (constituents, 2) are NaN where
    there is none.
    """

    width: float
    height: float
    phases: tuple[str, ...]
    bodies: int
    subdomains: int
    coarse_triangles: int
    first_fibre: int
    centres: Float

    @property
    def period(self) -> Float:
        """(2,) width and height."""
        return np.array([self.width, self.height])

    @property
    def area(self) -> float:
        """|UC|."""
        return self.width * self.height


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
        nodes = self.solver.constraints.nodes
        return arcs.angles(nodes.points, nodes.fibre, self.plan.centres, self.plan.period)

    def debonded(self, opening: float | None) -> Bool:
        """(k,) which of this rank's interface nodes are debonded from the start: none without an [interface].

        Arcs without an angle have that `opening`; None if there are none.
        """
        nodes = self.solver.constraints.nodes
        # The mesher moves a tip to a vertex that is as near as this.
        moved = nodes.vertex & (self.case.cell.file is None)
        near = np.where(moved, np.degrees(MERGED), arcs.SAME)
        number = nodes.fibre - self.plan.first_fibre + 1
        cracks = nodes.precracked & (self.case.interface is not None)
        return cracks | arcs.debonded(self.case.arcs, opening, number, self.directions, near)

    def areas(self) -> dict[str, float]:
        """Meshed area of each phase; collective."""
        local = dict.fromkeys(self.plan.phases, 0.0)
        for s in self.subdomains:
            local[s.piece.phase] += s.area
        return {phase: self.comm.allreduce(area) for phase, area in local.items()}

    def total(self, number: int) -> int:
        """Sum of a number over ranks; collective."""
        return int(self.comm.allreduce(number))


def tear(case: Case, comm: MPI.Intracomm, progress: Progress) -> TornCell:
    """Mesh the cell on rank 0, deal out its pieces, and refine, assemble and factor them where they are.

    Raises:
        CaseError, MeshError: on every rank.
    """
    lattice = Lattice.of(case.cell.refine, case.cell.order)
    with progress.stage("mesh") as words:
        mesh = on_root_only(comm, coarse_mesh, case)
        shares = on_root_only(comm, _deal, case, mesh, lattice, comm.size)
        plan, pieces, shared = comm.scatter(shares or [])
        if mesh is not None and len(mesh.debonded_edges) and case.interface is None:
            words.append("its debonded curve is bonded, for there is no [interface]")
        words.append(f"{plan.coarse_triangles} triangles, {plan.bodies} bodies, {plan.subdomains} subdomains")
    with progress.stage("assemble") as words:
        subdomains = agree(comm, _assemble, case, pieces, lattice)
        dofs = comm.allreduce(sum(len(s.Q) for s in subdomains))
        words.append(f"{dofs} degrees of freedom, refine = {case.cell.refine}, order = {case.cell.order}")
    with progress.stage("factor") as words:
        solver = FetiSolver(comm, shared, subdomains, lattice, _applications(case))
        words.append(
            f"{solver.constraints.total} multipliers, coarse dimension {solver.coarse.vectors}"
        )
    return TornCell(comm, case, plan, lattice, subdomains, solver)


def coarse_mesh(case: Case) -> CoarseMesh:
    """The coarse mesh that the case describes, its phases checked against the materials; on rank 0."""
    # gmsh is loaded where it is used: only rank 0 has use for it.
    if case.cell.file is not None:
        from feti_homog.cell.reader import read

        mesh = read(case.cell.file)
    else:
        from feti_homog.cell.mesher import generate

        fibres = case.cell.fibres or FIBRES_OF[case.cell.geometry]
        mesh = generate(case.cell, arcs.tips(case.arcs, case.angle.values if case.angle else (), fibres))
    cases.check_phases(case, mesh.phases)
    return mesh


def describe(case: Case, n_ranks: int) -> str:
    """What a run of the case on `n_ranks` ranks would do, in words; on rank 0."""
    lattice = Lattice.of(case.cell.refine, case.cell.order)
    shares = _deal(case, coarse_mesh(case), lattice, n_ranks)
    plan = shares[0][0]
    triangles = [sum(len(p.triangles) for p in pieces) for _, pieces, _ in shares]
    nodes = [t * lattice.intervals**2 // 2 for t in triangles]
    own = [len(pieces) for _, pieces, _ in shares]
    taken = cost.estimate([2 * n for n in nodes], own, plan.coarse_triangles, plan.bodies, _applications(case))
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
        *cost.words(taken, n_ranks),
        *(f"warning    {warning}" for warning in case.warnings()),
        "the case is valid",
    ]
    return "\n".join(lines)


def _deal(case: Case, mesh: CoarseMesh, lattice: Lattice, n_ranks: int) -> list[tuple[Plan, list[Piece], Shared]]:
    """For each rank: the plan, its pieces and the table of what they share with others."""
    torus = Torus.of(mesh)
    first_fibre = int(np.count_nonzero(torus.constituent_phase == 0))
    centres = fibre_centres(torus)
    faults = arcs.faults(case.arcs, centres[first_fibre:])
    if faults:
        raise CaseError(*faults)
    parts = torus.constituent if case.cell.bodies == "torus" else torus.plane_parts()
    wanted = _pieces(case, np.bincount(parts), _outer_edges(torus, parts), lattice, n_ranks)
    decomposition = decompose(torus, parts, wanted, n_ranks)
    pieces = list(cut(torus, decomposition.subdomain))
    tables = share(torus, pieces, decomposition.rank, lattice.intervals - 1, n_ranks)
    bodies = int(parts.max()) + 1
    plan = Plan(
        mesh.width, mesh.height, mesh.phases, bodies, len(pieces), len(mesh.triangles), first_fibre, centres
    )  # fmt: skip
    own: list[list[Piece]] = [[] for _ in range(n_ranks)]
    for piece, rank in zip(pieces, decomposition.rank, strict=True):
        own[rank].append(piece)
    return list(zip([plan] * n_ranks, own, tables, strict=True))


def _pieces(case: Case, load: Int, edges: Int, lattice: Lattice, n_ranks: int) -> Int:
    """Wanted pieces of each body of `load` coarse triangles and `edges` coarse edges to others.

    As the case says; else large bodies are cut to the size that is fastest, and every rank gets a piece.
    """
    wanted = case.decomposition
    # A triangle of the lattice brings about M^2 / 2 nodes.
    dofs_of_triangle = lattice.intervals**2
    if wanted.max_dofs is not None:
        return pieces_for_size(load, dofs_of_triangle, wanted.max_dofs)
    if wanted.subdomains is not None:
        return pieces_for_count(load, wanted.subdomains)
    # A debonding cell is solved so often that whole bodies pay, as long as their dense matrices are small.
    size = max(FASTEST, int(load.sum()) * dofs_of_triangle // MOST)
    boundary = edges * 2 * lattice.intervals
    large = (load * dofs_of_triangle > LARGE * size) | (boundary > LARGE * NARROW)
    if case.interface is not None:
        large = boundary > WIDE
    by_size = pieces_for_size(load, dofs_of_triangle, size)
    by_boundary = np.minimum(-(-boundary // NARROW), load)
    pieces = np.where(large, np.maximum(by_size, by_boundary), 1)
    return pieces if pieces.sum() >= n_ranks else pieces_for_count(load, n_ranks)


def _outer_edges(torus: Torus, parts: Int) -> Int:
    """(b,) coarse edges of each body that others share."""
    left, right = edge_pairs(torus.triangle_torus_edges)
    outer = parts[left] != parts[right]
    return np.bincount(np.r_[parts[left[outer]], parts[right[outer]]], minlength=int(parts.max()) + 1)


def _applications(case: Case) -> int:
    """About how many times the analysis applies the dual operator."""
    solves = 3
    if case.angle is not None:
        solves = len(case.angle.values) * (3 if case.angle.strain is None else 1)
    if case.path is not None:
        solves = SOLVES_OF_A_PATH
    contact = case.interface is not None and case.interface.contact
    return ITERATIONS_OF_A_SOLVE * solves * (SOLVES_OF_A_CONTACT if contact else 1)


def _assemble(case: Case, pieces: list[Piece], lattice: Lattice) -> list[Subdomain]:
    plane = case.analysis.plane
    return [Subdomain.build(p, lattice, plane_stiffness(case.material_of(p.phase), plane)) for p in pieces]
