"""Placement of fibres in a cross-section: neighbours, local fractions, directions, Ripley's L beside simulations.

    .venv/bin/python drivers/fibre_statistics.py meshes/clustered.csv --out results/statistics

The source is a table of fibres in a window of a micrograph, or the periodic cell of a folder of results or a case file.
Ellipses count as discs of the same area. --out writes tables of all quantities, of g(r) and K(r), and statistics.png.
"""

import argparse
import csv
import sys
from pathlib import Path

import numpy as np
import statistics_picture
from mpi4py.MPI import Intracomm
from pattern_statistics import SECTORS, FibreStatistics, VoronoiCells, hard_core, measure, poisson, smallest_gap

from feti_homog import CaseError, launch
from feti_homog.commands import listed_fibres
from feti_homog.microstructure.fibre_pattern import FibrePattern, read_window
from feti_homog.microstructure.phase_names import VOID
from feti_homog.typing import Array, Float

ORDINALS = ("nearest", "second", "third")
LEVEL = 0.05  # of the test of randomness
MODELS = {"hard-core": hard_core, "poisson": poisson}


def text(found: FibreStatistics, model: str, simulations: int) -> str:
    """Return a line for each quantity; lengths in the unit of the fibres' table, and in mean diameters."""
    pattern, cells = found.pattern, found.cells
    kind = "periodic cell" if pattern.periodic else "window, corrected for its edges,"
    size = 2 * pattern.mean_radius
    radii = pattern.radii
    spread = f"{radii.mean():.4g} +- {radii.std():.2g}, from {radii.min():.4g} to {radii.max():.4g}"
    lines = [
        ("fibres", f"{pattern.count} in a {kind} of {pattern.width:.6g} x {pattern.height:.6g}"),
        ("fibre fraction", f"{pattern.fibre_fraction:.4f}"),
        ("radii", spread),
        ("smallest gap", f"{smallest_gap(pattern):.4g}, {smallest_gap(pattern) / size:.3f} mean diameters"),
        *_neighbours(found, size),
        ("local fractions", _local_fractions(cells)),
        ("directions", _directions(found.directions)),
        ("randomness", _randomness(found, model, simulations)),
    ]
    return "\n".join(f"{name:<16}{words}" for name, words in lines)


def _local_fractions(cells: VoronoiCells) -> str:
    known = cells.fractions[cells.whole]
    if not len(known):
        return "undetermined: the window is too small"
    limits = f"from {known.min():.4g} to {known.max():.4g}"
    return f"{cells.mean_fraction:.4g} +- {cells.fraction_deviation:.2g}, {limits}, in {len(known)} Voronoi cells"


def _neighbours(found: FibreStatistics, size: float) -> list[tuple[str, str]]:
    near = found.neighbours
    return [
        (f"{name} centre", f"{mean:.4g} +- {deviation:.2g}, {mean / size:.3f} +- {deviation / size:.3f} mean diameters")
        if np.isfinite(mean)
        else (f"{name} centre", "undetermined: the window is too small")
        for name, mean, deviation in zip(ORDINALS, near.means, near.deviations, strict=True)
    ]


def _directions(shares: Float) -> str:
    angle = int(shares.argmax()) * 180 / SECTORS
    return f"{shares.min():.2f} to {shares.max():.2f} times as many near pairs as evenly, most about {angle:g} degrees"


def _randomness(found: FibreStatistics, model: str, simulations: int) -> str:
    value = found.random.p_value
    verdict = "indistinguishable from it" if value > LEVEL else f"not one of its patterns at {100 * LEVEL:g} %"
    if 1 / (simulations + 1) > LEVEL:
        verdict = f"too few simulations for a level of {100 * LEVEL:g} %"
    return f"L(r) beside {simulations} simulations of the model {model}: p = {value:.3g}, {verdict}"


def write(directory: Path, found: FibreStatistics) -> list[Path]:
    """Write the three tables; returns their paths."""
    tables = {
        "fibre_statistics.csv": fibre_columns(found),
        "pair_functions.csv": pair_columns(found),
        "pair_directions.csv": {"angle": np.arange(SECTORS) * 180 / SECTORS, "relative_share": found.directions},
    }
    for name, columns in tables.items():
        with (directory / name).open("w", newline="", encoding="utf-8") as stream:
            rows = zip(*(column.tolist() for column in columns.values()), strict=True)
            writer = csv.writer(stream)
            writer.writerow(columns)
            writer.writerows([value if np.isfinite(value) else "" for value in row] for row in rows)
    return [directory / name for name in tables]


def fibre_columns(found: FibreStatistics) -> dict[str, Array]:
    """Return a row for each fibre.

    It has the three nearest neighbours with the weights of their distances, and its Voronoi cell.
    """
    pattern, near, cells = found.pattern, found.neighbours, found.cells
    columns: dict[str, Array] = {
        "number": np.arange(1, pattern.count + 1),
        "x": pattern.centres[:, 0],
        "y": pattern.centres[:, 1],
        "radius": pattern.radii,
    }
    for k in range(near.distances.shape[1]):
        columns |= {
            f"distance_{k + 1}": near.distances[:, k],
            f"direction_{k + 1}": near.directions[:, k],
            f"weight_{k + 1}": near.weights[:, k],
        }
    return columns | {
        "voronoi_area": cells.areas,
        "local_fraction": cells.fractions,
        "cell_weight": cells.weights,
    }


def pair_columns(found: FibreStatistics) -> dict[str, Array]:
    """Return a row for each distance r between centres: g, K and L, and L of the simulations."""
    pairs, random = found.pairs, found.random
    return {
        "r": pairs.r,
        "g": pairs.radial,
        "K": pairs.ripley_k,
        "L": pairs.ripley_l,
        "L_random_mean": random.mean,
        "L_random_low": random.low,
        "L_random_high": random.high,
    }


def run(
    source: Path, out: Path | None, model: str, simulations: int, size: tuple[float, float] | None = None
) -> list[str]:
    """Measure, write three tables and a picture to `out`, if given, and return the lines to print.

    `size` is the window size for a table that gives none.

    Raises:
        CaseError, MeshError: the source is faulty, or the model has no such pattern.
    """
    found = measure(pattern(source, size), MODELS[model], simulations)
    lines = [text(found, model, simulations)]
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        paths = [*write(out, found), statistics_picture.write(out, found, source.stem, model)]
        lines += map(str, paths)
    return lines


def pattern(source: Path, size: tuple[float, float] | None) -> FibrePattern:
    """Return the fibres, at least two, in the source's unit of length. On one rank.

    Fibres of a table lie in a window, of this width and height if the table gives none; fibres of a folder or a case
    lie in a periodic cell. Voids are left out; ellipses count as discs of the same centres and areas.

    Raises:
        CaseError, MeshError: the source is faulty, a fibre is no circle or ellipse, or there are fewer than two.
    """
    if source.suffix != ".toml" and not source.is_dir():
        return read_window(source, size)
    if size is not None:
        raise CaseError(f"--size: only for a table of fibres; {source} gives the size of the cell")
    fibres = listed_fibres.read(source)
    width, height = fibres.size.tolist()
    own = [name != VOID for name in fibres.phases]
    if lost := [str(k) for k, radius in enumerate(fibres.radii.tolist(), 1) if radius != radius]:
        raise CaseError(f"{source}: fibres that are neither round nor ellipses have no radius: {', '.join(lost[:10])}")
    found = FibrePattern(width, height, fibres.ellipses.centres[own], fibres.radii[own], periodic=True)
    if found.count < 2:
        raise CaseError(f"{source}: expected at least two fibres, got {found.count}")
    return found


def main(given: argparse.Namespace, comm: Intracomm) -> None:
    """Print, write and draw on rank 0."""
    if comm.rank == 0:
        size = None if given.size is None else tuple(given.size)
        print(*run(given.source, given.out, given.model, given.simulations, size), sep="\n")


def _parser() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("source", type=Path, metavar="FILE.csv|DIR|CASE.toml")
    options.add_argument("--out", type=Path, metavar="DIR", help="folder of the tables and the picture")
    words = "random reference: fibres of these radii with at least the smallest gap found (the default), or points"
    options.add_argument("--model", choices=tuple(MODELS), default="hard-core", help=words)
    options.add_argument("--simulations", type=int, default=39, metavar="N", help="how many are compared (default 39)")
    words = "size of the window, in the unit of the table (default: from a comment in the table)"
    options.add_argument("--size", type=float, nargs=2, metavar=("WIDTH", "HEIGHT"), help=words)
    return options


if __name__ == "__main__":
    sys.exit(launch(main, _parser()))
