"""One run of the scaling study in a separate MPI job: tear, set up and solve a random cell, count its messages.

The cell has fibre fraction 0.6 and gaps of 4 % of the fibres' diameter; it is cut as by default, and the three unit
strains are solved together.  Rank 0 writes the report.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import petsc4py

petsc4py.init(sys.argv[:1])

import numpy as np  # noqa: E402
from benchmark_tool import peak  # noqa: E402
from mpi4py import MPI  # noqa: E402
from petsc4py import PETSc  # noqa: E402
from scaling_report import FACTOR, MULTIGRID  # noqa: E402

from feti_homog.case import cases  # noqa: E402
from feti_homog.case.cases import Case  # noqa: E402
from feti_homog.feti.coarse.adaptive import AdaptiveCoarseSpace  # noqa: E402
from feti_homog.feti.coarse.natural import NaturalCoarseSpace  # noqa: E402
from feti_homog.feti.decomposition.jump_operator import JumpOperator  # noqa: E402
from feti_homog.homogenization.domain_partition import summary_of  # noqa: E402
from feti_homog.homogenization.partition_policy import DEFAULT_POLICY  # noqa: E402
from feti_homog.homogenization.tile_tearing import begin_mesh, tiled_cell  # noqa: E402
from feti_homog.homogenization.unit_cell import TornCell, tear  # noqa: E402
from feti_homog.mesh.fill.gmsh_mesher import UnmeshedCell  # noqa: E402
from feti_homog.mesh.tiles.tile_filling import fill  # noqa: E402
from feti_homog.mesh.tiles.tiling import TilePolicy  # noqa: E402
from feti_homog.system.parallel.mpi_errors import on_root, run_main  # noqa: E402
from feti_homog.system.petsc.options_database import case_options  # noqa: E402
from feti_homog.system.runtime import process  # noqa: E402
from feti_homog.system.runtime.standard_streams import Progress  # noqa: E402
from feti_homog.typing import Int  # noqa: E402

LOADS = 3
# Solves of the coarse problem that are timed; the fastest counts.
TIMED = 5
RTOL = 1e-8
# Triangles of a mesh with equal sides h in a unit square are 2.31 / h^2; the narrow gaps add about so many times the
# root of a fibre's share of them.
TRIANGLES, IN_GAPS = 2.31, 6.0
# Messages between two ranks that are timed: bytes of one, and how many.
PINGS = {"latency": (8, 2000), "bandwidth": (4 << 20, 50)}
# PETSc's options of ways to solve the coarse problem.
OPTIONS: dict[str, dict[str, str | float]] = {
    MULTIGRID: {
        "feti_coarse_ksp_type": "cg", "feti_coarse_ksp_rtol": 1e-10, "feti_coarse_pc_type": "gamg",
        "feti_coarse_pc_gamg_threshold": 0.1, "feti_coarse_mg_levels_pc_type": "asm",
        "feti_coarse_mg_levels_sub_pc_type": "icc",
    },
}  # fmt: skip


def main() -> int:
    """Run the cell that the command line describes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("report", type=Path)
    parser.add_argument("--fibres", type=int, required=True)
    parser.add_argument("--dofs", type=int, required=True, help="about so many degrees of freedom")
    parser.add_argument("--refine", type=int, required=True)
    parser.add_argument("--way", choices=OPTIONS, help="to solve the coarse problem; by default as the program chooses")
    parser.add_argument("--threshold", type=float, help="of the coarse space; by default the program's")
    arguments = parser.parse_args()
    options = OPTIONS.get(arguments.way or "", {})
    if arguments.threshold is not None:
        options = options | {"feti_coarse_threshold": arguments.threshold}
    case = random_cell(arguments.fibres, arguments.dofs, arguments.refine, options)
    PETSc.Log.begin()
    progress = StagePeaks(MPI.COMM_WORLD, quiet=True)
    with case_options(case.petsc):
        report = measure(case, progress, arguments.way)
    if progress.comm.rank == 0:
        asked = {"fibres": arguments.fibres, "wanted": arguments.dofs, "refine": arguments.refine, "loads": LOADS}
        arguments.report.write_text(json.dumps(asked | report, indent=1))
    return 0


class StagePeaks(Progress):
    """Progress that also keeps the peak of resident memory of each stage, in megabytes of this rank."""

    def __init__(self, comm: MPI.Intracomm, quiet: bool) -> None:
        super().__init__(comm, quiet)
        self.peaks: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[list[str]]:
        """Time a stage, as `Progress.stage`."""
        process.forget_peak()
        with super().stage(name) as words:
            yield words
        self.peaks[name] = peak()

    def all_peaks(self) -> dict[str, list[float]]:
        """Return the peaks of every rank, by stage.  Collective."""
        return {name: self.comm.allgather(megabytes) for name, megabytes in self.peaks.items()}


def random_cell(fibres: int, dofs: int, refine: int, options: dict[str, str | float]) -> Case:
    """Return a case with about `dofs` degrees of freedom, and the PETSc options of its coarse space."""
    each = dofs / fibres / 4**refine
    regular = (np.sqrt(each + (IN_GAPS / 2) ** 2) - IN_GAPS / 2) ** 2
    document = {
        "cell": {
            "geometry": "random", "fibres": fibres, "fibre_fraction": 0.6, "min_gap": 0.04,
            "mesh_size": float(np.sqrt(TRIANGLES / regular / fibres)), "refine": refine,
        },
        "material": {"matrix": {"young": 3.0, "poisson": 0.35}, "fibre": {"young": 70.0, "poisson": 0.2}},
        "analysis": {"type": "stiffness", "plane": "strain"},
        "petsc": {"feti_ksp_rtol": RTOL, "feti_coarse_space": "adaptive"} | options,
    }  # fmt: skip
    return cases.parse(document, Path())


def measure(case: Case, progress: StagePeaks, way: str | None) -> dict[str, Any]:
    """Return seconds, iterations, sizes, memory and messages of a case."""
    comm = progress.comm
    network = {name: ping(comm, *sizes) for name, sizes in PINGS.items()}
    cell = tear(case, comm, progress)
    solver = cell.solver
    for by_stage in (progress.seconds, progress.peaks):
        by_stage["set-up"] = by_stage.pop("factor")
    with progress.stage("solve"):
        solutions = solver.solve_many(np.eye(LOADS), np.zeros((solver.rows, LOADS)))
    if solver.adaptive is None:
        raise TypeError("the study is of the adaptive coarse space")
    own = comm.allgather(sum(s.n_dofs for s in solver.subdomains))
    report = {
        "ranks": comm.size,
        "dofs": sum(own),
        "fullest": max(own),
        "triangles": cell.summary.coarse_triangles,
        "subdomains": cell.summary.subdomains,
        "vectors": solver.coarse_dimension,
        "kernel": solver.natural.kernel_dimension,
        "iterations": solutions[0].iterations,
        "converged": solutions[0].reason > 0,
        "seconds": progress.timings(),
        "peaks": progress.all_peaks(),
        "latency": network["latency"] / 2,
        "bandwidth": 2 * PINGS["bandwidth"][0] / network["bandwidth"] if comm.size > 1 else 0.0,
        **_messages(cell),
        **_coarse(solver.adaptive, solver.natural, comm, way),
    }
    solver.destroy()
    report["alone"] = on_root(comm, seconds_alone, case, DEFAULT_POLICY.tiles)
    return report


def seconds_alone(case: Case, policy: TilePolicy) -> float:
    """Return the seconds in which rank 0 alone meshes a cell, without placing nodes; it fills cells without tiles."""
    start = time.perf_counter()
    unmeshed = begin_mesh(case, policy)
    assert isinstance(unmeshed, UnmeshedCell)
    begun = time.perf_counter()
    stations = unmeshed.bare.lines.stations(unmeshed.bare.field)
    placed = time.perf_counter()
    noded = unmeshed.with_nodes(stations)
    if len(noded.parts) == 1:
        noded.mesh([fill(tile) for tile in noded.parts])
    tiled_cell(case, noded)
    summary_of(case, noded, 0, 0)
    return begun - start + time.perf_counter() - placed


def _messages(cell: TornCell) -> dict[str, Any]:
    """Count the messages of a rank in one exchange of multipliers, and the exchanges of the solves.

    `outgoing` and `incoming` count the values for all loads, `neighbours` the ranks that a rank sends to or receives
    from in a gather; in a sum, senders and receivers swap.  `logged` are the bytes in both directions that PETSc
    counted in the solves.
    """
    comm = cell.comm
    counts = LOADS * np.array(comm.allgather(foreign(cell.solver.jump_operator, comm)))
    log = PETSc.Log.Event("VecScatterBegin").getPerfInfo(PETSc.Log.Stage("solve").id)
    return {
        "outgoing": counts.sum(axis=0).tolist(),
        "incoming": counts.sum(axis=1).tolist(),
        "neighbours": ((counts > 0).sum(axis=0) + (counts > 0).sum(axis=1)).tolist(),
        "exchanges": log["count"],
        "logged": comm.allgather(log["messageLength"]),
    }


def foreign(jump_operator: JumpOperator, comm: MPI.Intracomm) -> Int:
    """Return the numbers (ranks,) of local rows that each of the other ranks owns."""
    ends = np.array(comm.allgather(jump_operator.owned[1]))
    counts = np.bincount(np.searchsorted(ends, jump_operator.rows, side="right"), minlength=comm.size)
    counts[comm.rank] = 0
    return counts


def ping(comm: MPI.Intracomm, size: int, times: int) -> float:
    """Return the mean seconds of `times` messages of `size` bytes from rank 0 to 1 and back; 0 on one rank."""
    message, seconds = bytearray(size), 0.0
    comm.Barrier()
    if comm.rank < 2 <= comm.size:
        start = time.perf_counter()
        for _ in range(times):
            if comm.rank == 0:
                comm.Send(message, 1)
                comm.Recv(message, 1)
            else:
                comm.Recv(message, 0)
                comm.Send(message, 0)
        seconds = (time.perf_counter() - start) / times
    return comm.bcast(seconds)


def _coarse(
    coarse: AdaptiveCoarseSpace, natural: NaturalCoarseSpace, comm: MPI.Intracomm, asked: str | None
) -> dict[str, Any]:
    """Return seconds and megabytes of the coarse space.

    The seconds are for set-up, for summing and factoring the coarse matrix from the ranks' parts and the matrix of the
    rigid-body motions, and for the solves of one iteration.  The megabytes are the growth of each rank by the factors.
    """
    right, motions = (np.ones((n, LOADS)) for n in (coarse.part().shape[0], len(natural.unknowns)))
    right[1::2] = -1.0
    solve = fastest(lambda: coarse.solve(right))
    natural_solve = fastest(lambda: natural.solver.solve(natural.solver.solve(motions)))
    inner = coarse.solver.iterations
    part = coarse.part()
    process.forget_peak()
    before = peak()
    comm.Barrier()
    factor, natural_factor = seconds_of(lambda: coarse.factor(part)), seconds_of(natural.factor)
    grown = peak() - before
    setup = PETSc.Log.Event("FETICoarseSetUp").getPerfInfo(PETSc.Log.Stage("factor").id)["time"]
    seconds = {
        "coarse_setup": setup, "coarse_factor": factor, "coarse_solve": solve,
        "natural_factor": natural_factor, "natural_solve": natural_solve,
    }  # fmt: skip
    return {
        "way": asked or FACTOR,
        "inner": inner,
        "coarse_memory": comm.allgather(grown),
        **{name: comm.allreduce(value, MPI.MAX) for name, value in seconds.items()},
    }


def fastest(work: Callable[[], object]) -> float:
    """Return the seconds of the fastest of TIMED calls."""
    return min(seconds_of(work) for _ in range(TIMED))


def seconds_of(work: Callable[[], object]) -> float:
    """Return the seconds that `work` takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


if __name__ == "__main__":
    sys.exit(run_main(MPI.COMM_WORLD, main))
