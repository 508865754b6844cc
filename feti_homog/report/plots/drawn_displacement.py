"""The displacements that pictures of the deformed cell show, and how far they may be magnified."""

from __future__ import annotations

from typing import Any

import numpy as np

from feti_homog.materials.voigt import voigt_names
from feti_homog.report.plots.decimation import DrawnMesh, nodal_values
from feti_homog.typing import Array

LEAST_AREA = 0.5  # area of a triangle in a picture / its own: at zero it would be turned over


def drawn_displacement(state: Any, drawn: DrawnMesh) -> Array:
    """(p, 2) u of a state of result.h5 at the nodes drawn, shifted so that the mean of u* = u - E x over the triangles
    drawn is zero: the solution leaves the translation open, and without it the cell stays in place."""
    displacement = nodal_values(state["displacement"], drawn)
    loads = dict(zip(voigt_names(len(state.attrs["strain"]))[0], state.attrs["strain"], strict=True))
    shear = 0.5 * loads["gamma12"]
    fluctuation = displacement - drawn.points @ np.array([[loads["E11"], shear], [shear, loads["E22"]]])
    areas = _determinant(_sides(drawn.points, drawn))
    shifted: Array = displacement - np.average(fluctuation[drawn.triangles].mean(axis=1), axis=0, weights=areas)
    return shifted


def largest_scale(displacement: Array, drawn: DrawnMesh) -> float:
    """The largest s with det(I + s' grad u) >= LEAST_AREA in every triangle drawn for all s' up to s; infinity if there
    is none.

    In each the determinant is 1 + s tr(grad u) + s^2 det(grad u).
    """
    sides, moves = _sides(drawn.points, drawn), _sides(displacement, drawn)
    area = _determinant(sides)
    trace = (_determinant(np.stack([moves[:, 0], sides[:, 1]], axis=1))
             + _determinant(np.stack([sides[:, 0], moves[:, 1]], axis=1))) / area  # fmt: skip
    rest = 1.0 - LEAST_AREA
    square = trace**2 - 4.0 * rest * _determinant(moves) / area
    # The least positive root s is 2 rest / (-trace + sqrt(square)), if that is real and positive.
    divisor = np.sqrt(np.maximum(square, 0.0)) - trace
    rate = float(np.where(square >= 0.0, divisor, 0.0).max(initial=0.0))
    return 2.0 * rest / rate if rate > 0.0 else np.inf


def _sides(values: Array, drawn: DrawnMesh) -> Array:
    """(q, 2, 2) the differences of values (p, 2) along two sides of each triangle drawn."""
    first, second, third = np.moveaxis(values[drawn.triangles], 1, 0)
    return np.stack([second - first, third - first], axis=1)


def _determinant(rows: Array) -> Array:
    """(q,) determinants of (q, 2, 2)."""
    found: Array = rows[:, 0, 0] * rows[:, 1, 1] - rows[:, 0, 1] * rows[:, 1, 0]
    return found
