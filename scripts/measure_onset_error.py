"""Measures how good the estimated errors of the loads of onset and of peaks are: true error / estimate, on one rank.

    .venv/bin/python scripts/measure_onset_error.py [--only WORDS] [--peaks]

For each cell, each order of elements and each of three refinements the least, the median and the largest ratio over 24
directions of an envelope, or the ratio of the peak of a path; then over all how many are above some numbers.  Exact
values are those of quadratic elements of a quarter, for peaks half, of the finest size.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

import numpy as np
from measure_mesh_error import BORON, GLASS, PAPER, SIZES, arc, lattice
from mpi4py import MPI

from feti_homog import Case, run
from feti_homog.typing import Float

EXACT, EXACT_PEAK = (2, 0.0125), (2, 0.025)
STRENGTHS = {"normal_strength": 5.0, "tangential_strength": 5.0}
ENERGY = {"law": "energy", "toughness": 0.02}
STIFF = {"normal_stiffness": 900.0, "tangential_stiffness": 300.0}
SOFT = {"normal_stiffness": 20.0, "tangential_stiffness": 5.0}
RANDOM = {"fibres": 4, "min_gap": 0.05}
CELLS: dict[str, tuple[dict[str, Any], Any, dict[str, Any]]] = {
    "hexagonal 0.5, strength": (lattice("hexagonal", 0.5), GLASS, STRENGTHS),
    "hexagonal 0.7, strength": (lattice("hexagonal", 0.7), GLASS, STRENGTHS),
    "hexagonal 0.4, springs, strength": (lattice("hexagonal"), GLASS, SOFT | STRENGTHS),
    "square 0.4, energy": (lattice("square"), GLASS, STIFF | ENERGY),
    "square 0.6, quadratic": (lattice("square", 0.6), PAPER, STRENGTHS | {"law": "quadratic"}),
    "random 0.4, strength": (lattice("random", 0.4, **RANDOM, seed=1), GLASS, STRENGTHS),
    "random 0.5, energy": (lattice("random", 0.5, **RANDOM, seed=2), GLASS, STIFF | ENERGY),
    "random 0.5, quadratic": (lattice("random", 0.5, **RANDOM, seed=3), BORON, STRENGTHS | {"law": "quadratic"}),
    "random 0.45, springs, energy": (lattice("random", 0.45, **RANDOM, seed=4), PAPER, SOFT | ENERGY),
    "arc 60, springs, strength": (lattice("hexagonal"), GLASS, SOFT | STRENGTHS | arc(60.0)),
    "arc 90, stiff springs, strength": (lattice("square"), GLASS, STIFF | STRENGTHS | arc(90.0, 20.0)),
    "arc 90, springs, energy": (lattice("square"), GLASS, SOFT | ENERGY | {"growth": "springs"} | arc(90.0)),
    "arc 120, released": (lattice("square"), GLASS, SOFT | ENERGY | {"growth": "released"} | arc(120.0, 45.0)),
}


def case(name: str, order: int, size: float, **more: Any) -> Case:
    """Return a case of a cell, whose elements have this size after one halving."""
    cell, phases, interface = CELLS[name]
    mesh = {"mesh_size": 2 * size, "refine": 1, "order": order}
    return Case.parse({"cell": cell | mesh, "material": phases, "interface": interface, **more})


def onsets(name: str, order: int, size: float) -> tuple[Float, Float]:
    """(n,) factors of the directions of an envelope, and their estimated errors."""
    analysis = {"type": "envelope", "plane": "strain"}
    more = {"analysis": analysis, "envelope": {"plane": ["S11", "S22"], "directions": 24}}
    points = run(case(name, order, size, **more), MPI.COMM_SELF).envelope or ()
    pairs = [(np.nan if p.factor is None else p.factor, p.mesh_error or np.nan) for p in points]
    factor, error = np.array(pairs, float).T
    return factor, factor * error


def peak(name: str, order: int, size: float) -> tuple[Float, Float]:
    """(1,) peak stress of a path, and its estimated error."""
    more = {"analysis": {"type": "path", "plane": "strain"}, "path": {"strain": [0.5, 0.0, 0.0], "max_events": 400}}
    found = run(case(name, order, size, **more, output={"states": "peaks"}), MPI.COMM_SELF, fields=True)
    assert found.path is not None and found.peak is not None
    stress, at = np.array([abs(found.peak.stress)]), found.path[found.peak.event]
    of_load = np.nan if at.broke and at.load_mesh_error is None else at.load_mesh_error or 0.0
    return stress, stress * np.hypot(of_load, at.mesh_error or 0.0)


def ratios(
    name: str, numbers: Callable[[str, int, float], tuple[Float, Float]], exact: Float, order: int
) -> list[Float]:
    """Ratios of true errors to their estimates on each mesh, of those that have one."""
    found = []
    for size in SIZES[order]:
        values, estimates = numbers(name, order, size)
        own = np.abs(values - exact) / estimates
        found.append(own[np.isfinite(own)])
    return found


def main() -> None:
    """One line a cell and order."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", metavar="WORDS", help="cells whose names begin so")
    parser.add_argument("--peaks", action="store_true", help="of peaks of paths instead of onsets")
    arguments = parser.parse_args()
    numbers, finest = (peak, EXACT_PEAK) if arguments.peaks else (onsets, EXACT)
    of_all: dict[int, list[float]] = {order: [] for order in SIZES}
    for name in (name for name in CELLS if name.startswith(arguments.only)):
        exact = numbers(name, *finest)[0]
        for order, of_order in of_all.items():
            found = ratios(name, numbers, exact, order)
            of_order += np.concatenate(found).tolist()
            words = [f"{r.min():.2f} {np.median(r):.2f} {r.max():.2f}" if len(r) else "none" for r in found]
            print(f"{name:34} order {order}: {', '.join(words)}", flush=True)
    for order, own in ((order, np.array(each)) for order, each in of_all.items()):
        shares = ", ".join(f"{np.mean(own > x):.1%} above {x:g}" for x in (5.0, 2.0, 0.5, 0.2))
        print(f"order {order}: {len(own)} loads, {shares}")


if __name__ == "__main__":
    main()
