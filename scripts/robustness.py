"""Iterations to 1e-8 at every combination of fibres, fraction, gap, cut, contrast, mesh, coating, mix, voids and nu.

Each line of the CSV is one cell with three load cases.  Cells that the file already has are not run again, so that a
long list can be worked off in parts. "uncut" leaves the matrix whole but still looks for soft modes.
"""

import argparse
import csv
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from itertools import product
from pathlib import Path
from typing import Any

import petsc4py

petsc4py.init(sys.argv[:1])

import numpy as np  # noqa: E402
from mpi4py import MPI  # noqa: E402
from petsc4py import PETSc  # noqa: E402

from feti_homog.case import cases  # noqa: E402
from feti_homog.case.cases import Case  # noqa: E402
from feti_homog.feti.thresholds import DEFAULTS, Thresholds  # noqa: E402
from feti_homog.homogenization.unit_cell import tear  # noqa: E402
from feti_homog.system.petsc.options_database import case_options  # noqa: E402
from feti_homog.system.runtime.progress_bar import Progress  # noqa: E402

# Columns that are no whole numbers.
REAL = (
    "fraction",
    "gap",
    "contrast",
    "coating",
    "coating_contrast",
    "mix",
    "mix_contrast",
    "voids",
    "poisson",
    "vectors",
    "seconds",
)
HEADING = (
    "fibres fraction   gap pieces contrast refine coating contrast   mix contrast voids   poisson"
    "     dofs subdom. boundary vectors iterations s"
)
# Coarse elements along the side of a cell with one fibre.
ELEMENTS = 5
# Of cells with voids.
POROSITY = 0.05


@dataclass(frozen=True)
class Cell:
    """One combination of parameters.

    `pieces` of the matrix per fibre; `gap` in fibre diameters; `coating` thickness / radius, 0 for none;
    `coating_contrast` is coating stiffness / matrix stiffness.  `mix` is the radius of second-phase fibres / radius of
    the others, 0 for none; the second phase has half the fraction and the contrast `mix_contrast`.  `voids` is the
    radius of voids / fibre radius, 0 for none; their fraction is POROSITY. `poisson` belongs to the matrix; a nearly
    incompressible matrix has quadratic elements.
    """

    fibres: int
    fraction: float
    gap: float
    pieces: int
    contrast: float
    refine: int
    coating: float = 0.0
    coating_contrast: float = 1.0
    mix: float = 0.0
    mix_contrast: float = 1.0
    voids: float = 0.0
    poisson: float = 0.35

    @property
    def possible(self) -> bool:
        """Whether such a packing exists."""
        return not (self.fraction >= 0.65 and self.gap > 0.1)

    def case(self, space: str) -> Case:
        """Return the case with a kind of coarse space.

        With coatings the program chooses the coarse space and the cut.
        """
        coating = {"coating": {"young": 3.0 * self.coating_contrast, "poisson": 0.3}} if self.coating else {}
        other = {"other": {"young": 3.0 * self.mix_contrast, "poisson": 0.3}} if self.mix else {}
        return cases.parse(
            {
                "cell": {
                    "geometry": "random", "fibres": self.fibres, "min_gap": self.gap, **self._fractions(),
                    "mesh_size": 1 / (ELEMENTS * self.fibres**0.5), "refine": self.refine,
                    **({"coating": self.coating} if self.coating else {}),
                    **({"voids": POROSITY, "void_radius": self.voids} if self.voids else {}),
                },
                "material": {
                    "matrix": {"young": 3.0, "poisson": self.poisson},
                    "fibre": {"young": 3.0 * self.contrast, "poisson": 0.3},
                    **coating,
                    **other,
                },
                "analysis": {"type": "stiffness", "plane": "strain"},
                "decomposition": {} if self.coating else {"subdomains": self.fibres * (1 + self.pieces) or 1},
                "petsc": {"feti_ksp_rtol": 1e-8, "feti_coarse_space": "auto" if self.coating else space},
            },
            Path(),
        )  # fmt: skip

    def _fractions(self) -> dict[str, Any]:
        """Return the keys of the fibres' fractions and radii."""
        if not self.mix:
            return {"fibre_fraction": self.fraction}
        half = self.fraction / 2
        return {"mix": {"fibre": half, "other": half}, "radii": {"fibre": 1.0, "other": self.mix}}


@dataclass(frozen=True, kw_only=True)
class Row(Cell):
    """Outcome of a cell: `vectors` are coarse vectors per subdomain, `boundary` the dofs of the largest boundary."""

    dofs: int
    subdomains: int
    boundary: int
    vectors: float
    iterations: int
    seconds: float

    @property
    def cell(self) -> Cell:
        """The combination of parameters alone."""
        return Cell(*(getattr(self, f.name) for f in fields(Cell)))

    def line(self) -> str:
        """Return the line of the table."""
        return (
            f"{self.fibres:6}{self.fraction:9.2f}{self.gap:6.2f}{self.pieces:7}{self.contrast:9.0e}{self.refine:7}"
            f"{self.coating:8.2g}{self.coating_contrast:9.0e}{self.mix:6.2g}{self.mix_contrast:9.0e}{self.voids:6.2g}{self.poisson:10.9g}"
            f"{self.dofs:9}{self.subdomains:8}{self.boundary:9}{self.vectors:8.2f}{self.iterations:11}{self.seconds:6.1f}"
        )


def main() -> None:
    """Run all cells of the list."""
    arguments = _parser().parse_args()
    comm = MPI.COMM_WORLD
    show = print if comm.rank == 0 else _silent
    done: list[Row] = comm.bcast(_read(arguments.out) if comm.rank == 0 else [])
    grid = combinations(arguments)
    known = {row.cell for row in done}
    wanted = [cell for cell in grid if cell.possible and cell not in known]
    show(f"{len(grid)} combinations, {len(done)} done, {len(wanted)} to do")
    show(HEADING)
    for cell in wanted:
        done.append(measure(cell, arguments.space, comm))
        show(done[-1].line(), flush=True)
        if comm.rank == 0:
            _write(arguments.out, done)
    if done:
        show(summary(done))


def _silent(*_: object, **__: object) -> None:
    """Print nothing."""


def combinations(arguments: argparse.Namespace) -> list[Cell]:
    """Return all cells from the lists of the command line."""
    a = arguments
    bare = a.fibres, a.fractions, a.gaps, a.pieces, a.contrasts, a.refine
    coats = [(0.0, 1.0)] if a.coatings is None else list(product(a.coatings, a.coating_contrasts))
    mixes = [(0.0, 1.0)] if a.mix is None else list(product(a.mix, a.mix_contrasts))
    voids = [0.0] if a.voids is None else a.voids
    others = list(product(coats, mixes, voids, a.poisson))
    return [Cell(*of, *coat, *mix, v, poisson) for of in product(*bare) for coat, mix, v, poisson in others]


def summary(rows: list[Row]) -> str:
    """Return the range of iterations and of coarse vectors."""
    iterations, vectors = (np.array([getattr(row, name) for row in rows]) for name in ("iterations", "vectors"))
    return (
        f"{len(rows)} cells: {iterations.min()} to {iterations.max()} iterations, {np.mean(iterations <= 25):.1%} "
        f"within 25; {vectors.mean():.2f} coarse vectors a subdomain, at most {vectors.max():.2f}"
    )


def measure(cell: Cell, space: str, comm: MPI.Intracomm, thresholds: Thresholds = DEFAULTS) -> Row:
    """Tear and solve one cell.  Collective."""
    start = time.perf_counter()
    case = cell.case(space)
    with case_options(case.petsc):
        torn = tear(case, comm, Progress(comm, quiet=True), thresholds)
        solver = torn.solver
        solutions = solver.solve_many(np.eye(3), np.zeros((solver.rows, 3)))
    boundary = comm.allreduce(max((len(d) for d in solver.interface_operators.dofs), default=0), MPI.MAX)
    dofs = torn.comm.allreduce(sum(s.n_dofs for s in solver.subdomains))
    iterations = solutions[0].iterations if solutions[0].reason > 0 else 9999
    seconds = time.perf_counter() - start
    vectors = solver.coarse_dimension / torn.summary.subdomains
    solver.destroy()
    PETSc.garbage_cleanup(comm)
    return Row(**asdict(cell), dofs=dofs, subdomains=torn.summary.subdomains, boundary=boundary, vectors=vectors,
               iterations=iterations, seconds=seconds)  # fmt: skip


def _read(path: Path) -> list[Row]:
    if not path.exists():
        return []
    kinds: dict[str, Callable[[str], Any]] = dict.fromkeys(REAL, float)
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
    parser.add_argument("--coatings", type=float, nargs="+", help="thickness / radius; by default none")
    parser.add_argument("--coating-contrasts", type=float, nargs="+", default=[1e-3, 1.0, 1e3], help="of the matrix")
    parser.add_argument("--mix", type=float, nargs="+", help="radius of fibres of a second phase / of the others")
    parser.add_argument("--mix-contrasts", type=float, nargs="+", default=[1e-3, 1.0, 1e3], help="of the matrix")
    parser.add_argument("--voids", type=float, nargs="+", help="radius of voids / of the fibres")
    parser.add_argument("--poisson", type=float, nargs="+", default=[0.35], help="ratio of the matrix")
    parser.add_argument("--space", choices=("natural", "adaptive"), default="adaptive")
    parser.add_argument("--out", type=Path, default=Path("results/robustness.csv"), metavar="FILE.csv")
    return parser


if __name__ == "__main__":
    main()
