"""Estimate the triangle count before the program makes a mesh."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from feti_homog.case import cell_section, cell_sizes
from feti_homog.errors import MeshError
from feti_homog.mesh.outline.graded_size import MAX_GROWTH, MIN_EDGES_AROUND
from feti_homog.microstructure import Arrangement
from feti_homog.microstructure.shapes import Ellipses
from feti_homog.typing import Float

# Limits for elements that one rank, or all ranks together, can make in some minutes.
MAX_TRIANGLES, MAX_TRIANGLES_OF_TILES = 1_000_000, 20_000_000
# Area of an equilateral triangle / its side squared.
TRIANGLE_AREA = math.sqrt(3.0) / 4.0
# Additional triangles around a fibre of a random cell or a table, because of narrow gaps.
TRIANGLES_OF_A_FIBRE = 160
# Ratios of element sizes; the largest exceeds every ratio in a case.
RATIOS = np.geomspace(1.0, 1e7, 400)
# Number of samples of the size along each axis.
POSITIONS = 200


@dataclass(frozen=True)
class ElementEstimate:
    """The quantities of a cell of width 1 that determine the triangle count.

    Attributes:
        cell: the cell section, with element sizes.
        fibres: fibre count.
        mean_radius: radius of a fibre of mean area; in a table, the mean radius of fibres and voids.
        height: cell height / cell width.
        interfaces: total length of the fibre outlines; the outer outlines of coatings do not count.
        ovals: the elliptic fibres in a table; empty for other cells.
    """

    cell: cell_section.Cell
    fibres: int
    mean_radius: float
    height: float
    interfaces: float
    ovals: Ellipses

    @classmethod
    def of(cls, cell: cell_section.Cell, listed: Arrangement | None) -> ElementEstimate:
        """Collect the quantities of a cell; `listed` is the arrangement of a table, None for other cells."""
        if listed is not None:
            from feti_homog.microstructure.shapes import shapes  # only tables have shapes

            ellipses, radius = shapes.elliptic(listed.outlines), float(listed.radii.mean())
            ovals = ellipses[~ellipses.are_round]
            length = math.fsum(ellipses.perimeters) if len(ovals) else 2 * math.pi * radius * listed.fibres
            return cls(cell, listed.fibres, radius, listed.height, length, ovals)
        fibres, height = cell_sizes.fibres_and_height(cell)
        radius = math.sqrt(math.fsum(cell.fractions.values()) * height / (math.pi * fibres))
        return cls(cell, fibres, radius, height, 2 * math.pi * radius * fibres, Ellipses.round(np.zeros((0, 3))))

    @property
    def interface_size(self) -> float:
        """The element size on interfaces, small enough for MIN_EDGES_AROUND edges around a fibre of mean radius."""
        asked = self.cell.interface_size or self.cell.mesh_size
        return min(asked, 2 * math.pi * self.mean_radius / MIN_EDGES_AROUND)

    @property
    def triangles(self) -> float:
        """The estimated triangle count in a cell without debonded arcs.

        Triangles of one size fill the cell. Further triangles lie around fibres, at the ends of ellipses and, with
        `interface_size` h, on both sides of interfaces of length P: 2 P int dx / (A (h + g x)^2) = 2 P / (A g h), with
        the growth g = MAX_GROWTH and A = TRIANGLE_AREA.
        """
        cell = self.cell
        irregular = 0 if cell.geometry in cell_section.LATTICES else self.fibres
        count = self.height / (TRIANGLE_AREA * cell.mesh_size**2) + TRIANGLES_OF_A_FIBRE * irregular
        # The radius of curvature at the ends of the long axis is b^2 / a.
        short, long = np.sort(self.ovals.semi_axes, axis=1).T
        ratios = (cell.interface_size or cell.mesh_size) / (2 * np.pi * short**2 / long / MIN_EDGES_AROUND)
        count += 2 * math.fsum(map(triangles_of_a_tip, np.maximum(1.0, ratios).tolist()))
        if cell.interface_size is None:
            return count
        return count + 2 * self.interfaces / (TRIANGLE_AREA * MAX_GROWTH * cell.interface_size)


def refuse_many(size_at: Callable[[Float], Float], smallest: float, period: Float, limit: int = MAX_TRIANGLES) -> None:
    """Refuse a cell that needs more than `limit` elements.

    The number is the integral of 1 / (TRIANGLE_AREA h^2) over the cell of size `period` (2,), where h = `size_at`(x)
    includes narrow gaps and thin coatings. No sum is necessary if the lower bound `smallest` of h guarantees `limit`.

    Raises:
        MeshError: the cell needs more than `limit` elements.
    """
    if period.prod() <= limit * TRIANGLE_AREA * smallest**2:
        return
    share = (np.arange(POSITIONS) + 0.5) / POSITIONS
    places = np.stack(np.meshgrid(share, share), axis=-1).reshape(-1, 2) * period
    count = float((1 / size_at(places) ** 2).mean() * period.prod() / TRIANGLE_AREA)
    if count > limit:
        elements = f"{count:.2g} elements before refine; expected at most {limit}"
        raise MeshError(f"[cell] narrow gaps, thin coatings or small fibres need about {elements}")


def triangles_of_a_tip(ratio: np.float64 | float) -> float:
    """Return how many triangles a tip adds, where `ratio` = size far from the tip / size at the tip.

    With the size h at the tip, the growth g and A = TRIANGLE_AREA, the number is int 2 pi r dr / (A (h + g r)^2) up to
    the radius r where h + g r = ratio h, less the number of triangles of size ratio h in this circle.
    """
    within = 2 * (np.log(ratio) + 1 / ratio - 1) - (1 - 1 / ratio) ** 2
    return float(math.pi / (TRIANGLE_AREA * MAX_GROWTH**2) * within)


def ratio_at_a_tip(count: float) -> float:
    """Invert `triangles_of_a_tip`: return the size ratio where a tip adds `count` triangles, from 1 to RATIOS[-1]."""
    counts = [triangles_of_a_tip(ratio) for ratio in RATIOS]
    return float(np.interp(count, counts, RATIOS))
