"""Iterations of the dual problem over the refinement of the hexagonal cell, its bodies whole: they do not grow.

mpirun -n 2 .venv/bin/python drivers/iterations.py --refine 1 2 3 4 5
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from figures import EQUATION_38
from mpi4py.MPI import Intracomm

from feti_homog.cli import Parser, launch, parsed


def main(words: Sequence[str], comm: Intracomm) -> int:
    """Print degrees of freedom, multipliers, iterations of the three unit strains, and seconds of the run."""
    from feti_homog.analysis.runner import run
    from feti_homog.config.case import parse
    from feti_homog.output.files import result_json

    arguments = parsed(_parser(), words, comm)
    if comm.rank == 0:
        print(f"{'refine':>6}{'dofs':>10}{'multipliers':>13}  {'iterations':<14}{'seconds':>8}")
    for refine in arguments.refine:
        document = {
            "cell": {
                "geometry": "hexagonal", "fibre_fraction": 0.4, "bodies": arguments.bodies,
                "mesh_size": arguments.mesh_size, "refine": refine, "order": arguments.order,
            },
            "material": EQUATION_38,
            "analysis": {"type": "stiffness", "plane": "strain"},
            "decomposition": {"subdomains": 1},
            "output": {"fields": False, "pictures": False},
            "petsc": {"feti_ksp_rtol": 1e-10},
        }  # fmt: skip
        start = time.perf_counter()
        run(parse(document, Path()), arguments.out / f"refine_{refine}", comm, quiet=True)
        seconds = time.perf_counter() - start
        if comm.rank == 0:
            solver = result_json.read(arguments.out / f"refine_{refine}")["solver"]
            counts = ", ".join(map(str, solver["iterations"]))
            print(f"{refine:>6}{solver['dofs']:>10}{solver['multipliers']:>13}  {counts:<14}{seconds:8.1f}", flush=True)
    return 0


def _parser() -> Parser:
    parser = Parser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/iterations"), metavar="DIR")
    parser.add_argument("--mesh-size", type=float, default=0.062, help="coarse element size / cell width")
    parser.add_argument("--refine", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--order", type=int, choices=(1, 2), default=1)
    parser.add_argument("--bodies", choices=("torus", "plane"), default="torus")
    return parser


if __name__ == "__main__":
    sys.exit(launch(main))
