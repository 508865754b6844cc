"""One tool of the benchmark in an MPI job of its own: mesh, assemble, set up, solve, and report.

Every tool begins with the same meshing, tearing, refining and assembling.  In generalized plane strain each tool solves
the uncoupled problems in the plane and along the fibres for all their loads.  Options with the prefix `peer_` in
PETSC_OPTIONS win over the peer's own options.
"""

import argparse
import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import petsc4py

petsc4py.init(sys.argv[:1])

from glued import Glued, Nodes, glue  # noqa: E402
from mpi4py import MPI  # noqa: E402
from peers import PEERS, Peer  # noqa: E402
from petsc4py import PETSc  # noqa: E402

from feti_homog.analysis.context import AnalysisContext  # noqa: E402
from feti_homog.case import cases  # noqa: E402
from feti_homog.case.cases import Case  # noqa: E402
from feti_homog.homogenization import phase_laws, unit_cell  # noqa: E402
from feti_homog.homogenization.partition_policy import BY_COST  # noqa: E402
from feti_homog.system.parallel.mpi_errors import agree, run_main  # noqa: E402
from feti_homog.system.petsc.options_database import case_options  # noqa: E402
from feti_homog.system.runtime import process_memory  # noqa: E402
from feti_homog.system.runtime.progress_bar import Progress  # noqa: E402
from feti_homog.typing import Float  # noqa: E402

PREFIX = "peer_"
MEGABYTE = 2**20


def main() -> int:
    """Run the tool that the command line names; rank 0 writes the report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tool", choices=["feti", *PEERS])
    parser.add_argument("case", type=Path)
    parser.add_argument("report", type=Path)
    parser.add_argument("--plane", required=True, help="the plane state, in place of that of the case")
    parser.add_argument("--loads", type=int, help="solve for the first loads only; all by default")
    parser.add_argument("--rtol", type=float, required=True)
    arguments = parser.parse_args()
    progress = Progress(MPI.COMM_WORLD, quiet=True)
    case = cases.load(arguments.case)
    case = dataclasses.replace(
        case, interfaces=(), analysis=dataclasses.replace(case.analysis, plane=arguments.plane),
        output=dataclasses.replace(case.output, fields=False),
    )  # fmt: skip
    if arguments.tool == "feti":
        report = feti(case, progress, arguments.loads, arguments.rtol)
    else:
        report = peer(PEERS[arguments.tool], case, progress, arguments.loads, arguments.rtol)
    report |= {"seconds": progress.timings(), "memory": sum(progress.comm.allgather(peak()))}
    if progress.comm.rank == 0:
        arguments.report.write_text(json.dumps(report))
    return 0


def feti(case: Case, progress: Progress, loads: int | None, rtol: float) -> dict[str, Any]:
    """Time this program."""
    comm = progress.comm
    with case_options(case.petsc | {"feti_ksp_rtol": rtol}):
        cell = unit_cell.tear(case, comm, progress, policy=BY_COST)
        progress.seconds["set-up"] = progress.seconds.pop("factor") + progress.seconds.pop("axial", 0.0)
        with progress.stage("set-up"):
            context = AnalysisContext.of(cell, progress)
            problems, bonds = context.loads.problems, context.bonds(None)
        columns = []
        with progress.stage("solve"):
            for problem in problems:
                E = np.eye(len(problem.loads))[:loads]
                responses = problem.respond(E, bonds, [np.zeros(problem.cell.solver.rows)] * len(E))
                columns.append(np.stack([response.stress for response in responses], axis=1))
                for response in responses:
                    context.checks.record("", response)
    dofs = cell.comm.allreduce(sum(s.n_dofs for problem in problems for s in problem.cell.subdomains))
    cell.destroy()
    return _report(dofs, cell.summary.subdomains, columns, context.checks.iterations, context.checks.reasons)


def peer(tool: Peer, case: Case, progress: Progress, loads: int | None, rtol: float) -> dict[str, Any]:
    """Run another tool; its second problem begins after the matrices of the first problem are freed."""
    comm = progress.comm
    own, _, lattice, subdomains = unit_cell.assemble_subdomains(case, comm, progress, BY_COST)
    with progress.stage("glue"):
        nodes = Nodes.of(comm, subdomains, lattice)
    meshed, dofs = list(subdomains), 0
    columns, iterations, reasons = list[Float](), list[int](), list[int]()
    for problem in ("plane", "axial")[: len(phase_laws.problems(case))]:
        if problem == "axial":
            with progress.stage("assemble"):
                subdomains = agree(comm, unit_cell.assemble_axial, case, own.summary, meshed)
        with progress.stage("glue"):
            cell = glue(comm, subdomains, nodes)
            A = _operator(tool, cell)
            dofs += A.getSize()[0]
        with progress.stage("set-up"):
            ksp = _solver(tool, A, rtol)
        with progress.stage("solve"):
            solved = (_solved_together if tool.direct else _solved_in_turn)(ksp, cell.Q[:loads])
            stresses = [cell.stress(u) for u in solved.solutions]
            columns.append((cell.stiffness[:, :loads] - np.stack(stresses, axis=1)) / own.summary.area)
        iterations += solved.iterations
        reasons += solved.reasons
        ksp.destroy()
        A.destroy()
    return _report(dofs, own.summary.subdomains, columns, iterations, reasons)


def _operator(tool: Peer, cell: Glued) -> PETSc.Mat:
    """Return the matrix in the peer's type, with rigid-body modes if used; may free the matrix of `cell`."""
    A, modes = cell.A, cell.rigid() if tool.rigid else None
    if tool.matrix != "is":
        A = cell.A.convert(tool.matrix, PETSc.Mat())
        A.setOption(PETSc.Mat.Option.SPD, True)
        cell.A.destroy()
    if modes is not None:
        A.setNearNullSpace(modes)
    return A


def _solver(tool: Peer, A: PETSc.Mat, rtol: float) -> PETSc.KSP:
    """Return a KSP for a matrix, set up."""
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


class _Solved(NamedTuple):
    """The solutions of A u = Q for each load, with iterations and KSPConvergedReasons."""

    solutions: list[PETSc.Vec]
    iterations: list[int]
    reasons: list[int]


def _solved_in_turn(ksp: PETSc.KSP, loads: Sequence[PETSc.Vec]) -> _Solved:
    """Solve for one load after the other."""
    solved = _Solved([], [], [])
    for load in loads:
        u = load.duplicate()
        ksp.solve(load, u)
        solved.solutions.append(u)
        solved.iterations.append(ksp.getIterationNumber())
        solved.reasons.append(int(ksp.getConvergedReason()))
    return solved


def _solved_together(ksp: PETSc.KSP, loads: Sequence[PETSc.Vec]) -> _Solved:
    """Solve for all loads at once, which is fastest with a factor; there are no iterations."""
    size = ((loads[0].getLocalSize(), None), (None, len(loads)))
    right = PETSc.Mat().createDense(size, comm=ksp.comm)
    right.setUp()
    right.getDenseArray()[:] = np.stack([load.getArray() for load in loads], axis=1)
    right.assemble()
    found = right.duplicate()
    ksp.getPC().getFactorMatrix().matSolve(right, found)
    solutions = [load.duplicate() for load in loads]
    for u, column in zip(solutions, found.getDenseArray().T, strict=True):
        u.setArray(column)
    right.destroy()
    found.destroy()
    return _Solved(solutions, [], [1])


def _report(
    dofs: int, subdomains: int, problems: Sequence[Float], iterations: list[int], reasons: list[int]
) -> dict[str, Any]:
    """Return the numbers to compare; `problems` are the stresses (v, k) under the loads of each problem."""
    stresses = np.column_stack(list(phase_laws.secants(*problems).values()))
    return {
        "dofs": dofs,
        "subdomains": subdomains,
        "stresses": stresses.tolist(),
        "iterations": iterations,
        "converged": min(reasons) > 0,
    }


def peak() -> float:
    """Return the largest resident memory of this rank so far, in megabytes."""
    return process_memory.peak() / MEGABYTE


if __name__ == "__main__":
    sys.exit(run_main(MPI.COMM_WORLD, main))
