"""Describe a case and the cost of its run on these ranks, as `feti-homog check` prints them."""

from collections.abc import Iterator, Sequence

import numpy as np
from mpi4py import MPI

from feti_homog.analysis.cell_records import FibreInfo
from feti_homog.case import Case, interface_section
from feti_homog.errors import CaseError
from feti_homog.feti import solver_plan
from feti_homog.feti.decomposition import shared_entities
from feti_homog.homogenization import cell_remarks, domain_partition, partition_policy, phase_laws, tile_tearing
from feti_homog.mesh import ReferenceLattice, refinement
from feti_homog.microstructure import phase_names
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.petsc import options_database


def describe(case: Case, comm: MPI.Intracomm) -> str:
    """Describe a case and its run on these ranks, with the PETSc options of the case.  Collective.

    Returns text on rank 0, "" elsewhere.  Raises CaseError and MeshError if the cell cannot be meshed and torn.
    """
    with options_database.case_options(case.petsc):
        lattice = ReferenceLattice.of(case.cell.refine, case.cell.order)
        part = tile_tearing.cut(case, lattice, comm, partition_policy.BY_COST)
        pairs = cell_remarks.pairs_of(case, part.summary.phases)
        constraints = shared_entities.share_entities(comm, part.submeshes, part.table, pairs, lattice).constraints
        inner, parts = lattice.intervals - 1, map(refinement.halved, part.submeshes.cut())
        nodes = sum(len(s.class_keys) + inner * (len(s.edge_keys) + (inner - 1) * len(s.triangles) // 2) for s in parts)
        counts = comm.gather((len(part.submeshes.index), nodes)) or []
        cell, summary = case.cell, part.summary
        components = [problem.components for problem in phase_laws.problems(case)]

        def lines() -> Iterator[str]:
            subdomains, nodes = zip(*counts, strict=True)
            elements, dofs = summary.coarse_triangles * len(lattice.triangles), sum(components) * sum(nodes)
            yield f"case       {case.name}: {case.analysis.type}, plane {case.analysis.plane}"
            yield f"cell       {summary.width:g} x {summary.height:g}, phases {', '.join(summary.phases)}"
            if summary.voids:
                yield f"voids      {summary.voids}"
            mesh = f"{summary.coarse_triangles} coarse triangles, {elements} elements of order {cell.order}"
            yield f"mesh       {mesh}, {dofs} degrees of freedom"
            if cell.accuracy is not None:
                yield f"sizes      mesh_size = {cell.mesh_size:g}, refine = {cell.refine}, as asked for by accuracy"
            yield from _fibre_lines(case, summary)
            pieces = f"{summary.subdomains} subdomain{'s' if summary.subdomains > 1 else ''}"
            yield f"tearing    {summary.bodies} bodies, {pieces}, {sum(components) * constraints} multipliers"
            yield from _cost_lines(case, summary, components[0] * constraints, subdomains, nodes)
            unresolved = cell_remarks.warnings(case, summary.width, summary.interface_edge, summary.radii)
            yield from (f"warning    {warning}" for warning in (*case.warnings(), *summary.warnings(), *unresolved))
            yield from (f"remark     {remark}" for remark in (*case.remarks(), *summary.remarks))
            yield "the case is valid"

        return mpi_errors.on_root_only(comm, lambda: "\n".join(lines())) or ""


def _cost_lines(
    case: Case, summary: domain_partition.CellSummary, multipliers: int, subdomains: Sequence[int], nodes: Sequence[int]
) -> Iterator[str]:
    """Yield lines about the solver, ranks and memory; for a path also memory for complete debonding.

    `subdomains` and `nodes` have a count for each rank.  Raises CaseError for PETSc options that exclude each other,
    and for a solver without influence columns in a case with friction.
    """
    problems, ranks, options = phase_laws.problems(case), len(nodes), solver_plan.database_options()
    is_dense = options.operator != "implicit"
    has_thin = phase_names.COATING in case.materials and not summary.across
    one_each = summary.across and ranks > 1 and set(subdomains) == {1}
    applications = max(partition_policy.applications(case, problem, summary.across) for problem in problems)
    # Dense operators can be searched for soft modes.
    sizes = solver_plan.ProblemSizes(applications, summary.is_cut, is_dense, is_dense, multipliers, has_thin, one_each)
    plan = solver_plan.choose(sizes, options)
    if case.has_friction and plan.preconditioner != "influence":
        raise CaseError(solver_plan.WITHOUT_INVERSE)
    solver = plan.in_words if multipliers else "one factor of the whole cell: no multipliers, no iterations"
    yield f"solver     {solver}"
    components = [problem.components for problem in problems]
    for rank, (count, n) in enumerate(zip(subdomains, nodes, strict=True)):
        yield f"rank {rank:<5} {count} subdomain{'s' if count > 1 else ''}, {sum(components) * n} degrees of freedom"
    columns = multipliers if plan.preconditioner == "influence" else 0
    memory = partition_policy.memory(case, nodes, subdomains, components, columns, summary.coarse_triangles)
    end = partition_policy.memory_to_the_end(case, memory, multipliers, columns, ranks)
    breaks = case.section.is_followed and case.interfaces and end > memory
    all_bonds = f", {partition_policy.in_words(end)} if all bonds break" if breaks else ""
    noun = "rank" if ranks == 1 else "ranks"
    size = partition_policy.in_words(memory)
    yield f"estimate   on {ranks} {noun} at most about {size} per rank{all_bonds}, without pictures"
    most, limit = (summary.coarse_triangles, "") if summary.across else (summary.bodies, ", at most one rank per body")
    useful = partition_policy.recommended_ranks(sum(components) * sum(nodes), most)
    yield f"ranks      recommended: {useful} ({partition_policy.DOFS_OF_A_RANK} degrees of freedom per rank{limit})"


def _fibre_lines(case: Case, summary: domain_partition.CellSummary) -> Iterator[str]:
    """Yield lines about fibres: number, sizes, debonded arcs, phases of a mix, and how closely a table is matched."""
    if case.interface is not None or case.cell.table is not None or case.cell.has_own_mesh:
        frames, sizes = summary.frames[summary.fibre_bodies], ""
        is_hollow = case.cell.table is not None and bool((case.cell.table.inner_radius > 0).any())
        if len(frames) and np.isfinite(frames).all() and not is_hollow:  # polygons have no frame
            radii = np.sqrt(np.abs(np.linalg.det(frames)))
            fraction = np.pi * (radii**2).sum() / (summary.width * summary.height)
            sizes = f", mean radius {radii.mean():.4g}, fraction {fraction:.4f}"
        yield f"fibres     {summary.fibres}, numbered from 1{sizes}"
    records = FibreInfo.all_of(case, summary, np.ones(summary.fibres)) if case.arcs else ()
    for label, interface in interface_section.labelled(case.interfaces):
        for number, arc in enumerate(interface.debonded):
            angle = "[angle] values" if arc.angle is None else f"angle {arc.angle:g}"
            chosen = "all" if isinstance(arc.fibre, str) else ", ".join(str(records[k - 1]) for k in arc.fibre)
            tips = ", tips at the next nodes outside" if case.cell.has_own_mesh else ""
            yield f"arc        [{label}] debonded[{number}]: {angle} about {arc.centre:g} degrees{tips}, fibre {chosen}"
    if case.cell.mix is not None:
        phase, radii = summary.constituent_phase[summary.is_fibre], summary.radii[summary.is_fibre]
        mixed = [(name, radii[phase == k]) for k, name in enumerate(summary.phases) if name in case.cell.mix]
        yield f"mix        {', '.join(f'{len(r)} of {name}, mean radius {r.mean():.6g}' for name, r in mixed)}"
    if case.cell.match is not None:
        text = "mean diameters, the distance of the distributions of nearest and second neighbours"
        yield f"match      {case.cell.match.name}, to {domain_partition.match_distance(case, summary):.4f} {text}"
