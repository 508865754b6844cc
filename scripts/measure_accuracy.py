"""Measures the constants by which `[cell] accuracy` chooses the mesh, on one rank.

    .venv/bin/python scripts/measure_accuracy.py

Prints, for each cell and each refinement of its coarsest mesh, the largest relative error of the strain energy and, in
brackets, this error / the estimate of `feti_homog.case.cell_sizes`, which should be at most about 2/3. Quadratic
elements refined once more, with errors 16 times smaller, give the exact stiffness.
"""

import argparse
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.linalg import eigh

from feti_homog import Case, run
from feti_homog.case.cell_sizes import LOCKING_POISSON, coarse_error
from feti_homog.typing import Float

LADDERS = {1: range(4), 2: range(3)}  # refinements by the order of elements
EXACT = {"order": 2, "refine": 3}
CONTRASTS = (0.01, 0.1, 0.5, 2.3, 24.0, 1000.0)
POISSON_RATIOS = (0.2, 0.45, 0.48, 0.49, 0.4999, 0.499999)


def cells() -> list[tuple[str, dict[str, Any], float, float]]:
    """Return name, cell, contrast of Young's moduli, Poisson's ratio of the matrix."""
    shapes = {f"square {f}": {"geometry": "square", "fibre_fraction": f} for f in (0.2, 0.4, 0.6)}
    shapes |= {f"hexagonal {f}": {"geometry": "hexagonal", "fibre_fraction": f} for f in (0.4, 0.7, 0.85)}
    shapes |= {
        f"random {f}, gap {gap}": {"geometry": "random", "fibre_fraction": f, "min_gap": gap, "fibres": 5, "seed": 1}
        for f, gap in ((0.05, 0.05), (0.5, 0.01), (0.6, 0.02))
    }
    found = [(name, cell, contrast, 0.35) for name, cell in shapes.items() for contrast in CONTRASTS]
    return found + [("hexagonal 0.4", shapes["hexagonal 0.4"], 24.0, poisson) for poisson in POISSON_RATIOS]


def main() -> None:
    """Print one line per cell."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", metavar="WORDS", help="cells whose names begin so")
    wanted = parser.parse_args().only
    largest = dict.fromkeys(LADDERS, 0.0)
    for name, cell, contrast, poisson in cells():
        if not name.startswith(wanted):
            continue
        words = []
        for order, (errors, shares) in measured(cell, contrast, poisson).items():
            largest[order] = max(largest[order], *shares)
            listed = ", ".join(f"{e:.1e} ({share:.2f})" for e, share in zip(errors, shares, strict=True))
            words.append(f"order {order}: {listed}")
        print(f"{name:22} E {contrast:<6g} nu {poisson:<5g} {'; '.join(words)}", flush=True)
    print(
        "largest shares of the estimate:", ", ".join(f"order {order}: {share:.2f}" for order, share in largest.items())
    )


def measured(cell: dict[str, Any], contrast: float, poisson: float) -> dict[int, tuple[list[float], list[float]]]:
    """Return the errors of the ladder and their ratios to the estimate, by the order of elements."""
    phases = {"matrix": {"young": 1.0, "poisson": poisson}, "fibre": {"young": contrast, "poisson": 0.22}}
    document = {"material": phases, "analysis": {"type": "stiffness", "plane": "strain"}}
    coarse = Case.parse(document | {"cell": cell | {"accuracy": 0.1}})

    def stiffness(mesh: dict[str, int]) -> Float:
        sized = cell | mesh | {"mesh_size": coarse.cell.mesh_size}
        found = run(Case.parse(document | {"cell": sized}), MPI.COMM_SELF).effective_stiffness
        assert found is not None
        return found

    exact, ladders = stiffness(EXACT), {}
    for order, refinements in LADDERS.items():
        if order == 1 and poisson > LOCKING_POISSON:
            continue
        estimate = coarse_error(coarse.materials, "strain", order, free_faces=False)
        errors = [energy_error(stiffness({"order": order, "refine": refine}), exact) for refine in refinements]
        shares = [error * 4 ** (order * r) / estimate for r, error in zip(refinements, errors, strict=True)]
        ladders[order] = errors, shares
    return ladders


def energy_error(stiffness: Float, exact: Float) -> float:
    """Return max |E . (L - exact) E| / (E . exact E) over the strains E."""
    return float(np.abs(eigh(stiffness - exact, exact, eigvals_only=True)).max())


if __name__ == "__main__":
    main()
