"""Tear the cell of a case into subdomains, with the solver for their interfaces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from feti_homog.case import Case, cell_sizes
from feti_homog.fem import AXIAL, Problem
from feti_homog.feti import DualSolution, FetiSolver, thresholds
from feti_homog.feti.decomposition import JumpOperator, SharedEntities, Subdomain, shared_entities
from feti_homog.homogenization import cell_remarks, partition_policy, phase_laws, uniform_parts
from feti_homog.homogenization.domain_partition import CellSummary, RankShare
from feti_homog.homogenization.partition_policy import DEFAULT_POLICY, PartitionPolicy
from feti_homog.homogenization.tile_tearing import cut
from feti_homog.homogenization.uniform_parts import UniformPart, locks
from feti_homog.mesh import ReferenceLattice, Submesh, refinement, submeshes
from feti_homog.microstructure import phase_names
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.runtime import standard_streams
from feti_homog.typing import Bool, Float, Int

if TYPE_CHECKING:
    from feti_homog.feti.decomposition import interface_neighbours
    from feti_homog.homogenization.spring_errors import SpringSides
    from feti_homog.interface.laws import BondLaw


@dataclass(frozen=True)
class TornCell:
    """A torn cell with its subdomains on all ranks and the dual solver of one problem.

    `summary` and `table` describe the whole cell and all subdomains; `lattice` refines the `subdomains` of each rank.
    In generalized plane strain, `axial` is the cell with displacements along the fibres, on the same meshes and nodes.
    """

    comm: MPI.Intracomm
    case: Case
    summary: CellSummary
    lattice: ReferenceLattice
    table: submeshes.SubdomainTable
    subdomains: list[Subdomain]
    solver: FetiSolver
    axial: TornCell | None = None

    @property
    def problems(self) -> tuple[TornCell, ...]:
        """The torn cells of all problems, the plane problem first."""
        return (self,) if self.axial is None else (self, self.axial)

    @cached_property
    def offsets(self) -> Int:
        """The first degree of freedom of each part in this rank's vectors, then the vectors' length: (parts + 1,)."""
        return np.cumsum([0, *(len(part.dofs) for part in self.parts)])

    @cached_property
    def parts(self) -> list[UniformPart]:
        """The one-body parts, numbered over all ranks, of this rank's subdomains.  Collective when first read."""
        phases = [self.summary.phases[k] for k in self.summary.constituent_phase.tolist()]
        parts = list(uniform_parts.parts_of(self.subdomains, phases))
        if not self.summary.across:
            return parts
        first = self.comm.exscan(len(parts)) or 0
        return [replace(p, submesh=replace(p.submesh, index=first + k)) for k, p in enumerate(parts)]

    @cached_property
    def jumps(self) -> JumpOperator:
        """The jump operator B between all parts, also within subdomains.  Collective when first read."""
        if not self.summary.across:
            return self.solver.jump_operator
        pairs = cell_remarks.pairs_of(self.case, self.summary.phases)
        shared = uniform_parts.share_parts(self.comm, self.parts, self.table, pairs, self.lattice)
        return JumpOperator(self.comm, shared, self.parts, self.lattice, self.solver.problem)

    @cached_property
    def _forces(self) -> uniform_parts.ForcesBetweenParts:
        """The operator that gives multipliers between parts from displacements.  Collective when first read."""
        return uniform_parts.ForcesBetweenParts(self.comm, self.parts, self.jumps)

    def extended(self, u: Float, loads: Float) -> Float:
        """Extend boundary displacements u (boundary dofs, k) to u* (dofs, k) in all parts, under loads (v, k)."""
        inside = np.empty((self.offsets[-1], u.shape[1]), order="F")
        keep = partition_policy.keeps_interiors(self.case)
        place, of_place = -1, np.zeros(0)
        for part, of_part in self.by_part(inside):
            if part.place != place:
                place, of_place = part.place, self.solver.extended(part.place, u, loads, keep)
            of_part[:] = of_place[part.dofs]
        return inside

    def by_part(self, u: Float) -> Iterator[tuple[UniformPart, Float]]:
        """Iterate over the parts, each with a view of its rows in displacements u (dofs, ...)."""
        return zip(self.parts, np.split(u, self.offsets[1:-1]), strict=False)

    def across_bonds(self, solution: DualSolution, u: Float) -> tuple[Float, Float]:
        """Return the multipliers and openings (owned rows of `jumps`,) between all parts.  Collective.

        If subdomains reach across materials, both follow from the displacements `u` (dofs,) of this rank's parts.
        """
        if not self.summary.across or not self.jumps.global_rows:  # without jumps the cell is a single part
            return solution.lam, solution.opening
        return self._forces.multipliers(u, solution.strain), self.jumps.sum(self.jumps.B @ u)

    @cached_property
    def neighbours(self) -> interface_neighbours.InterfaceNeighbours:
        """The interface nodes of all ranks with their neighbours.  Collective when first read."""
        from feti_homog.feti.decomposition import interface_neighbours  # most cells have no interfaces

        return interface_neighbours.InterfaceNeighbours(self.comm, self.solver.jump_operator, self.subdomains)

    @cached_property
    def spring_sides(self) -> SpringSides:
        """The element sides along springs, for errors of spring energy.  Collective when first read."""
        from feti_homog.homogenization.spring_errors import SpringSides

        jumps = self.solver.jump_operator
        return SpringSides(jumps, self.neighbours, self.parts, self.lattice, self.summary.shift)

    @cached_property
    def class_nodes(self) -> Int:
        """One plane node of each node class (c,) in this rank's parts, part by part."""
        nodes, first = [np.zeros(0, np.int64)], 0
        for mesh in (part.mesh for part in self.parts):
            nodes.append(np.empty(mesh.n_classes, np.int64))
            nodes[-1][mesh.node_class] = first + np.arange(len(mesh.points))
            first += len(mesh.points)
        return np.concatenate(nodes)

    @cached_property
    def strength_factors(self) -> Float:
        """The ratio (fibres,) of each fibre's bond strength to the strength in the case."""
        return phase_laws.strength_factors(self.case, self.summary.fibres)

    @cached_property
    def bond_law(self) -> BondLaw:
        """The bond law at this rank's interface nodes."""
        from feti_homog.interface.laws import law_of_sections  # bonded cells need no law

        nodes = self.solver.jump_operator.nodes
        varies = not (self.strength_factors == 1.0).all()
        factor = self.strength_factors[self.summary.numbers[nodes.fibre] - 1] if varies else 1.0
        return law_of_sections(self.case.interfaces, nodes.pair, factor)

    @cached_property
    def directions(self) -> Float:
        """The directions (k,) in degrees from fibre centres to this rank's interface nodes; NaN without a centre."""
        from feti_homog.interface import debonded_arcs

        nodes = self.solver.jump_operator.nodes
        return debonded_arcs.angles(nodes.points, nodes.fibre, self.summary.centres, self.summary.shift)

    @cached_property
    def nested_lattice(self) -> ReferenceLattice:
        """The lattice of the coarser mesh: one or two halvings fewer.  Collective when first read."""
        often = not locks(self.subdomains, self.comm) and self.lattice.halvings >= uniform_parts.REFINED_OFTEN
        return self.lattice.coarser(2 if often and not self.summary.across else 1)

    def debonded(self, opening: float | None) -> Bool:
        """Return the mask (k,) of this rank's initially debonded nodes; arcs without angle have `opening` degrees."""
        nodes = self.solver.jump_operator.nodes
        number = self.summary.numbers[nodes.fibre]
        is_debonded = nodes.precracked & bool(self.case.interfaces)
        if self.case.arcs:
            from feti_homog.interface import debonded_arcs  # few cells have arcs

            for pair, (interface, moved) in enumerate(zip(self.case.interfaces, self.summary.moved_tips, strict=True)):
                inside = debonded_arcs.debonded(interface.debonded, opening, number, self.directions, moved)
                is_debonded |= inside & (nodes.pair == pair)
        return np.asarray(is_debonded)

    def areas(self) -> dict[str, float]:
        """Return the meshed area of each phase.  Collective."""
        local = dict.fromkeys(self.summary.phases, 0.0)
        for s in self.subdomains:
            for phase, area in zip(_phases(self.summary, s.submesh), s.areas.tolist(), strict=True):
                local[phase] += area
        return {phase: self.comm.allreduce(area) for phase, area in local.items()}

    def fractions(self) -> dict[str, float]:
        """Return the area fraction of each phase; the area of voids counts as cell area.  Collective."""
        areas = self.areas()
        total = self.summary.area if self.summary.voids else sum(areas.values())
        return {phase: area / total for phase, area in areas.items()}

    def destroy(self) -> None:
        """Free the solvers of all problems.  Collective."""
        for cell in self.problems:
            cell.solver.destroy()


def tear(
    case: Case,
    comm: MPI.Intracomm,
    progress: standard_streams.Progress,
    limits: thresholds.Thresholds = thresholds.DEFAULTS,
    policy: PartitionPolicy = DEFAULT_POLICY,
) -> TornCell:
    """Tear the cell of a case, and factor the subdomains.  Collective.

    Raises on every rank, like `tile_tearing.cut` and `solver_plan.build`; `progress` reports the stages.
    """
    part, shared, lattice, subdomains = assemble_subdomains(case, comm, progress, policy)
    summary, table = part.summary, part.table
    recovers = case.output.mesh_error or case.output.fields
    del part  # the submesh of the rank takes as much memory as the submeshes of its subdomains

    def solver_of(problem: Problem, subdomains: list[Subdomain]) -> FetiSolver:
        applications = partition_policy.applications(case, problem, summary.across)
        springs = phase_laws.springs(case, problem)
        return FetiSolver(comm, shared, subdomains, lattice, applications, limits, springs, problem, recovers)

    with progress.stage("factor") as line:
        solver = solver_of(phase_laws.problems(case)[0], subdomains)
        line.append(f"{solver.jump_operator.global_rows} multipliers, coarse dimension {solver.coarse_dimension}")
    cell = TornCell(comm, case, summary, lattice, table, subdomains, solver)
    if len(phase_laws.problems(case)) == 1:
        return cell
    with progress.stage("assemble") as line:
        axial = mpi_errors.agree(comm, assemble_axial, case, summary, subdomains)
        line.append(f"{comm.allreduce(sum(s.n_dofs for s in axial))} degrees of freedom along the fibres")
    with progress.stage("axial"):
        return replace(cell, axial=replace(cell, subdomains=axial, solver=solver_of(AXIAL, axial)))


def assemble_axial(case: Case, summary: CellSummary, subdomains: Sequence[Subdomain]) -> list[Subdomain]:
    """Assemble this rank's subdomains for displacements along the fibres, on the meshes of `subdomains`."""
    laws = [_laws(case, summary, s.submesh, AXIAL) for s in subdomains]
    return [
        Subdomain.on(s.submesh, s.mesh, L, AXIAL, s.material, is_thin=s.is_thin, is_outer=s.is_outer)
        for s, L in zip(subdomains, laws, strict=True)
    ]


def assemble_subdomains(
    case: Case, comm: MPI.Intracomm, progress: standard_streams.Progress, policy: PartitionPolicy = DEFAULT_POLICY
) -> tuple[RankShare, SharedEntities, ReferenceLattice, list[Subdomain]]:
    """Mesh, cut and refine the cell, and assemble the subdomains.  Collective; raises like `tear`.

    Return this rank's part of the cell, its shared entities, the lattice and this rank's subdomains.
    """
    lattice = ReferenceLattice.of(case.cell.refine, case.cell.order)
    with progress.stage("mesh") as line:
        part = cut(case, lattice, comm, policy)
        summary, pairs = part.summary, cell_remarks.pairs_of(case, part.summary.phases)
        shared = shared_entities.share_entities(comm, part.submeshes, part.table, pairs, lattice)
        pieces = f"{summary.subdomains} subdomain{'s' if summary.subdomains > 1 else ''}"
        line.append(f"{summary.coarse_triangles} triangles, {summary.bodies} bodies, {pieces}")

    def assembled() -> list[Subdomain]:
        problem, subdomains = phase_laws.problems(case)[0], list[Subdomain]()
        for s in map(refinement.halved, part.submeshes.cut()):
            phase_of = summary.constituent_phase[s.constituent]
            material = None if s.phase else np.unique(phase_of, return_inverse=True)[1]
            materials = [case.material_of(name) for name in _phases(summary, s)]
            mixed = tuple(cell_sizes.is_mixed(case.cell.order, m, case.analysis.plane) for m in materials)
            flags = {"is_thin": s.phase == phase_names.COATING, "is_outer": s.phase == phase_names.MATRIX}
            laws = _laws(case, summary, s, problem)
            subdomains.append(Subdomain.build(s, lattice, laws, problem, material, mixed, **flags))
        return subdomains

    with progress.stage("assemble") as line:
        subdomains = mpi_errors.agree(comm, assembled)
        dofs = comm.allreduce(sum(s.n_dofs for s in subdomains))
        meshed = comm.allreduce(sum(s.area for s in subdomains))
        if summary.voids:
            line.append(f"{summary.voids} voids, porosity {1 - meshed / summary.area:.6g},")
        line.append(f"{dofs} degrees of freedom, refine = {case.cell.refine}, order = {case.cell.order}")
    return part, shared, lattice, subdomains


def _laws(case: Case, summary: CellSummary, submesh: Submesh, problem: Problem) -> Float:
    """Return the stiffnesses of a subdomain's phases: (v, v) in one material, or (phases, v, v) across materials."""
    laws = np.stack([phase_laws.law(case, phase, problem) for phase in _phases(summary, submesh)])
    return np.asarray(laws[0] if submesh.phase else laws)


def _phases(summary: CellSummary, submesh: Submesh) -> list[str]:
    """Return the phase names of a subdomain, in cell order."""
    if submesh.phase:
        return [submesh.phase]
    return [summary.phases[k] for k in np.unique(summary.constituent_phase[submesh.constituent]).tolist()]
