"""Time of a debonding event against a monolithic factor-and-solve of the same mesh, on one rank.

The hexagonal cell of the paper debonds under E = [0.2, 0, 0] in plane stress.  An event is all that it takes to go
from one break to the next: contact states, projected Krylov solves, coarse factorizations, stresses.
"""

from __future__ import annotations

import argparse
import sys
import time
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import petsc4py

petsc4py.init(sys.argv[:1])

from composite import MATERIAL  # noqa: E402
from monolithic import factor_and_solve, glued  # noqa: E402
from mpi4py import MPI  # noqa: E402

from feti_homog.case import case as cases  # noqa: E402
from feti_homog.homogenization.averaging import Homogenization  # noqa: E402
from feti_homog.homogenization.unit_cell import tear  # noqa: E402
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces  # noqa: E402
from feti_homog.interface.contact.states import BONDED, BondState  # noqa: E402
from feti_homog.interface.laws.strength import MaxStrength  # noqa: E402
from feti_homog.interface.loads.load import Load  # noqa: E402
from feti_homog.interface.path.path_following import events  # noqa: E402
from feti_homog.interface.path.path_points import unloaded  # noqa: E402
from feti_homog.petsc.options import case_options  # noqa: E402
from feti_homog.runtime import process_memory  # noqa: E402
from feti_homog.runtime.progress import Progress  # noqa: E402

STRAIN = [0.2, 0.0, 0.0]
STRENGTH = 10.0


def main() -> None:
    """Print a table of times and ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fibres", type=int, default=0, help="of a random cell; 0: the hexagonal cell")
    parser.add_argument("--mesh-size", type=float, default=0.0435)
    parser.add_argument("--refine", type=int, default=3)
    parser.add_argument("--events", type=int, default=50)
    parser.add_argument("--to-the-end", action="store_true", help="all events of the path")
    parser.add_argument("--operator", choices=["auto", "implicit", "explicit"], default="auto")
    arguments = parser.parse_args()
    comm = MPI.COMM_WORLD
    if comm.size > 1:
        parser.error("the peer is sequential: start this on one rank")
    case = cases.parse(document(arguments), Path())
    with case_options(case.petsc):
        start = time.perf_counter()
        cell = tear(case, comm, Progress(comm, quiet=False))
        homogenization = Homogenization(cell, contact=True)
        stiffness = homogenization.interface.solver.torn_stiffness
        setup = time.perf_counter() - start
        seconds, iterations, solves = run_events(homogenization, None if arguments.to_the_end else arguments.events)
    peak = process_memory.peak()
    K, Q = glued(cell)
    factor, solve = factor_and_solve(K, Q[:, :1])
    peer = factor + solve
    mean = float(np.mean(seconds))
    print(f"degrees of freedom          {len(cell.solver.Q)} torn, {K.shape[0]} glued")
    print(f"torn stiffness C11          {stiffness[0, 0] / cell.summary.area:.6g}")
    print(f"set-up                      {setup:8.2f} s, {setup / peer:6.2f} of the peer")
    print(f"monolithic factor and solve {peer:8.2f} s  (factor {factor:.2f}, solve {solve:.3f})")
    print(f"an event, mean of {len(seconds):4d}      {mean:8.3f} s, 1/{peer / mean:.1f} of the peer")
    print(f"an event, worst             {max(seconds):8.3f} s, 1/{peer / max(seconds):.1f} of the peer")
    print(f"dual problems an event      {np.mean(solves):8.1f}, Krylov iterations an event {np.mean(iterations):.1f}")
    made, coarse = len(cell.subdomains), cell.solver.natural.factorizations
    print(f"factorizations              {made} of subdomains in all, {coarse} of the coarse problem")
    if cell.solver.exact_inverse is not None:
        print(f"reference cells factored    {cell.solver.exact_inverse.factorizations}")
    print(f"all events with set-up      {setup + sum(seconds):8.1f} s, the peer {peer * len(seconds):.1f} s")
    print(f"memory at most              {peak / 2**30:8.2f} GiB, before the peer")
    cell.solver.destroy()


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


def run_events(homogenization: Homogenization, count: int | None) -> tuple[list[float], list[int], list[int]]:
    """Seconds, Krylov iterations and dual problems of each of the first `count` events, of all if None."""
    interface = homogenization.interface
    bonded = np.full(len(interface.nodes.row), BONDED, np.int8)
    found = events(
        CoupledInterfaces(interface),
        MaxStrength(STRENGTH, STRENGTH),
        [Load.strain(np.array(STRAIN))],
        unloaded(CoupledInterfaces(interface), BondState.without_memory(bonded)),
    )
    seconds, iterations, solves = [], [], []
    start = time.perf_counter()
    for point in islice(found, count):
        homogenization.interface.solver.stress_integral(point.state.solution)
        now = time.perf_counter()
        seconds.append(now - start)
        iterations.append(point.state.iterations)
        solves.append(point.state.solves)
        start = now
    return seconds, iterations, solves


if __name__ == "__main__":
    main()
