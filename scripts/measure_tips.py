"""Measures the gain of grading at the tips of debonded arcs.

Prints the largest relative error of C11, C22, C12 and C33 of the square cell over the degrees of freedom, on one rank.
The cell has an arc of 120 degrees whose faces may overlap.

    .venv/bin/python scripts/measure_tips.py

Once with elements of one size, once with the default of `[cell] tip_size`.
"""

import numpy as np
from composite import STIFFNESS
from mpi4py import MPI

from feti_homog import Case, run

CELL = {"geometry": "square", "fibre_fraction": 0.4}
ARC = {"contact": False, "debonded": [{"fibre": "all", "angle": 120.0}]}
# Of mesh_size 0.02, tip_size 1e-6, order 2 and refine 2, extrapolated; good to 1e-6.
REFERENCE = np.array([72.54333, 128.34813, 29.25731, 28.88186])
MESHES = [(1, size, refine) for size in (0.1, 0.05) for refine in range(4)]
MESHES += [(2, size, refine) for size in (0.1, 0.07, 0.05) for refine in range(3)]


def main() -> None:
    """Print one row per mesh."""
    print("| order | mesh_size | refine | dofs, one size | error | dofs, graded | error |")
    print("|---|---|---|---|---|---|---|")
    for order, size, refine in MESHES:
        words = [
            f"{dofs} | {error:.1e}" for dofs, error in (measured(order, size, refine, tip) for tip in (size, None))
        ]
        print(f"| {order} | {size} | {refine} | {' | '.join(words)} |", flush=True)


def measured(order: int, size: float, refine: int, tip: float | None) -> tuple[int, float]:
    """Return degrees of freedom and error of one mesh; a `tip` of None is the default."""
    mesh = {"order": order, "mesh_size": size, "refine": refine} | ({} if tip is None else {"tip_size": tip})
    result = run(Case.parse(STIFFNESS | {"cell": CELL | mesh, "interface": ARC}), MPI.COMM_SELF)
    L = result.effective_stiffness
    assert L is not None
    found = np.array([L[0, 0], L[1, 1], L[0, 1], L[2, 2]])
    return result.solver.dofs, float(np.abs(found / REFERENCE - 1).max())


if __name__ == "__main__":
    main()
