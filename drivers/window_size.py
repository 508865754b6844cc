"""Windows of a square array of fibres: bounds by displacements and by tractions on the sides, against their size.

    mpirun -n 2 .venv/bin/python drivers/window_size.py --out results/window_size

Both bounds approach the stiffness of the periodic cell as (width of the layer at the sides) / (width of the window).
The meshes, made by gmsh, need not match on opposite sides.
"""

import argparse
import sys
from itertools import product
from pathlib import Path
from typing import Any

import gmsh
from figures import EQUATION_38, INK, computed
from matplotlib.figure import Figure
from mpi4py.MPI import Intracomm

from feti_homog import Case, launch

WORDS = {"displacement": "u = E x on the sides", "periodic": "periodic cell", "traction": "t = Sigma n on the sides"}


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Print C11 and C33 of each window, and draw them."""
    table = dict[tuple[str, int], Any]()
    if comm.rank == 0:
        given.out.mkdir(parents=True, exist_ok=True)
        print(f"{'fibres':>6}{'boundary':>14}{'C11':>10}{'C33':>10}")
    for n, boundary in product(given.sizes, ("traction", "displacement")):
        mesh = given.out / f"window_{n}.msh"
        if comm.rank == 0 and boundary == "traction":
            write(mesh, n, given.radius, given.mesh_size)
        comm.barrier()
        cell = {"geometry": "mesh", "file": str(mesh.resolve()), "boundary": boundary}
        table[boundary, n] = solved(given, comm, cell, f"{boundary}_{n}")
    fraction, size = 3.141592653589793 * given.radius**2, min(0.5, given.mesh_size)
    cell = {"geometry": "square", "fibre_fraction": fraction, "mesh_size": size}
    table["periodic", 0] = solved(given, comm, cell, "periodic")
    if comm.rank == 0:
        for (boundary, n), C in table.items():
            print(f"{n * n or '':>6}{boundary:>14}{C[0, 0]:10.4f}{C[2, 2]:10.4f}", flush=True)
        draw(given.out / "window_size.png", given.sizes, table)


def solved(given: argparse.Namespace, comm: Intracomm, cell: dict[str, Any], name: str) -> Any:
    """Return the apparent stiffness of a cell.  Collective."""
    document = {
        "cell": cell | {"order": 2},
        "material": EQUATION_38 | {"fibre": {"young": given.young, "poisson": 0.222}},
        "analysis": {"type": "stiffness", "plane": "strain"},
        "output": {"fields": given.fields, "pictures": given.pictures},
    }
    return computed(comm, Case.parse(document), given.out / name).effective_stiffness


def write(path: Path, n: int, radius: float, size: float) -> None:
    """Write the mesh of a window of n x n squares, with a fibre in the middle of each."""
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        window = [(2, occ.addRectangle(0, 0, 0, n, n))]
        fibres = [(2, occ.addDisk(i + 0.5, j + 0.5, 0, radius, radius)) for i, j in product(range(n), range(n))]
        matrix, _ = occ.cut(window, fibres, removeTool=False)
        occ.fragment(matrix, fibres)
        occ.synchronize()
        for name, surfaces in (("matrix", matrix), ("fibre", fibres)):
            gmsh.model.addPhysicalGroup(2, [tag for _, tag in surfaces], name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def draw(path: Path, sizes: list[int], table: dict[tuple[str, int], Any]) -> None:
    """Draw C11 and C33 of the windows over the fibres along a side, and of the periodic cell."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    for axes, (k, name) in zip(figure.subplots(1, 2), ((0, "C11"), (2, "C33")), strict=True):
        for style, boundary in zip(("^-", "v-"), ("displacement", "traction"), strict=True):
            values = [table[boundary, n][k, k] for n in sizes]
            axes.plot(sizes, values, style, color=INK[boundary == "traction"], label=WORDS[boundary])
        axes.axhline(table["periodic", 0][k, k], color="0.4", linestyle=":", label=WORDS["periodic"])
        axes.set(xlabel="fibres along a side of the window", ylabel=f"{name} (GPa)", xscale="log")
        axes.set_xticks(sizes, list(map(str, sizes)))
        axes.minorticks_off()
    axes.legend(frameon=False)
    figure.savefig(path)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("results/window_size"), metavar="DIR")
    parser.add_argument("--sizes", type=int, nargs="+", default=[1, 2, 3, 4, 6, 8], help="fibres along a side")
    parser.add_argument("--radius", type=float, default=0.4, help="of the fibres / their pitch")
    parser.add_argument("--young", type=float, default=2000.0, help="of the fibres (GPa); of the matrix 88")
    parser.add_argument("--mesh-size", type=float, default=0.15, help="of the elements / pitch of the fibres")
    parser.add_argument("--fields", action="store_true", help="write fields for ParaView and verify")
    parser.add_argument("--pictures", action="store_true", help="draw pictures of every case")
    return parser


if __name__ == "__main__":
    sys.exit(launch(main, _parser()))
