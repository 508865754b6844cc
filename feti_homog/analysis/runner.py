"""Run one case: tear the cell, solve, homogenize, check, and write the result if there is a folder."""

import time
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, nullcontext
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog import __version__
from feti_homog.analysis.cell_records import CellInfo, Checks, FibreInfo, SolverInfo
from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.recorders import CONTACT_TOLERANCE, StateRecorder
from feti_homog.analysis.result import Result
from feti_homog.case import Case
from feti_homog.errors import ConvergenceError
from feti_homog.homogenization import domain_partition, partition_policy, uniform_parts, unit_cell
from feti_homog.results import field_file, field_parts, output_folder, result_json, xdmf
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.petsc import options_database
from feti_homog.system.runtime import process, records, standard_streams

# Bytes that a process keeps between cases: their release would cost a small case 10 % of its time.
SPARE_BYTES = 256 << 20
AROUND_FIBRES = ("matrix", "coating")
REMARKABLE_LOSS = 0.005  # fraction of the fibre area that straight edges cut off


def run(
    case: Case, directory: Path, progress: standard_streams.Progress, resume: bool = False, keep_fields: bool = False
) -> Result:
    """Run a case, write its result to `directory`, and return the result.  Collective over `progress.comm`.

    `resume` continues from the checkpoint, or reads a finished result; `keep_fields` sets `Result.fields`.

    Raises:
        CaseError, MeshError: before any result is written; also for another run's checkpoint or a folder in use.
        ConvergenceError: after a result with faults has been written; or without a result, if nothing carries the load.
        FetiHomogError: a file cannot be written.
    """
    comm = progress.comm
    if resume:
        from feti_homog.analysis import stored_result  # loads readers that most runs do not use

        if mpi_errors.on_root(comm, stored_result.finished, directory, case, comm.size):
            progress.say(f"{directory} holds the finished result of this case: nothing to do; `plot` draws pictures")
            return Result.of(mpi_errors.on_root(comm, result_json.read, directory))
    mpi_errors.on_root(comm, output_folder.usable, directory)
    mpi_errors.on_root(comm, output_folder.refuse_files_of_others, directory)
    if not resume and (line := mpi_errors.on_root(comm, output_folder.replaced, directory, case)):
        progress.say(line)
    with output_folder.held(directory, comm, progress.say), _torn(case, comm, progress) as cell:
        result = _run_and_write(cell, directory, progress, resume, keep_fields)
    return _without_faults(result)


def compute(case: Case, comm: MPI.Intracomm, keep_fields: bool = False, quiet: bool = True) -> Result:
    """Compute the result of a case, on every rank, without files; `keep_fields` sets `Result.fields`.  Collective.

    Raises:
        CaseError, MeshError: the case cannot be run.
        ConvergenceError: no convergence or a failed check, after a summary unless `quiet`; or nothing carries the load.
    """
    progress = standard_streams.Progress(comm, quiet)
    with _torn(case, comm, progress) as cell:
        context = AnalysisContext.of(cell, progress, StateRecorder(cell, None, keep_fields, progress.say))
        result = _result(context, _analyse(context))
    _print_summary(result, progress)
    return _without_faults(result)


def _without_faults(result: Result) -> Result:
    """Return the result; raise ConvergenceError, which holds the result, if it has faults."""
    if result.faults:
        error = ConvergenceError(*result.faults)
        error.result = result
        raise error
    return result


@contextmanager
def _torn(case: Case, comm: MPI.Intracomm, progress: standard_streams.Progress) -> Iterator[unit_cell.TornCell]:
    """Context manager: tear the cell under the PETSc options of its case; free the cell at the end.  Collective.

    Turns LinAlgError, from matrices singular by rounding, into ConvergenceError.
    """
    PETSc.garbage_cleanup(comm)  # all ranks free the parallel objects of earlier cases together
    process.forget_peak(kept=SPARE_BYTES)
    for warning in case.warnings():  # while there is time to stop the run; the summary has the remarks
        progress.say(f"warning: {warning}")
    with options_database.case_options(case.petsc):
        cell = None
        try:
            cell = unit_cell.tear(case, comm, progress, policy=partition_policy.BY_COST)
            options_database.refuse_unused()
            yield cell
        except BaseException as met:
            line = f"rounding leaves a matrix singular: stiffnesses differ by too much ({met})"
            error = ConvergenceError(line) if isinstance(met, np.linalg.LinAlgError) else met
            if cell and mpi_errors.all_raise(comm, error):  # destroy is collective; a rank without an error would go on
                cell.destroy()
            raise error from (met.__cause__ if error is met else met)
        cell.destroy()


def _run_and_write(
    cell: unit_cell.TornCell, directory: Path, progress: standard_streams.Progress, resume: bool, keep_fields: bool
) -> Result:
    """Analyse a torn cell, write the files, return the result, faulty or not.  Collective.  Raises FetiHomogError."""
    output, file = cell.case.output, None
    if output.fields:
        with progress.stage("output") as line:
            line.append(f"{directory}: result.h5 with the mesh; states follow")
            parts = field_parts.mesh_part(cell), field_parts.fibre_part(cell), field_parts.interface_part(cell)
            file = field_file.FieldFile(directory, cell.comm, field_parts.header(cell), *parts)
    with (
        file or nullcontext(),
        closing(result_json.EventLog(directory, cell.comm, cell.case.name, progress.say)) as log,
    ):
        states = StateRecorder(cell, file, keep_fields, progress.say)
        context = AnalysisContext.of(cell, progress, states)
        # No function in the context may refer to the context: garbage collection on one rank would then close the
        # parallel file, which is a collective call.
        context = replace(context, directory=directory, resume=resume, log=log.write)
        context.opening = lambda itself: result_json.text_of(records.plain(_opening(itself)))
        analysis = _analyse(context)
        seal = states.seal()
        if states.error is not None and not keep_fields:
            analysis.pop("states", None)
    result = replace(_result(context, analysis), result_h5=seal)
    if states.error is not None:  # the numbers are sound
        status = "incomplete" if result.status == "done" else result.status
        result = replace(result, faults=(*result.faults, str(states.error)), status=status)
    _write(result, directory, cell)
    if states.error is not None:
        raise states.error
    if cell.case.section.is_followed and not result.faults:
        context.checkpoint.clear()
    standard_streams.remarks.clear()
    if output.pictures:
        with progress.stage("pictures") as line:
            from feti_homog.report.plots import figures  # loads Matplotlib

            document = mpi_errors.on_root(cell.comm, output_folder.latest, directory)
            share = slice(cell.comm.rank, None, cell.comm.size)
            paths = cell.comm.allgather(mpi_errors.agree(cell.comm, figures.draw, directory, document, share))
            line.append(", ".join(sorted(path.name for drawn in paths for path in drawn)))
    if output.report:
        with progress.stage("report") as line:
            from feti_homog.report import page  # loads tables

            line.append(mpi_errors.on_root(cell.comm, page.write, directory).name)
    _print_summary(result, progress)
    return result


def _write(result: Result, directory: Path, cell: unit_cell.TornCell) -> None:
    """Write result.json, its tables and XDMF files; remove other result files from the folder.  Collective."""
    mpi_errors.on_root_only(cell.comm, result_json.write, directory, result.document)
    written = {result_json.NAME}
    if cell.case.section.is_followed:
        written.add(result_json.LOG)
    if result.result_h5 is not None:
        written |= {field_file.NAME, *(path.name for path in mpi_errors.on_root(cell.comm, xdmf.write, directory))}
    name = cell.case.analysis.type
    points = vars(result).get(name)
    if points is not None:
        rows = points if isinstance(points, tuple) else (points,)
        written.add(mpi_errors.on_root(cell.comm, result_json.write_csv, directory / f"{name}.csv", rows).name)
    mpi_errors.on_root_only(cell.comm, output_folder.remove_other_results, directory, written)


def _analyse(context: AnalysisContext) -> dict[str, Any]:
    """Print warnings, run the module of the case's analysis, and return its `Result` entries.  Collective."""
    for warning in (*context.cell.summary.warnings(), *context.warnings()):
        context.progress.say(f"warning: {warning}")
    with context.progress.stage("solve") as line:
        module = import_module(f"feti_homog.analysis.{context.case.analysis.type}")
        analysis: dict[str, Any] = module.run(context)
        iterations = context.checks.iterations
        line.append(f"{len(iterations)} states, {sum(iterations) or 'no'} iterations")
    if not sum(iterations) and (remark := options_database.without_iterations()):
        context.progress.say(f"remark: {remark}")
    return analysis


def _opening(context: AnalysisContext) -> dict[str, Any]:
    """Build the `Result` entries known before an analysis, with checks, remarks and times so far.  Collective."""
    cell, progress, checks = context.cell, context.progress, context.checks
    fractions, options = cell.fractions(), options_database.choices("feti_")
    asked = sum(cell.case.cell.fractions.values())
    meshed = sum(share for phase, share in fractions.items() if phase not in AROUND_FIBRES)
    lost = 1.0 - meshed / asked if asked and cell.case.cell.order == 1 else 0.0
    polygons = f"[cell] order = 1: polygons have {lost:.1%} less area than the fibres asked for; refine, or order = 2"
    lost_area = [polygons] if lost > REMARKABLE_LOSS else []
    cell_info = CellInfo(
        width=cell.summary.width,
        height=cell.summary.height,
        area=cell.summary.area,
        fibre_fraction=meshed,
        fractions=fractions,
        porosity=1.0 - sum(fractions.values()) if cell.summary.voids else 0.0,
        elements=cell.comm.allreduce(sum(len(s.mesh.triangles) for s in cell.subdomains)),
        nodes=cell.comm.allreduce(sum(map(uniform_parts.nodes_of_parts, cell.subdomains))),
        mesh_size=None if cell.case.cell.has_own_mesh else cell.case.cell.mesh_size,
        refine=cell.case.cell.refine,
        match_distance=mpi_errors.on_root(cell.comm, domain_partition.match_distance, cell.case, cell.summary),
        origin=cell.summary.origin,
    )
    return {
        "version": __version__,
        "date": mpi_errors.on_root(cell.comm, time.strftime, "%Y-%m-%d %H:%M UTC", time.gmtime()),
        "case": cell.case.resolved(),
        "digest": mpi_errors.on_root(cell.comm, cell.case.digest),
        "cell": cell_info,
        "fibres": FibreInfo.all_of(cell.case, cell.summary, cell.strength_factors),
        "solver": replace(SolverInfo.of(cell, checks.iterations, checks.reasons), options=options or None),
        "checks": checks.errors,
        "check_tolerance": checks.tolerance("jump"),
        "kkt_tolerance": CONTACT_TOLERANCE,
        "warnings": (*cell.case.warnings(), *cell.summary.warnings(), *context.warnings()),
        "remarks": (*cell.case.remarks(), *cell.summary.remarks, *lost_area, *context.remarks()),
        "timings": progress.timings(),
        "memory": progress.memory(),
    }


def _result(context: AnalysisContext, analysis: Mapping[str, Any]) -> Result:
    """Build the result from the `Result` entries of a finished analysis and from the context.  Collective."""
    checks, states = context.checks, context.states
    entries = _opening(context) | {"checks": Checks(**checks.errors), "faults": tuple(checks.faults)}
    status = "not converged" if checks.faults else "done"
    return Result(status=status, fields=states.fields(), phase_stresses=states.phase_stresses(), **entries, **analysis)


def _print_summary(result: Result, progress: standard_streams.Progress) -> None:
    """Print the summary of a result on rank 0, without its faults, which the later error prints.  Collective."""
    timings = progress.timings()
    if progress.prints:
        from feti_homog.report.text import summary

        printed = replace(result, timings=timings, faults=())
        progress.say(f"\n{summary.summary(printed.document)}")
