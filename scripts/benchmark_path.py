"""Time of a debonding event against a monolithic factor-and-solve of the same mesh, on one rank.

The hexagonal cell of the paper debonds under E = [0.2, 0, 0] in plane stress.  An event is all work from one break to
the next: contact states, projected Krylov solves, coarse factorizations, stresses.
"""

import argparse
import sys
import time
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import petsc4py

petsc4py.init(sys.argv[:1])

from composite import MATERIAL  # noqa: E402
from monolithic import factor_and_solve, glued  # noqa: E402
from mpi4py import MPI  # noqa: E402

from feti_homog.case import cases  # noqa: E402
from feti_homog.homogenization.averaging import Homogenization  # noqa: E402
from feti_homog.homogenization.unit_cell import TornCell, tear  # noqa: E402
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces  # noqa: E402
from feti_homog.interface.contact.states import BONDED, BondState  # noqa: E402
from feti_homog.interface.laws.strength import MaxStrength  # noqa: E402
from feti_homog.interface.loads import Load  # noqa: E402
from feti_homog.interface.path.path_following import events  # noqa: E402
from feti_homog.interface.path.path_points import unloaded  # noqa: E402
from feti_homog.system.petsc.options_database import case_options  # noqa: E402
from feti_homog.system.runtime import process  # noqa: E402
from feti_homog.system.runtime.standard_streams import Progress  # noqa: E402

STRAIN = [0.2, 0.0, 0.0]
STRENGTH = 10.0


PEER_RUNS = 3  # the median of so many


class Measured(NamedTuple):
    """A path: the torn cell, degrees of freedom of the glued cell, and seconds.

    The seconds belong to the set-up, each event, and the peer's factorization and solve.
    """

    cell: TornCell
    stiffness: float
    glued: int
    setup: float
    events: list[float]
    iterations: list[int]
    solves: list[int]
    peer: tuple[float, float]
    memory: int

    @property
    def ratios(self) -> tuple[float, float]:
        """The peer's seconds / seconds of the mean event, and of the worst event."""
        return sum(self.peer) / float(np.mean(self.events)), sum(self.peer) / max(self.events)


class Row(NamedTuple):
    """A whole path of a table with its targets: peer / mean event, and seconds of the worst event."""

    fibres: int
    refine: int
    ratio: float
    worst: float


TABLES = {"paths": (Row(30, 1, 20.0, 0.1), Row(50, 2, 60.0, 0.3))}


def main() -> None:
    """Print a table of times and ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fibres", type=int, default=0, help="of a random cell; 0: the hexagonal cell")
    parser.add_argument("--mesh-size", type=float, default=0.0435)
    parser.add_argument("--refine", type=int, default=3)
    parser.add_argument("--events", type=int, default=50)
    parser.add_argument("--to-the-end", action="store_true", help="all events of the path")
    parser.add_argument("--operator", choices=["auto", "implicit", "explicit"], default="auto")
    parser.add_argument("--cpu", action="store_true", help="processor time, for machines with other work")
    parser.add_argument("--table", choices=list(TABLES), help="whole paths beside what is asked of them")
    parser.add_argument("--repeat", type=int, default=3, help="runs of each row of a table, in turns")
    arguments = parser.parse_args()
    if MPI.COMM_WORLD.size > 1:
        parser.error("the peer is sequential: start this on one rank")
    if arguments.table:
        print_table(arguments)
        return
    measured = measure(arguments)
    cell, (factor, solve), (ratio, worst) = measured.cell, measured.peer, measured.ratios
    peer, count = factor + solve, len(measured.events)
    print(f"degrees of freedom          {sum(s.n_dofs for s in cell.subdomains)} torn, {measured.glued} glued")
    print(f"torn stiffness C11          {measured.stiffness / cell.summary.area:.6g}")
    print(f"set-up                      {measured.setup:8.2f} s, {measured.setup / peer:6.2f} of the peer")
    print(f"monolithic factor and solve {peer:8.2f} s  (factor {factor:.2f}, solve {solve:.3f})")
    print(f"an event, mean of {count:4d}      {np.mean(measured.events):8.3f} s, 1/{ratio:.1f} of the peer")
    print(f"an event, worst             {max(measured.events):8.3f} s, 1/{worst:.1f} of the peer")
    problems, iterations = np.mean(measured.solves), np.mean(measured.iterations)
    print(f"dual problems an event      {problems:8.1f}, Krylov iterations an event {iterations:.1f}")
    made, coarse = len(cell.subdomains), cell.solver.natural.factorizations
    print(f"factorizations              {made} of subdomains in all, {coarse} of the coarse problem")
    if cell.solver.exact_inverse is not None:
        print(f"reference cells factored    {cell.solver.exact_inverse.factorizations}")
    print(f"all events with set-up      {measured.setup + sum(measured.events):8.1f} s, the peer {peer * count:.1f} s")
    print(f"memory at most              {measured.memory / 2**30:8.2f} GiB, before the peer")
    cell.solver.destroy()


def print_table(arguments: argparse.Namespace) -> None:
    """Print the medians of whole paths, repeated in turns, beside their targets."""
    rows, found = TABLES[arguments.table], list[list[Measured]]()
    for _ in range(arguments.repeat):
        found.append([])
        for row in rows:
            own = {"fibres": row.fibres, "refine": row.refine, "mesh_size": 0.03, "to_the_end": True}
            found[-1].append(measure(argparse.Namespace(**vars(arguments) | own)))
            found[-1][-1].cell.solver.destroy()
    print("dofs     events  factor and solve s  mean event ms  peer / mean  asked  worst s  asked")
    for row, runs in zip(rows, zip(*found, strict=True), strict=True):
        peer, mean, ratio, worst = np.median(
            [[sum(run.peer), np.mean(run.events), run.ratios[0], max(run.events)] for run in runs], axis=0
        )
        numbers = f"{peer:20.3f}{1e3 * mean:15.1f}{ratio:13.1f}{row.ratio:7.0f}{worst:9.3f}{row.worst:7.1f}"
        print(f"{runs[0].glued:<9}{len(runs[0].events):6d}{numbers}")


def measure(arguments: argparse.Namespace) -> Measured:
    """Follow a path and factor the same cell, glued."""
    comm, clock = MPI.COMM_WORLD, time.process_time if arguments.cpu else time.perf_counter
    case = cases.parse(document(arguments), Path())
    with case_options(case.petsc):
        start = clock()
        cell = tear(case, comm, Progress(comm, quiet=bool(arguments.table)))
        homogenization = Homogenization(cell, contact=True)
        stiffness = homogenization.interface.solver.torn_stiffness
        setup = clock() - start
        count = None if arguments.to_the_end else arguments.events
        seconds, iterations, solves = run_events(homogenization, count, clock)
    memory = process.peak_memory()
    K, Q = glued(cell)
    factor, solve = np.median([factor_and_solve(K, Q[:, :1], clock) for _ in range(PEER_RUNS)], axis=0)
    peer = float(factor), float(solve)
    return Measured(cell, stiffness[0, 0], K.shape[0], setup, seconds, iterations, solves, peer, memory)


def document(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the case: bonded at first, strengths low enough that many nodes break."""
    geometry = {"geometry": "hexagonal", "fibre_fraction": 0.4}
    if arguments.fibres:
        geometry = {"geometry": "random", "fibre_fraction": 0.5, "min_gap": 0.06, "fibres": arguments.fibres}
    return {
        "cell": geometry | {"mesh_size": arguments.mesh_size, "refine": arguments.refine},
        "material": MATERIAL,
        "analysis": {"type": "path", "plane": "stress"},
        "interface": {"normal_strength": STRENGTH, "tangential_strength": STRENGTH},
        "path": {"strain": STRAIN},
        "petsc": {"feti_dual_operator": arguments.operator},
    }


def run_events(
    homogenization: Homogenization, count: int | None, clock: Callable[[], float] = time.perf_counter
) -> tuple[list[float], list[int], list[int]]:
    """Return seconds, Krylov iterations and dual problems of each of the first `count` events; None means all."""
    interface = homogenization.interface
    n = len(interface.nodes.row)
    bonds = BondState(np.full(n, BONDED, np.int8), np.zeros((n, 0)), np.zeros(n, bool))
    found = events(
        CoupledInterfaces(interface),
        MaxStrength(STRENGTH, STRENGTH),
        [Load.strain(np.array(STRAIN))],
        unloaded(CoupledInterfaces(interface), bonds),
    )
    seconds, iterations, solves = [], [], []
    start = clock()
    for point in islice(found, count):
        homogenization.interface.solver.stress_integral(point.state.solution)
        now = clock()
        seconds.append(now - start)
        iterations.append(point.state.iterations)
        solves.append(point.state.solves)
        start = now
    return seconds, iterations, solves


if __name__ == "__main__":
    main()
