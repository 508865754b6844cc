"""Cost of an accurate L^ef: this program on one rank against a monolithic direct solve of the same mesh.

The table lists, for each error, the coarsest mesh of a ladder that reaches the error, with linear and with quadratic
elements.  Meshing, refinement and element assembly are common to both solvers and timed apart ("mesh"). "FETI" is
factorization, preconditioner and three load cases; "direct" is the periodic gluing, one factorization by CHOLMOD
through PETSc and three solves.  The best of several repetitions counts.
"""

import argparse
import csv
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from itertools import product
from pathlib import Path

import numpy as np
import petsc4py

petsc4py.init(sys.argv[:1])

from composite import STIFFNESS  # noqa: E402
from monolithic import glued  # noqa: E402
from mpi4py import MPI  # noqa: E402
from petsc4py import PETSc  # noqa: E402

from feti_homog.analysis import stiffness  # noqa: E402
from feti_homog.analysis.context import AnalysisContext  # noqa: E402
from feti_homog.case import cases  # noqa: E402
from feti_homog.feti.linalg.sparse_direct import DirectSolver  # noqa: E402
from feti_homog.homogenization.unit_cell import TornCell, tear  # noqa: E402
from feti_homog.system.petsc.options_database import case_options  # noqa: E402
from feti_homog.system.runtime.standard_streams import Progress  # noqa: E402

# C11, C12, C33 in plane strain at a fibre fraction of 0.4: Fourier solutions whose truncations agree to 2e-9.
REFERENCE = {"square": (151.155859, 55.537426, 45.078553), "hexagonal": (149.690255, 56.975975, 46.357140)}
SIZES = (0.25, 0.2, 0.16, 0.13, 0.1)  # coarse element sizes of the ladder, with refinements each


@dataclass(frozen=True)
class Row:
    """A line of the table; times in seconds."""

    target: float
    order: int
    mesh_size: float
    refine: int
    dofs: int
    error: float
    mesh: float
    feti: float
    direct: float
    ratio: float
    difference: float


def main() -> None:
    """Print the table and write it as CSV."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--geometry", choices=REFERENCE, default="hexagonal")
    parser.add_argument("--errors", type=float, nargs="+", default=[1e-3, 1e-4, 1e-5])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--out", type=Path, default=Path("results/accuracy.csv"), metavar="FILE.csv")
    arguments = parser.parse_args()
    if MPI.COMM_WORLD.size > 1:
        parser.error("the peer is sequential: start this on one rank")
    measure(arguments.geometry, 1, 0.25, 0)  # whatever is loaded or made at first use
    print("error <= order     h refine    dofs    error  mesh s  FETI s direct s  ratio")
    rows = []
    for order in (1, 2):
        for target in arguments.errors:
            rows.append(row(arguments.geometry, order, target, arguments.repeat))
            r = rows[-1]
            print(
                f"{r.target:8.0e}{r.order:6}{r.mesh_size:6.2f}{r.refine:7}{r.dofs:8}{r.error:9.1e}"
                f"{r.mesh:8.3f}{r.feti:8.3f}{r.direct:9.3f}{r.ratio:7.2f}",
                flush=True,
            )
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    with arguments.out.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, [field.name for field in fields(Row)])
        writer.writeheader()
        writer.writerows(map(asdict, rows))
    agreement = max(r.difference for r in rows)
    print(f"ratio = (mesh + FETI) / (mesh + direct); the two agree to {agreement:.0e}; {arguments.out}")


def ladder() -> Iterator[tuple[float, int]]:
    """Return mesh sizes and refinements, the coarsest meshes first."""
    return iter(sorted(product(SIZES, range(7)), key=lambda rung: 4 ** rung[1] / rung[0] ** 2))


def row(geometry: str, order: int, target: float, repeat: int) -> Row:
    """Return the coarsest mesh whose error is at most `target`, timed."""
    for mesh_size, refine in ladder():
        error = measure(geometry, order, mesh_size, refine)[1]
        if error <= target:
            break
    results = [measure(geometry, order, mesh_size, refine) for _ in range(repeat)]
    dofs, error, difference = results[0][0], results[0][1], results[0][2]
    mesh, feti, direct = np.min([times for _, _, _, times in results], axis=0)
    ratio = (mesh + feti) / (mesh + direct)
    return Row(target, order, mesh_size, refine, dofs, error, mesh, feti, direct, ratio, difference)


def measure(geometry: str, order: int, mesh_size: float, refine: int) -> tuple[int, float, float, tuple[float, ...]]:
    """Return dofs, error of L^ef, difference from the direct solve, and seconds of mesh, FETI, direct solve."""
    comm = MPI.COMM_WORLD
    cell = {"geometry": geometry, "fibre_fraction": 0.4, "mesh_size": mesh_size, "refine": refine, "order": order}
    case = cases.parse({"cell": cell} | STIFFNESS, Path())
    progress = Progress(comm, quiet=True)
    with case_options(case.petsc):
        start = time.perf_counter()
        cell = tear(case, comm, progress)
        context = AnalysisContext.of(cell, progress)
        L = np.asarray(stiffness.run(context)["effective_stiffness"])
        feti = time.perf_counter() - start
    mesh = progress.seconds["mesh"] + progress.seconds["assemble"]
    direct, peer, dofs = direct_solve(cell)
    cell.solver.destroy()
    PETSc.garbage_cleanup(comm)
    c11, c12, c33 = REFERENCE[geometry]
    exact = np.array([[c11, c12, 0], [c12, c11, 0], [0, 0, c33]])
    error = float((np.abs(L - exact) / np.where(exact > 0, exact, c11)).max())
    difference = float(np.abs(L - peer).max() / c11)
    return dofs, error, difference, (mesh, feti - mesh, direct)


def direct_solve(cell: TornCell) -> tuple[float, np.ndarray, int]:
    """Return seconds, L^ef and degrees of freedom of the direct solve."""
    start = time.perf_counter()
    K, Q = glued(cell)
    solver = DirectSolver(K, "mono_")
    stress = sum(s.area * s.L for s in cell.subdomains)
    L = (stress - Q.T @ solver.solve(Q)) / cell.summary.area
    return time.perf_counter() - start, L, K.shape[0]


if __name__ == "__main__":
    main()
