"""From a finished analysis to its `Result`: counts over all ranks, moduli and bounds, timings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from feti_homog.analysis.cell_records import CellInfo, Checks, FibreInfo, SolverInfo
from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.recorders import CONTACT_TOLERANCE
from feti_homog.analysis.result import Fields, Result
from feti_homog.case.case import Case
from feti_homog.homogenization.uniform_parts import nodes_of_parts
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.microstructure.shapes.ellipses import Ellipses
from feti_homog.system.parallel.mpi_errors import on_root
from feti_homog.version import __version__

# Phases that are no fibres.
AROUND_FIBRES = ("matrix", "coating")
# Share of the fibres' area that polygons may lose without a remark.
REMARKABLE_LOSS = 0.005


def result(context: AnalysisContext, analysis: Mapping[str, Any], fields: Fields | None) -> Result:
    """Return the entries of an analysis with all that belongs to them; collective."""
    cell, progress, checks = context.cell, context.progress, context.checks
    fractions = cell.fractions()
    return Result(
        version=__version__,
        case=cell.case.resolved(),
        digest=on_root(cell.comm, cell.case.digest),
        cell=_cell_info(cell, fractions),
        fibres=_fibres(cell),
        solver=_solver_info(context),
        checks=Checks(**checks.errors),
        check_tolerance=checks.tolerance("jump"),
        kkt_tolerance=CONTACT_TOLERANCE,
        warnings=(*cell.case.warnings(), *cell.summary.warnings(), *context.warnings()),
        remarks=(
            *cell.case.remarks(),
            *cell.summary.remarks,
            *_lost_area(cell.case, fractions),
            *context.remarks(),
        ),
        faults=tuple(checks.faults),
        status="not converged" if checks.faults else "done",
        timings=progress.timings(),
        memory=progress.memory(),
        fields=fields,
        **analysis,
    )


def _lost_area(case: Case, fractions: Mapping[str, float]) -> tuple[str, ...]:
    """Return a remark if straight edges cut off much of the fibres that the case asks for."""
    asked = sum(case.cell.fractions.values())
    meshed = sum(share for phase, share in fractions.items() if phase not in AROUND_FIBRES)
    lost = 1.0 - meshed / asked if asked else 0.0
    if case.cell.order != 1 or lost <= REMARKABLE_LOSS:
        return ()
    return (f"[cell] order = 1: polygons have {lost:.1%} less area than the fibres asked for; refine, or order = 2",)


def _cell_info(cell: TornCell, fractions: dict[str, float]) -> CellInfo:
    """Collect the numbers of the cell.  Collective."""
    return CellInfo(
        width=cell.summary.width,
        height=cell.summary.height,
        area=cell.summary.area,
        fibre_fraction=sum(f for phase, f in fractions.items() if phase not in AROUND_FIBRES),
        fractions=fractions,
        porosity=1.0 - sum(fractions.values()) if cell.summary.voids else 0.0,
        elements=cell.sum_over_ranks(sum(len(s.mesh.triangles) for s in cell.subdomains)),
        nodes=cell.sum_over_ranks(sum(map(nodes_of_parts, cell.subdomains))),
        mesh_size=None if cell.case.cell.has_own_mesh else cell.case.cell.mesh_size,
        refine=cell.case.cell.refine,
        match_distance=cell.summary.match_distance,
    )


def _fibres(cell: TornCell) -> tuple[FibreInfo, ...]:
    """Return the fibres of the cell."""
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
    """Return the solver's entry of all problems together.  Collective."""
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
