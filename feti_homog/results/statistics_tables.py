"""fibre_statistics.csv, pair_functions.csv and pair_directions.csv: what `feti-homog statistics` measures."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.microstructure.pair_functions import SECTORS
from feti_homog.microstructure.statistics import FibreStatistics
from feti_homog.results import atomic
from feti_homog.typing import Array


def write(directory: Path, found: FibreStatistics) -> list[Path]:
    """Write the three tables; returns their paths.  On one rank.  Raises FetiHomogError if they cannot be written."""
    tables = {
        "fibre_statistics.csv": fibre_columns(found),
        "pair_functions.csv": pair_columns(found),
        "pair_directions.csv": {"angle": np.arange(SECTORS) * 180 / SECTORS, "relative_share": found.directions},
    }
    return [atomic.replace(directory / name, partial(_write, columns)) for name, columns in tables.items()]


def fibre_columns(found: FibreStatistics) -> dict[str, Array]:
    """A row for each fibre: its three nearest neighbours with the weights of their distances, and its Voronoi cell."""
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
    """A row for each distance r between centres: g, K and L, and L of the simulations."""
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


def _write(columns: Mapping[str, Array], path: Path) -> None:
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(map(_cell, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _cell(value: Any) -> str:
    """A number as Python reads it back; nothing for one that is not there."""
    return repr(value) if np.isfinite(value) else ""
