"""One case from its description to its result: tear, solve, homogenize, check, and write if there is a folder."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import asdict
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog import __version__
from feti_homog.analysis import debonding_angle, load_path, stiffness
from feti_homog.analysis.context import CONTACT_TOLERANCE, AnalysisContext
from feti_homog.analysis.result import Result
from feti_homog.common import process_memory
from feti_homog.common.mpi_errors import on_root, on_root_only
from feti_homog.common.petsc_options import case_options, refuse_unused
from feti_homog.common.progress import Progress
from feti_homog.config.case import Case
from feti_homog.config.materials import plane_stiffness
from feti_homog.errors import ConvergenceError
from feti_homog.homogenization.averaging import Homogenization, Response
from feti_homog.homogenization.unit_cell import TornCell, tear
from feti_homog.interface.strength_criterion import StrengthCriterion
from feti_homog.mechanics import bounds
from feti_homog.output.files import csv_tables, field_parts, output_folder, result_json, xdmf
from feti_homog.output.files.checkpoint import Checkpoint, NoCheckpoint, finished
from feti_homog.output.files.field_file import FieldFile
from feti_homog.output.text.summary import summary
from feti_homog.typing import Float


def run(case: Case, directory: Path, comm: MPI.Intracomm, quiet: bool, resume: bool = False) -> None:
    """Run the case and write its results to `directory`; `resume` goes on from a path's checkpoint.  Collective.

    Raises:
        CaseError, MeshError: before any result is written; also for a checkpoint of another run.
        ConvergenceError: after what was computed has been written, marked as such.
    """
    progress = Progress(comm, quiet)
    for warning in case.warnings():
        progress.say(f"warning: {warning}")
    if resume and on_root(comm, finished, directory, case):
        progress.say(f"{directory} holds the finished result of this case: nothing to do")
        return
    with _torn(case, comm, progress) as cell:
        faults = _run(cell, directory, progress, resume)
    if faults:
        raise ConvergenceError(*faults)


def compute(case: Case, comm: MPI.Intracomm) -> Result:
    """The case's result on every rank, without a file or a word.  Collective.

    Raises:
        CaseError, MeshError: the case cannot be run.
        ConvergenceError: a solve did not converge or a check failed.
    """
    progress = Progress(comm, quiet=True)
    with _torn(case, comm, progress) as cell:
        context = _study(cell, progress, None)
        document = _document(context, _analyse(context, NoCheckpoint(comm), resume=False))
        document |= {"timings": context.progress.timings(), "memory": context.progress.memory()}
    if context.faults:
        raise ConvergenceError(*context.faults)
    return Result.of(document)


@contextmanager
def _torn(case: Case, comm: MPI.Intracomm, progress: Progress) -> Iterator[TornCell]:
    """The torn cell, with the case's options set, while the block lasts."""
    PETSc.garbage_cleanup(comm)  # what earlier cases left: parallel objects are freed by all ranks together
    process_memory.forget_peak()
    with case_options(case.petsc):
        cell = tear(case, comm, progress)
        try:
            refuse_unused()
            yield cell
        finally:
            cell.solver.destroy()


def _run(cell: TornCell, directory: Path, progress: Progress, resume: bool) -> list[str]:
    """Analyse and write; returns what did not hold."""
    case, comm = cell.case, cell.comm
    on_root(comm, output_folder.make, directory)
    file = None
    if case.output.fields:
        with progress.stage("output") as words:
            words.append(f"{directory}: result.h5 with the mesh, the states follow")
            file = FieldFile(
                directory, comm, field_parts.header(cell), field_parts.mesh_part(cell), field_parts.interface_part(cell)
            )
    with file or nullcontext():
        context = _study(cell, progress, file)
        checkpoint = _checkpoint(cell, directory)
        analysis = _analyse(context, checkpoint, resume)
    _write(context, directory, _document(context, analysis), checkpoint)
    return context.faults


def _study(cell: TornCell, progress: Progress, file: FieldFile | None) -> AnalysisContext:
    """The analysis of a cell, whose states go to the file if there is one."""
    contact = cell.case.interface is not None and cell.case.interface.contact
    return AnalysisContext(Homogenization(cell, contact), cell.debonded, progress, _recorder(cell, file))


def _analyse(context: AnalysisContext, checkpoint: Checkpoint, resume: bool) -> dict[str, Any]:
    """The numbers of the analysis asked for, as they stand in result.json."""
    with context.progress.stage("solve") as words:
        analysis = _analysis(context, checkpoint, resume)
        words.append(f"{len(context.iterations)} states, {sum(context.iterations)} iterations")
    return analysis


def _analysis(context: AnalysisContext, checkpoint: Checkpoint, resume: bool) -> dict[str, Any]:
    case = context.homogenization.cell.case
    if case.path is not None:
        return load_path.run(context, case.path, _law(case), checkpoint, resume)
    if case.angle is not None:
        strain = None if case.angle.strain is None else np.array(case.angle.strain)
        return debonding_angle.run(context, case.angle.values, strain)
    return stiffness.run(context)


def _checkpoint(cell: TornCell, directory: Path) -> Checkpoint:
    plan, multipliers = cell.plan, cell.solver.jump_operator.total
    parts = f"{plan.subdomains} subdomains on {cell.comm.size} ranks, {multipliers} multipliers"
    return Checkpoint(directory, cell.comm, f"case {on_root(cell.comm, cell.case.digest)}, {parts}")


def _law(case: Case) -> StrengthCriterion:
    bond = case.interface
    if bond is None:
        return StrengthCriterion(math.inf, math.inf, "max")
    return StrengthCriterion(bond.normal_strength or math.inf, bond.tangential_strength or math.inf, bond.criterion)


def _recorder(cell: TornCell, file: FieldFile | None) -> Callable[[Response, float, str], None]:
    """Writes each response as the next state."""
    number = count()

    def record(response: Response, load_factor: float, label: str) -> None:
        if file is not None:
            file.write_state(next(number), field_parts.state_part(cell, response, load_factor, label))

    return record


def _document(context: AnalysisContext, analysis: dict[str, Any]) -> dict[str, Any]:
    """result.json but for times and memory; collective."""
    cell = context.homogenization.cell
    plan, solver, areas = cell.plan, cell.solver, cell.areas()
    fractions = {phase: area / sum(areas.values()) for phase, area in areas.items()}
    document = {
        "version": __version__,
        "case": cell.case.resolved(),
        "digest": on_root(cell.comm, cell.case.digest),
        "cell": {
            "width": plan.width,
            "height": plan.height,
            "area": plan.area,
            "fibre_fraction": sum(f for phase, f in fractions.items() if phase != "matrix"),
            "fractions": fractions,
            "elements": cell.total(sum(len(s.mesh.triangles) for s in cell.subdomains)),
            "nodes": cell.total(sum(len(s.mesh.points) for s in cell.subdomains)),
        },
        "solver": {
            "ranks": cell.comm.size,
            "bodies": plan.bodies,
            "subdomains": plan.subdomains,
            "dofs": cell.total(len(solver.Q)),
            "multipliers": solver.jump_operator.total,
            "interface_nodes": cell.total(len(solver.jump_operator.nodes.row)),
            "kernel_dim": solver.natural.kernel_dimension,
            "coarse_dim": solver.coarse.coarse_dimension,
            "factorizations": cell.total(len(solver.interface_operators.operators)),
            "coarse_factorizations": solver.natural.factorizations,
            "rtol": solver.rtol,
            "solves": solver.solves,
            "iterations": context.iterations,
            "converged_reason": context.reasons,
        },
        "checks": context.checks,
        "check_tolerance": context.tolerance("jump"),
        "kkt_tolerance": CONTACT_TOLERANCE,
        "warnings": list(cell.case.warnings()),
        "faults": context.faults,
        "status": "not converged" if context.faults else "done",
    }
    if "effective_stiffness" in analysis and cell.case.interface is None:
        document |= _beside(cell, analysis["effective_stiffness"], fractions)
    return document | analysis


def _beside(cell: TornCell, L: Float, fractions: dict[str, float]) -> dict[str, Any]:
    """The moduli of L^ef and the bounds of the phases."""
    case, shares = cell.case, list(fractions.values())
    phases = [plane_stiffness(case.material_of(phase), case.analysis.plane) for phase in fractions]
    isotropic = all(bounds.is_isotropic(stiffness) for stiffness in phases)
    return {
        "moduli": asdict(bounds.engineering_moduli(L)),
        "bounds": {
            "voigt": bounds.voigt(shares, phases),
            "reuss": bounds.reuss(shares, phases),
            "hashin_shtrikman": asdict(bounds.hashin_shtrikman(shares, phases)) if isotropic else None,
        },
    }


def _write(context: AnalysisContext, directory: Path, document: dict[str, Any], checkpoint: Checkpoint) -> None:
    cell, progress = context.homogenization.cell, context.progress
    comm, output = cell.comm, cell.case.output
    if output.fields:
        on_root_only(comm, xdmf.write, directory)
    document["timings"], document["memory"] = progress.timings(), progress.memory()
    on_root_only(comm, result_json.write, directory, document)
    on_root_only(comm, csv_tables.write, directory, document)
    if cell.case.path is not None and not context.faults:
        checkpoint.clear()
    if output.pictures:
        with progress.stage("pictures") as words:
            words.append(", ".join(p.name for p in on_root_only(comm, _draw, directory) or []))
    timings = progress.timings()
    progress.say("\n" + summary(document | {"timings": timings}))


def _draw(directory: Path) -> list[Path]:
    """The pictures; only a rank that draws loads Matplotlib."""
    from feti_homog.output.plots import figures

    return figures.plot(directory)
