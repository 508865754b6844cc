"""Effective stiffness of the square and the hexagonal cell, in plane strain and plane stress, beside references.

    mpirun -n 2 .venv/bin/python drivers/effective_stiffness.py --out results/effective_stiffness

Fibres of 40 % with E = 200, nu = 0.222 in a matrix with E = 88, nu = 0.299, perfectly bonded.  Each case gets a result
folder; with --fractions, entries.png shows the stiffnesses over the fibre fraction.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from figures import ENTRY_INK, EQUATION_38, STYLE, add_output_options, computed, written
from mpi4py.MPI import Intracomm

from feti_homog import Case, launch

# C11, C12, C33 of Fourier solutions whose truncations agree to 2e-9.
REFERENCE = {
    ("square", "strain"): (151.155859, 55.537426, 45.078553),
    ("square", "stress"): (128.862996, 34.070020, 45.000421),
    ("hexagonal", "strain"): (149.690255, 56.975975, 46.357140),
    ("hexagonal", "stress"): (127.573943, 35.321585, 46.126179),
}
ENTRIES = {"C11": (0, 0), "C12": (0, 1), "C33": (2, 2)}


def main(arguments: argparse.Namespace, comm: Intracomm) -> None:
    """Run the four cases and the given fractions; print a table and draw it."""
    if comm.rank == 0:
        print(f"{'cell':<10}{'plane':<8}" + "".join(f"{name:>13}{'error':>10}" for name in ENTRIES))
    for (geometry, plane), reference in REFERENCE.items():
        L = stiffness(arguments, comm, geometry, plane, 0.4)
        if comm.rank == 0:
            values = [L[i, j] for i, j in ENTRIES.values()]
            pairs = zip(values, reference, strict=True)
            columns = "".join(f"{value:13.6f}{abs(value / exact - 1):10.1e}" for value, exact in pairs)
            print(f"{geometry:<10}{plane:<8}{columns}", flush=True)
    if arguments.fractions:
        sweep = [stiffness(arguments, comm, "hexagonal", "strain", c) for c in arguments.fractions]
        if comm.rank == 0:
            print(draw(arguments.fractions, sweep, arguments.out / "entries.png"))


def stiffness(arguments: argparse.Namespace, comm: Intracomm, geometry: str, plane: str, fraction: float) -> Any:
    """Compute L^ef (3, 3) of a cell, and write its results to a separate folder."""
    name = f"{geometry}_{plane}_{round(100 * fraction)}"
    document: dict[str, Any] = {
        "name": name,
        "cell": {
            "geometry": geometry, "fibre_fraction": fraction,
            "mesh_size": arguments.mesh_size, "refine": arguments.refine, "order": arguments.order,
        },
        "material": EQUATION_38,
        "analysis": {"type": "stiffness", "plane": plane},
        "output": written(arguments),
    }  # fmt: skip
    return computed(comm, Case.parse(document), arguments.out / name).effective_stiffness


def draw(fractions: Sequence[float], sweep: Sequence[Any], path: Path) -> Path:
    """Return the entries over the fibre fraction."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(5, 3.5), layout="constrained")
        axes = figure.subplots()
        for name, (i, j) in ENTRIES.items():
            axes.plot(fractions, [L[i, j] for L in sweep], "o-", color=ENTRY_INK[name[1:]], label=f"$C_{{{name[1:]}}}$")
        axes.set(xlabel="fibre fraction", ylabel="effective stiffness (GPa)", ylim=(0, None))
        axes.grid(color="0.92", linewidth=0.6)
        axes.set_title("hexagonal cell, plane strain")
        axes.legend(frameon=False)
        figure.savefig(path)
    return path


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/effective_stiffness"), metavar="DIR")
    parser.add_argument("--mesh-size", type=float, default=0.1, help="coarse element size / cell width")
    parser.add_argument("--refine", type=int, default=1)
    parser.add_argument("--order", type=int, choices=(1, 2), default=2)
    parser.add_argument("--fractions", type=float, nargs="*", default=[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7])
    add_output_options(parser)
    return parser


if __name__ == "__main__":
    sys.exit(launch(main, _parser()))
