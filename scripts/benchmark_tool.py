"""One tool of the benchmark in an MPI job of its own: mesh, assemble, set up, solve, and report.

Every tool begins with the same meshing, tearing, refining and assembling.  Options with the prefix `peer_` in the
environment's PETSC_OPTIONS go before those of the peer.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import petsc4py

petsc4py.init(sys.argv[:1])

from glued import Glued, glue  # noqa: E402
from mpi4py import MPI  # noqa: E402
from peers import PEERS, Peer  # noqa: E402
from petsc4py import PETSc  # noqa: E402

from feti_homog.analysis.context import AnalysisContext  # noqa: E402
from feti_homog.common import process_memory  # noqa: E402
from feti_homog.common.mpi_errors import run_main  # noqa: E402
from feti_homog.common.petsc_options import case_options  # noqa: E402
from feti_homog.common.progress import Progress  # noqa: E402
from feti_homog.config import case as cases  # noqa: E402
from feti_homog.config.case import Case  # noqa: E402
from feti_homog.homogenization import unit_cell  # noqa: E402
from feti_homog.homogenization.averaging import Homogenization  # noqa: E402
from feti_homog.typing import Float  # noqa: E402

PREFIX = "peer_"
MEGABYTE = 2**20


def main() -> int:
    """Run the tool that the command line names; rank 0 writes the report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tool", choices=["feti", *PEERS])
    parser.add_argument("case", type=Path)
    parser.add_argument("report", type=Path)
    parser.add_argument("--loads", type=int, required=True)
    parser.add_argument("--rtol", type=float, required=True)
    arguments = parser.parse_args()
    progress = Progress(MPI.COMM_WORLD, quiet=True)
    case = dataclasses.replace(cases.load(arguments.case), interface=None)
    if arguments.tool == "feti":
        report = feti(case, progress, arguments.loads, arguments.rtol)
    else:
        report = peer(PEERS[arguments.tool], case, progress, arguments.loads, arguments.rtol)
    report |= {"seconds": progress.timings(), "memory": sum(progress.comm.allgather(peak()))}
    if progress.comm.rank == 0:
        arguments.report.write_text(json.dumps(report))
    return 0


def feti(case: Case, progress: Progress, loads: int, rtol: float) -> dict[str, Any]:
    """This program."""
    comm = progress.comm
    with case_options(case.petsc | {"feti_ksp_rtol": rtol}):
        cell = unit_cell.tear(case, comm, progress)
        progress.seconds["set-up"] = progress.seconds.pop("factor")
        with progress.stage("set-up"):
            context = AnalysisContext(Homogenization(cell, contact=False), cell.debonded, progress, lambda *_: None)
        with progress.stage("solve"):
            starts = context.zero_multipliers()[:loads]
            responses = context.homogenization.respond(np.eye(3)[:loads], context.status(None), starts)
            for response in responses:
                context.record_checks("", response)
    dofs = cell.sum_over_ranks(sum(len(s.Q) for s in cell.subdomains))
    cell.solver.destroy()
    columns = [response.stress for response in responses]
    return _report(dofs, cell.summary.subdomains, columns, context.iterations, context.reasons)


def peer(tool: Peer, case: Case, progress: Progress, loads: int, rtol: float) -> dict[str, Any]:
    """One of the others."""
    comm = progress.comm
    plan, _, lattice, subdomains = unit_cell.assemble_subdomains(case, comm, progress)
    with progress.stage("glue"):
        cell = glue(comm, subdomains, lattice)
        A = _operator(tool, cell)
    with progress.stage("set-up"):
        ksp = _solver(tool, A, rtol)
    columns, iterations, reasons = [], [], []
    with progress.stage("solve"):
        for strain, load in zip(np.eye(3)[:loads], cell.Q, strict=False):
            u = load.duplicate()
            ksp.solve(-load, u)
            columns.append((cell.stiffness @ strain + cell.stress(u)) / plan.area)
            iterations.append(ksp.getIterationNumber())
            reasons.append(int(ksp.getConvergedReason()))
    return _report(A.getSize()[0], plan.subdomains, columns, iterations, reasons)


def _operator(tool: Peer, cell: Glued) -> PETSc.Mat:
    """The matrix in the peer's type, with the rigid-body modes if it wants them; that of `cell` may be freed."""
    A, modes = cell.A, cell.rigid() if tool.rigid else None
    if tool.matrix != "is":
        A = cell.A.convert(tool.matrix, PETSc.Mat())
        A.setOption(PETSc.Mat.Option.SPD, True)
        cell.A.destroy()
    if modes is not None:
        A.setNearNullSpace(modes)
    return A


def _solver(tool: Peer, A: PETSc.Mat, rtol: float) -> PETSc.KSP:
    """The KSP of a matrix, set up."""
    database = PETSc.Options(PREFIX)
    for name, value in tool.options.items():
        if not database.hasName(name):
            database.setValue(name, value)
    ksp = PETSc.KSP().create(A.comm)
    ksp.setOptionsPrefix(PREFIX)
    ksp.setOperators(A)
    ksp.setTolerances(rtol=rtol, atol=0.0, max_it=2000)
    ksp.setFromOptions()
    ksp.setUp()
    return ksp


def _report(
    dofs: int, subdomains: int, columns: Sequence[Float], iterations: list[int], reasons: list[int]
) -> dict[str, Any]:
    """What is compared; `columns` of L^ef are the stresses under the unit strains."""
    return {
        "dofs": dofs,
        "subdomains": subdomains,
        "stiffness": np.stack(columns, axis=1).tolist(),
        "iterations": iterations,
        "converged": min(reasons) > 0,
    }


def peak() -> float:
    """Largest resident memory of this rank so far in megabytes."""
    return process_memory.peak() / MEGABYTE


if __name__ == "__main__":
    sys.exit(run_main(MPI.COMM_WORLD, main))
