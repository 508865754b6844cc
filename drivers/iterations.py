"""Iterations of the dual problem, which do not grow with the refinement of the hexagonal cell of whole bodies.

mpirun -n 2 .venv/bin/python drivers/iterations.py --refine 1 2 3 4 5
"""

import argparse
import sys
import time
from pathlib import Path

from figures import EQUATION_38, computed
from mpi4py.MPI import Intracomm

from feti_homog import Case, launch


def main(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Print degrees of freedom, multipliers, iterations of the three unit strains, and seconds of the run."""
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
            "output": {"fields": arguments.fields, "pictures": False},
            "petsc": {"feti_ksp_rtol": 1e-10},
        }  # fmt: skip
        start = time.perf_counter()
        solver = computed(comm, Case.parse(document), arguments.out / f"refine_{refine}").solver
        seconds = time.perf_counter() - start
        if comm.rank == 0:
            counts = ", ".join(map(str, solver.iterations))
            print(f"{refine:>6}{solver.dofs:>10}{solver.multipliers:>13}  {counts:<14}{seconds:8.1f}", flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/iterations"), metavar="DIR")
    parser.add_argument("--mesh-size", type=float, default=0.062, help="coarse element size / cell width")
    parser.add_argument("--refine", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--order", type=int, choices=(1, 2), default=1)
    parser.add_argument("--fields", action="store_true", help="write the fields of every case")
    parser.add_argument("--bodies", choices=("torus", "plane"), default="torus")
    return parser


if __name__ == "__main__":
    sys.exit(launch(main, _parser()))
