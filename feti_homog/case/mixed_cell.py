"""Random cells whose fibres are of several phases, each with its own fraction and radius: `mix` and `radii`."""

from __future__ import annotations

from math import fsum, pi, sqrt

import numpy as np

from feti_homog.case.cell_section import MOST_FIBRES, Cell
from feti_homog.schema.wording import toml_value

FEWEST = 0.5  # fibres of a phase, below which one would be another phase's worth


def fibre_counts(cell: Cell) -> dict[str, int]:
    """Return how many fibres of each phase a random cell has.

    Fibres of the fraction c_p and the radius r_p are as many as e_p ~ c_p / r_p^2. Each phase has one, and each further
    fibre is of the phase with the largest e_p / (2 n_p + 1), the rule of Sainte-Lague: whole numbers next to e_p.
    """
    expected = _expected_counts(cell)
    count = max(len(expected), round(fsum(expected.values())))
    quotients = np.array(list(expected.values()))[:, None] / (2 * np.arange(1, count) + 1)
    phase = np.repeat(np.arange(len(expected)), count - 1)
    further = phase[np.argsort(-quotients.ravel(), kind="stable")[: count - len(expected)]]
    return dict(zip(expected, (1 + np.bincount(further, minlength=len(expected))).tolist(), strict=True))


def _expected_counts(cell: Cell) -> dict[str, float]:
    """Numbers of fibres of each phase that are not whole; their sum is `fibres`, or what the width holds."""
    per_area = {phase: share / (pi * _radius(cell, phase) ** 2) for phase, share in cell.fractions.items()}
    area = cell.fibres / fsum(per_area.values()) if cell.fibres is not None else (cell.width or 1.0) ** 2
    return {phase: area * density for phase, density in per_area.items()}


def _radius(cell: Cell, phase: str) -> float:
    return 1.0 if cell.radii is None else cell.radii[phase]


def void_count(cell: Cell, fibre_radius: float) -> int:
    """Return the number of voids of a random cell of width 1 whose fibres have this mean radius.

    It is the whole number next to that of their radius, at least one.
    """
    if not cell.voids:
        return 0
    radius = fibre_radius * (1.0 if cell.void_radius is None else cell.void_radius)
    return max(1, round(cell.voids / (pi * radius**2)))


def fractions_in_words(cell: Cell) -> str:
    """Return the keys with the fractions of a cell without a file, and their values."""
    fibres = f"fibre_fraction = {cell.fibre_fraction:g}" if cell.mix is None else f"mix = {toml_value(dict(cell.mix))}"
    return f"{fibres}, voids = {cell.voids:g}" if cell.voids else fibres


def mixed_width(cell: Cell) -> float | None:
    """Width of the cell, or None where `fibre_radius` or the default make it.

    In it `fibres` fibres have these radii and fractions, W^2 = sum n_p pi r_p^2 / sum c_p.
    """
    if cell.radii is None or cell.fibres is None:
        return cell.width
    filled = fsum(count * pi * cell.radii[phase] ** 2 for phase, count in fibre_counts(cell).items())
    return sqrt(filled / fsum(cell.fractions.values()))


def mix_faults(cell: Cell) -> list[str]:
    """List the faults of the numbers of a mix together."""
    if cell.mix is None:
        return []
    faults, given = [], f"[cell] mix = {toml_value(dict(cell.mix))}"
    if fsum(cell.mix.values()) >= 1:
        faults.append(f"{given}: expected a sum below 1")
    if cell.radii is not None and set(cell.radii) != set(cell.mix):
        expected = ", ".join(cell.mix)
        faults.append(f"[cell] radii = {toml_value(dict(cell.radii))}: expected a radius of each of mix: {expected}")
    if faults:
        return faults
    expected_counts = _expected_counts(cell)
    if (count := fsum(expected_counts.values())) > MOST_FIBRES:
        return [f"{given}: makes {count:.2g} fibres; expected at most {MOST_FIBRES}, of larger radii or a smaller cell"]
    return [
        f"{given}: makes {expected:.2g} fibres of {phase}; expected at least {FEWEST}, of more fibres or a wider cell"
        for phase, expected in expected_counts.items()
        if expected < FEWEST
    ]
