"""Iterations to 1e-8 at every combination of fibres, fibre fraction, gap, cut of the matrix, contrast and mesh size.

Each line of the CSV is one cell with its three load cases; cells that the file holds already are not run again, so that
a long list can be worked off in parts.  "uncut" leaves the matrix whole and looks for soft modes none the less.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from dataclasses import asdict, dataclass, fields
from itertools import product
from pathlib import Path

import petsc4py

petsc4py.init(sys.argv[:1])

import numpy as np  # noqa: E402
from mpi4py import MPI  # noqa: E402
from petsc4py import PETSc  # noqa: E402

from feti_homog.common.petsc_options import case_options  # noqa: E402
from feti_homog.common.progress import Progress  # noqa: E402
from feti_homog.config import case as cases  # noqa: E402
from feti_homog.config.case import Case  # noqa: E402
from feti_homog.homogenization.unit_cell import tear  # noqa: E402

# Coarse elements along the side of a cell with one fibre.
ELEMENTS = 5


@dataclass(frozen=True)
class Cell:
    """One combination; `pieces` of the matrix per fibre, `gap` in fibre diameters."""

    fibres: int
    fraction: float
    gap: float
    pieces: int
    contrast: float
    refine: int

    @property
    def possible(self) -> bool:
        """Whether such a packing exists."""
        return not (self.fraction >= 0.65 and self.gap > 0.1)

    def case(self, space: str) -> Case:
        """The case, with that kind of coarse space."""
        return cases.parse(
            {
                "cell": {
                    "geometry": "random", "fibres": self.fibres, "fibre_fraction": self.fraction, "min_gap": self.gap,
                    "mesh_size": 1 / (ELEMENTS * self.fibres**0.5), "refine": self.refine,
                },
                "material": {
                    "matrix": {"young": 3.0, "poisson": 0.35},
                    "fibre": {"young": 3.0 * self.contrast, "poisson": 0.3},
                },
                "analysis": {"type": "stiffness", "plane": "strain"},
                "decomposition": {"subdomains": self.fibres * (1 + self.pieces) or 1},
                "petsc": {"feti_ksp_rtol": 1e-8, "feti_coarse_space": space},
            },
            Path(),
        )  # fmt: skip


@dataclass(frozen=True)
class Row(Cell):
    """What came of a cell: `vectors` coarse vectors per subdomain, `boundary` dofs of the largest subdomain."""

    dofs: int
    subdomains: int
    boundary: int
    vectors: float
    iterations: int
    seconds: float


def main() -> None:
    """Work off the list."""
    arguments = _parser().parse_args()
    comm = MPI.COMM_WORLD
    done = _read(arguments.out) if comm.rank == 0 else []
    done = comm.bcast(done)
    grid = [
        Cell(*values)
        for values in product(
            arguments.fibres, arguments.fractions, arguments.gaps, arguments.pieces, arguments.contrasts,
            arguments.refine,
        )
    ]  # fmt: skip
    known = {tuple(asdict(row)[f.name] for f in fields(Cell)) for row in done}
    wanted = [cell for cell in grid if cell.possible and tuple(asdict(cell).values()) not in known]
    if comm.rank == 0:
        print(f"{len(grid)} combinations, {len(done)} done, {len(wanted)} to do")
        print("fibres fraction   gap pieces contrast refine     dofs subdom. boundary vectors iterations seconds")
    for cell in wanted:
        row = measure(cell, arguments.space, comm)
        done.append(row)
        if comm.rank == 0:
            print(
                f"{row.fibres:6}{row.fraction:9.2f}{row.gap:6.2f}{row.pieces:7}{row.contrast:9.0e}{row.refine:7}"
                f"{row.dofs:9}{row.subdomains:8}{row.boundary:9}{row.vectors:8.2f}{row.iterations:11}{row.seconds:8.1f}",
                flush=True,
            )
            _write(arguments.out, done)
    if comm.rank == 0 and done:
        iterations, vectors = (np.array([getattr(row, name) for row in done]) for name in ("iterations", "vectors"))
        print(
            f"{len(done)} cells: {iterations.min()} to {iterations.max()} iterations, {np.mean(iterations <= 25):.1%} "
            f"within 25; {vectors.mean():.2f} coarse vectors a subdomain, at most {vectors.max():.2f}"
        )


def measure(cell: Cell, space: str, comm: MPI.Intracomm) -> Row:
    """Tear and solve one cell."""
    start = time.perf_counter()
    case = cell.case(space)
    with case_options(case.petsc):
        torn = tear(case, comm, Progress(comm, quiet=True))
        solver = torn.solver
        solutions = solver.solve_together(np.eye(3), np.zeros((solver.rows, 3)))
    boundary = comm.allreduce(max((len(d) for d in solver.boundary.dofs), default=0), MPI.MAX)
    dofs = torn.sum_over_ranks(len(solver.Q))
    iterations = solutions[0].iterations if solutions[0].reason > 0 else 9999
    seconds = time.perf_counter() - start
    vectors = solver.coarse.vectors / torn.summary.subdomains
    solver.destroy()
    PETSc.garbage_cleanup(comm)
    return Row(**asdict(cell), dofs=dofs, subdomains=torn.summary.subdomains, boundary=boundary, vectors=vectors,
               iterations=iterations, seconds=seconds)  # fmt: skip


def _read(path: Path) -> list[Row]:
    if not path.exists():
        return []
    kinds = {"fraction": float, "gap": float, "contrast": float, "vectors": float, "seconds": float}
    with path.open(newline="") as stream:
        return [Row(**{k: kinds.get(k, int)(v) for k, v in line.items()}) for line in csv.DictReader(stream)]


def _write(path: Path, rows: list[Row]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, [f.name for f in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fibres", type=int, nargs="+", default=[16, 64, 256])
    parser.add_argument("--fractions", type=float, nargs="+", default=[0.3, 0.5, 0.65])
    parser.add_argument("--gaps", type=float, nargs="+", default=[0.2, 0.06, 0.02])
    parser.add_argument("--pieces", type=int, nargs="+", default=[0, 1, 4], help="per fibre, 0: matrix uncut")
    parser.add_argument("--contrasts", type=float, nargs="+", default=[1e-3, 2.0, 1e3, 1e6])
    parser.add_argument("--refine", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--space", choices=("natural", "adaptive"), default="adaptive")
    parser.add_argument("--out", type=Path, default=Path("results/robustness.csv"), metavar="FILE.csv")
    return parser


if __name__ == "__main__":
    main()
