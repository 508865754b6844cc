"""Displacements along the fibres in pictures of the cell: lines at equal steps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.tri import Triangulation

from feti_homog.report.plots.decimation import DrawnMesh, nodal_values
from feti_homog.typing import Array

INK, WIDTH = "0.15", 0.6
LEVELS = 12  # about so many lines


def is_axial(state: Any) -> bool:
    """Whether a state shears the cell along the fibres alone."""
    strain = state.attrs["strain"]
    others = [*strain[[0, 1, -1]], strain[2], state.attrs["temperature"]] if len(strain) > 3 else strain
    return not np.any(others) and bool(np.any(strain))


def draw_levels(axes: Axes, state: Any, drawn: DrawnMesh) -> float:
    """Draw lines of equal displacement along the fibres; returns the step between them."""
    displacement: Array = nodal_values(state["axial_displacement"], drawn)
    least, most = float(displacement.min()), float(displacement.max())
    step = round_step((most - least) / LEVELS)
    levels = step * np.arange(math.ceil(least / step), math.floor(most / step) + 1)
    x, y = drawn.points.T
    mesh = Triangulation(x, y, drawn.triangles)
    axes.tricontour(mesh, displacement, levels=levels, colors=INK, linewidths=WIDTH, linestyles="solid")
    return step


def round_step(wanted: float) -> float:
    """1, 2 or 5 times a power of ten, not less than wanted."""
    if wanted <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(wanted))
    return power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= wanted * (1 - 1e-9))
