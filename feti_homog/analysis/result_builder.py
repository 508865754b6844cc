"""From a finished analysis to its `Result`: counts over all ranks, moduli and bounds, timings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from feti_homog.analysis.cell_records import CellInfo, Checks, FibreInfo, SolverInfo
from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.recorders import CONTACT_TOLERANCE
from feti_homog.analysis.result import Fields, Result
from feti_homog.homogenization.uniform_parts import nodes_of_parts
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.microstructure.shapes.ellipses import Ellipses
from feti_homog.system.parallel.mpi_errors import on_root
from feti_homog.version import __version__

AROUND_FIBRES = ("matrix", "coating")
REMARKABLE_LOSS = 0.005  # of the fibres' area, by polygons


def result(context: AnalysisContext, analysis: Mapping[str, Any], fields: Fields | None) -> Result:
    """Build the result with an analysis's entries.  Collective."""
    cell, progress, checks = context.cell, context.progress, context.checks
    fractions = cell.fractions()
    # Straight edges cut off a part of the fibres.
    area = sum(cell.case.cell.fractions.values())
    meshed = sum(share for phase, share in fractions.items() if phase not in AROUND_FIBRES)
    lost = 1.0 - meshed / area if area and cell.case.cell.order == 1 else 0.0
    polygons = f"[cell] order = 1: polygons have {lost:.1%} less area than the fibres asked for; refine, or order = 2"
    cell_info = CellInfo(
        width=cell.summary.width,
        height=cell.summary.height,
        area=cell.summary.area,
        fibre_fraction=meshed,
        fractions=fractions,
        porosity=1.0 - sum(fractions.values()) if cell.summary.voids else 0.0,
        elements=cell.sum_over_ranks(sum(len(s.mesh.triangles) for s in cell.subdomains)),
        nodes=cell.sum_over_ranks(sum(map(nodes_of_parts, cell.subdomains))),
        mesh_size=None if cell.case.cell.has_own_mesh else cell.case.cell.mesh_size,
        refine=cell.case.cell.refine,
        match_distance=cell.summary.match_distance,
    )
    return Result(
        version=__version__,
        case=cell.case.resolved(),
        digest=on_root(cell.comm, cell.case.digest),
        cell=cell_info,
        fibres=_fibres(cell),
        solver=_solver_info(context),
        checks=Checks(**checks.errors),
        check_tolerance=checks.tolerance("jump"),
        kkt_tolerance=CONTACT_TOLERANCE,
        warnings=(*cell.case.warnings(), *cell.summary.warnings(), *context.warnings()),
        remarks=(
            *cell.case.remarks(),
            *cell.summary.remarks,
            *([polygons] if lost > REMARKABLE_LOSS else []),
            *context.remarks(),
        ),
        faults=tuple(checks.faults),
        status="not converged" if checks.faults else "done",
        timings=progress.timings(),
        memory=progress.memory(),
        fields=fields,
        **analysis,
    )


def _fibres(cell: TornCell) -> tuple[FibreInfo, ...]:
    """Return the cell's fibre records."""
    summary, factors = cell.summary, cell.strength_factors
    bodies, varies = summary.fibre_bodies, not (factors == 1.0).all()
    ellipses = Ellipses(summary.centres, summary.frames)
    is_ellipse = np.isnan(summary.radii) & ~np.isnan(ellipses.angles)
    return tuple(
        FibreInfo(
            number=number,
            phase=summary.phases[summary.constituent_phase[body]],
            centre=None if np.isnan(summary.centres[body, 0]) else summary.centres[body],
            radius=None if np.isnan(summary.radii[body]) else float(summary.radii[body]),
            semi_axes=ellipses.semi_axes[body] if is_ellipse[body] else None,
            angle=float(ellipses.angles[body]) if is_ellipse[body] else None,
            coating=float(thickness) if thickness > 0 else None,
            strength=float(factor) if varies else None,
        )
        for number, (body, thickness, factor) in enumerate(zip(bodies, summary.coatings, factors, strict=True), start=1)
    )


def _solver_info(context: AnalysisContext) -> SolverInfo:
    """Return one record for the solvers in all problems.  Collective."""
    cell = context.cell
    plan, solver = cell.summary, cell.solver
    solvers = [problem.solver for problem in cell.problems]
    return SolverInfo(
        ranks=cell.comm.size,
        bodies=plan.bodies,
        subdomains=plan.subdomains,
        dofs=cell.sum_over_ranks(sum(len(s.Q) for s in solvers)),
        multipliers=sum(s.jump_operator.global_rows for s in solvers),
        interface_nodes=plan.interface_nodes or cell.sum_over_ranks(len(solver.jump_operator.nodes.row)),
        kernel_dim=sum(s.natural.kernel_dimension for s in solvers),
        coarse_dim=sum(s.coarse_dimension for s in solvers),
        factorizations=cell.sum_over_ranks(sum(len(s.interface_operators.operators) for s in solvers)),
        coarse_factorizations=sum(s.natural.factorizations for s in solvers),
        rtol=solver.rtol,
        solves=sum(s.solves for s in solvers),
        iterations=tuple(context.checks.iterations),
        converged_reason=tuple(context.checks.reasons),
    )
