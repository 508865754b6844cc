"""One path of the event study in a separate MPI job: the first events of a random cell that debonds.

Rank 0 writes the report: seconds, dual problems, iterations and exchanges of an event.
"""

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

import petsc4py

petsc4py.init(sys.argv[:1])

import numpy as np  # noqa: E402
from benchmark_path import document, run_events  # noqa: E402
from collective_calls import collective_calls  # noqa: E402
from mpi4py import MPI  # noqa: E402
from petsc4py import PETSc  # noqa: E402
from scaling_events import EventRow  # noqa: E402
from scaling_tool import PINGS, foreign, ping  # noqa: E402

from feti_homog.case import cases  # noqa: E402
from feti_homog.case.cases import Case  # noqa: E402
from feti_homog.homogenization.averaging import Homogenization  # noqa: E402
from feti_homog.homogenization.unit_cell import tear  # noqa: E402
from feti_homog.system.parallel.mpi_errors import run_main  # noqa: E402
from feti_homog.system.petsc.options_database import case_options  # noqa: E402
from feti_homog.system.runtime.standard_streams import Progress  # noqa: E402


def main() -> int:
    """Run the path that the command line describes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("report", type=Path)
    parser.add_argument("--fibres", type=int, required=True)
    parser.add_argument("--mesh-size", type=float, required=True)
    parser.add_argument("--refine", type=int, required=True)
    parser.add_argument("--events", type=int, required=True)
    arguments = parser.parse_args()
    arguments.operator = "auto"
    case = cases.parse(document(arguments), Path())
    PETSc.Log.begin()
    with case_options(case.petsc):
        row = measure(case, arguments, MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        arguments.report.write_text(json.dumps(asdict(row), indent=1))
    return 0


def measure(case: Case, arguments: argparse.Namespace, comm: MPI.Intracomm) -> EventRow:
    """Return the row of a path, followed once for times and once for collective calls. Collective."""
    progress = Progress(comm, quiet=True)
    cell = tear(case, comm, progress)
    solver = cell.solver
    with progress.stage("reference"):
        homogenization = Homogenization(cell, contact=True)
        # The stiffness of the torn cell, which the first event would otherwise compute.
        _ = homogenization.interface.solver.torn_stiffness
    with progress.stage("events"):
        seconds, iterations, solves = run_events(homogenization, arguments.events)
    with progress.stage("calls"), collective_calls() as calls:
        run_events(homogenization, arguments.events)
    log = PETSc.Log.Event("VecScatterBegin").getPerfInfo(PETSc.Log.Stage("events").id)
    counts = np.array(comm.allgather(foreign(solver.jump_operator, comm)))
    neighbours = (counts > 0).sum(axis=0) + (counts > 0).sum(axis=1)
    made = len(seconds)
    row = EventRow(
        fibres=arguments.fibres,
        ranks=comm.size,
        dofs=comm.allreduce(sum(s.n_dofs for s in solver.subdomains)),
        events=made,
        seconds=comm.allreduce(sum(seconds), MPI.MAX) / made,
        worst=comm.allreduce(max(seconds), MPI.MAX),
        setup=sum(took for stage, took in progress.timings().items() if stage not in ("events", "calls")),
        solves=sum(solves) / made,
        iterations=sum(iterations) / made,
        exchanges=log["count"] / made,
        collectives=calls.total() / made,
        kilobytes=comm.allreduce(log["messageLength"], MPI.MAX) / made / 1e3,
        neighbours=int(neighbours.max()),
        latency=ping(comm, *PINGS["latency"]) / 2,
    )
    solver.destroy()
    return row


if __name__ == "__main__":
    sys.exit(run_main(MPI.COMM_WORLD, main))
