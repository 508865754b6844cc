"""Cost and gain of values of one of the solver's thresholds (feti_homog/feti/thresholds.py), on hard cells.

    mpirun -n 2 .venv/bin/python scripts/measure_thresholds.py min_trace_dofs 40 100 250

Each line is one value in a random cell of narrow gaps, with the matrix whole or in pieces and stiff or soft fibres.  It
gives coarse vectors per subdomain, iterations of three load cases to 1e-8, and seconds of meshing, set-up and solve.
For the figures in `thresholds.py`, with --contrasts 2: `soft_mode` --fibres 16 --refine 1 --pieces 1; `min_trace_dofs`
the same with --refine 2; the others --fibres 36 --refine 1 --pieces 0.
"""

import argparse
import sys
from dataclasses import fields, replace
from itertools import product

import petsc4py

petsc4py.init(sys.argv[:1])

from mpi4py import MPI  # noqa: E402
from robustness import Cell, measure  # noqa: E402

from feti_homog.feti.thresholds import DEFAULTS, Thresholds  # noqa: E402


def main() -> None:
    """Measure every value on every cell."""
    arguments = _parser().parse_args()
    comm = MPI.COMM_WORLD
    if comm.rank == 0:
        print(f"pieces contrast refine    dofs  boundary  {arguments.name:>20}  vectors iterations seconds")
    for pieces, contrast in product(arguments.pieces, arguments.contrasts):
        cell = Cell(arguments.fibres, arguments.fraction, arguments.gap, pieces, contrast, arguments.refine)
        for value in arguments.values:
            row = measure(cell, "adaptive", comm, with_value(arguments.name, value))
            if comm.rank == 0:
                print(
                    f"{pieces:6}{contrast:9.0e}{row.refine:7}{row.dofs:8}{row.boundary:10}  {value:20g}"
                    f"{row.vectors:9.2f}{row.iterations:11}{row.seconds:8.2f}",
                    flush=True,
                )


def with_value(name: str, value: float) -> Thresholds:
    """Return the default thresholds with one value replaced."""
    return replace(DEFAULTS, **{name: type(getattr(DEFAULTS, name))(value)})


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=[f.name for f in fields(Thresholds)])
    parser.add_argument("values", type=float, nargs="+")
    parser.add_argument("--fibres", type=int, default=64)
    parser.add_argument("--fraction", type=float, default=0.65)
    parser.add_argument("--gap", type=float, default=0.01, help="in fibre diameters")
    parser.add_argument("--pieces", type=int, nargs="+", default=[0, 1, 4], help="of the matrix per fibre, 0: whole")
    parser.add_argument("--contrasts", type=float, nargs="+", default=[2.0, 1e3])
    parser.add_argument("--refine", type=int, default=2)
    return parser


if __name__ == "__main__":
    main()
