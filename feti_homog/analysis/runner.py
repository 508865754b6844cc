"""One case from its description to its result: tear, solve, homogenize, check, and write if there is a folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.analysis import result_builder
from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.registry import analysis_of
from feti_homog.analysis.result import Result
from feti_homog.analysis.state_recorder import StateRecorder
from feti_homog.case.case import Case
from feti_homog.errors import ConvergenceError
from feti_homog.homogenization.partition_policy import BY_COST
from feti_homog.homogenization.unit_cell import TornCell, tear
from feti_homog.results import (
    field_file,
    field_parts,
    output_folder,
    result_json,
    xdmf,
)
from feti_homog.results.checkpoint import Checkpoint, EventsInMemory, room_of
from feti_homog.results.field_file import FieldFile
from feti_homog.results.output_folder import EventLog
from feti_homog.system.parallel.mpi_errors import all_raise, on_root, on_root_only
from feti_homog.system.petsc.options import case_options, refuse_unused, without_iterations
from feti_homog.system.runtime import process_memory
from feti_homog.system.runtime.progress import Progress

# Freed bytes that stay for the next case of a process: to give them back and take them again costs a small one a tenth.
KEPT = 256 << 20


def run(
    case: Case, directory: Path, comm: MPI.Intracomm, quiet: bool, resume: bool = False, keep_fields: bool = False
) -> Result:
    """Run the case, write its results to `directory`, and return them.  Collective.

    `resume` goes on from a path's checkpoint, or reads the result if it is finished; `keep_fields` returns the fields
    too, unless nothing was computed.

    Raises:
        CaseError, MeshError: before any result is written; also for a checkpoint of another run, and for a folder
            that another run writes to.
        ConvergenceError: after what was computed has been written, marked as such.
    """
    progress = _begun(case, comm, quiet)
    if resume and on_root(comm, _is_finished, directory, case):
        progress.say(f"{directory} holds the finished result of this case: nothing to do")
        return Result.of(on_root(comm, result_json.read, directory))
    on_root(comm, output_folder.usable, directory)
    on_root(comm, output_folder.refuse_files_of_others, directory)
    with output_folder.held(directory, comm, progress.say), _torn(case, comm, progress) as cell:
        result = _run_and_write(cell, directory, progress, resume, keep_fields)
    if result.faults:
        raise ConvergenceError(*result.faults)
    return result


def compute(case: Case, comm: MPI.Intracomm, keep_fields: bool = False, quiet: bool = True) -> Result:
    """Return the case's result on every rank, without a file. Collective.

    Raises:
        CaseError, MeshError: the case cannot be run.
        ConvergenceError: a solve did not converge or a check failed.
    """
    progress = _begun(case, comm, quiet)
    with _torn(case, comm, progress) as cell:
        states = StateRecorder(cell, None, keep_fields, progress.say)
        context = AnalysisContext.of(cell, progress, states)
        if keep_fields or context.plane.law.has_toughness:
            context = replace(context, checkpoint=EventsInMemory(comm, room_of(case)))
        _warn(context)
        result = result_builder.result(context, _analyse(context), states.kept())
    _print_summary(result, progress)
    if result.faults:
        raise ConvergenceError(*result.faults)
    return result


def _begun(case: Case, comm: MPI.Intracomm, quiet: bool) -> Progress:
    """Return the progress of a run, after the warnings and remarks about its case."""
    progress = Progress(comm, quiet)
    for label, lines in (("warning", case.warnings()), ("remark", case.remarks())):
        for line in lines:
            progress.say(f"{label}: {line}")
    return progress


def _warn(context: AnalysisContext) -> None:
    for warning in context.warnings():
        context.progress.say(f"warning: {warning}")


@contextmanager
def _torn(case: Case, comm: MPI.Intracomm, progress: Progress) -> Iterator[TornCell]:
    """Provide the torn cell with the case's options set, while the block lasts."""
    PETSc.garbage_cleanup(comm)  # what earlier cases left: parallel objects are freed by all ranks together
    process_memory.forget_peak(kept=KEPT)
    with case_options(case.petsc):
        cell = tear(case, comm, progress, policy=BY_COST)
        try:
            refuse_unused()
            yield cell
        except BaseException as error:
            if all_raise(comm, error):  # else the ranks that go on would not come to destroy it
                cell.destroy()
            raise
        cell.destroy()


def _run_and_write(cell: TornCell, directory: Path, progress: Progress, resume: bool, keep_fields: bool) -> Result:
    """Analyse and write; the result may have faults."""
    output = cell.case.output
    file = _field_file(cell, directory, progress) if output.fields else None
    with file or nullcontext(), closing(EventLog(directory, cell.comm, cell.case.name, progress.say)) as log:
        states = StateRecorder(cell, file, keep_fields, progress.say)
        context = AnalysisContext.of(cell, progress, states)
        context = replace(context, checkpoint=_checkpoint(cell, directory), resume=resume)
        context = replace(context, log=log.write, events=output_folder.LOG)
        _warn(context)
        analysis = _analyse(context)
        seal = states.seal()
        if states.error is not None and not keep_fields:
            analysis.pop("states", None)
    result = replace(result_builder.result(context, analysis, states.kept()), result_h5=seal)
    _write(result, directory, cell)
    if states.error is not None:
        raise states.error
    if analysis_of(cell.case).events and not result.faults:
        context.checkpoint.clear()
    for name, wanted, make in (("pictures", output.pictures, _draw), ("report", output.report, _report)):
        if wanted:
            with progress.stage(name) as words:
                words.append(", ".join(path.name for path in on_root(cell.comm, make, directory)))
    _print_summary(result, progress)
    return result


def _field_file(cell: TornCell, directory: Path, progress: Progress) -> FieldFile:
    with progress.stage("output") as words:
        words.append(f"{directory}: result.h5 with the mesh, the states follow")
        return FieldFile(
            directory,
            cell.comm,
            field_parts.header(cell),
            field_parts.mesh_part(cell),
            field_parts.fibre_part(cell),
            field_parts.interface_part(cell),
        )


def _analyse(context: AnalysisContext) -> dict[str, Any]:
    """Return the entries of `Result` that the analysis asked for makes."""
    with context.progress.stage("solve") as words:
        analysis = analysis_of(context.case).run(context)
        iterations = context.checks.iterations
        words.append(f"{len(iterations)} states, {sum(iterations) or 'no'} iterations")
    if not sum(iterations) and (line := without_iterations()):
        context.progress.say(f"remark: {line}")
    return analysis


def _checkpoint(cell: TornCell, directory: Path) -> Checkpoint:
    plan, multipliers = cell.summary, cell.solver.jump_operator.global_rows
    parts = f"{plan.subdomains} subdomains on {cell.comm.size} ranks, {multipliers} multipliers"
    signature = f"case {on_root(cell.comm, cell.case.digest, False)}, {parts}"  # events are those of any [output]
    return Checkpoint(directory, cell.comm, signature, room_of(cell.case))


def _is_finished(directory: Path, case: Case) -> bool:
    from feti_homog.analysis import stored_result  # which reads and checks files that most runs have not

    return stored_result.finished(directory, case)


def _write(result: Result, directory: Path, cell: TornCell) -> None:
    """result.json, then what can be made of it again; files of an earlier result do not stay beside them."""
    on_root_only(cell.comm, result_json.write, directory, result.document)
    written = {result_json.NAME}
    if result.result_h5 is not None:
        written |= {field_file.NAME, *(path.name for path in on_root(cell.comm, xdmf.write, directory))}
    analysis, name = analysis_of(cell.case), cell.case.analysis.type
    if analysis.table:
        points = getattr(result, name)
        rows = points if isinstance(points, tuple) else (points,)
        written.add(on_root(cell.comm, result_json.write_csv, directory / f"{name}.csv", rows).name)
    written |= {output_folder.LOG} if analysis.events else set()
    on_root_only(cell.comm, output_folder.remove_other_results, directory, written)


def _draw(directory: Path) -> list[Path]:
    """Return the pictures; only a rank that draws loads Matplotlib."""
    from feti_homog.report.plots import figures

    return figures.plot(directory)


def _print_summary(result: Result, progress: Progress) -> None:
    """Print the summary on rank 0; only a rank that prints it loads its tables.  Collective."""
    timings = progress.timings()
    if progress.prints:
        from feti_homog.report.text.summary import summary

        progress.say(f"\n{summary(replace(result, timings=timings).document)}")


def _report(directory: Path) -> list[Path]:
    from feti_homog.report import page  # with tables that other ranks do not load

    return [page.write(directory)]
