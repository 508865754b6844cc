"""List the shapes that table rows may have, and build the outlines of all rows."""

from collections.abc import Sequence

import numpy as np

from feti_homog.microstructure.shapes.convex_sums import ConvexSums, Outlines, PolygonalRows
from feti_homog.microstructure.shapes.ellipses import Discs, Ellipses, EllipticRows
from feti_homog.microstructure.shapes.outlines import Columns
from feti_homog.typing import Bool, Float

Shape = EllipticRows | PolygonalRows
SHAPES: tuple[Shape, ...] = (EllipticRows(), PolygonalRows())
"""All shapes except discs; rows of no other shape are discs.

A shape has a plural `name`; the `columns` that no other shape needs; `sizes`, the columns of its largest lengths, which
replace "radius" unless they include it; and `has_tips`, whether a mesh may have nodes at the tips of debonded arcs.
"""
BOTH_SIZES = "has a radius and semi-axes; give one"


REPLACING = tuple(shape.sizes for shape in SHAPES if "radius" not in shape.sizes)
"""Columns that replace the radius."""


def given_shapes(rows: Columns, has_tips: bool) -> list[Shape]:
    """Return the shapes in a table whose outlines allow mesh nodes at tips or, without `has_tips`, do not."""
    return [shape for shape in SHAPES if shape.has_tips == has_tips and shape.given(rows).any()]


def columns_without_tips(rows: Columns) -> dict[str, Float]:
    """Return the columns (N,), by name, of shapes without nodes at tips; NaN in rows of other shapes."""
    shapes = given_shapes(rows, has_tips=False)
    mask = np.logical_or.reduce([np.zeros(len(rows["x"]), bool), *(shape.given(rows) for shape in shapes)])
    names = {name for shape in shapes for name in (*shape.sizes, *shape.columns, "angle")}
    return {name: np.where(mask, values, np.nan) for name, values in rows.items() if name in names}


def have_both_sizes(rows: Columns) -> Bool:
    """Return the mask (N,) of rows with both a radius and sizes that replace the radius."""
    others = [~np.isnan(rows[sizes[0]]) for sizes in REPLACING]
    return np.asarray(~np.isnan(rows["radius"]) & np.logical_or.reduce(others))


def outlines_of(rows: Columns) -> Outlines:
    """Build the outlines of N table rows without faults; coatings are not included."""
    centres = np.column_stack([rows["x"], rows["y"]])
    radius = np.where(np.isnan(rows["radius"]), rows["a"], rows["radius"])
    parts: list[tuple[Bool, Outlines]] = []
    for shape in SHAPES:
        mask = shape.given(rows)
        if mask.any():
            parts.append((mask, shape.outlines({name: values[mask] for name, values in rows.items()}, centres[mask])))
    return with_parts(Discs(centres, radius), parts)


def with_parts(outlines: Outlines, parts: Sequence[tuple[Bool, Outlines]]) -> Outlines:
    """Replace the outlines in masked rows of N outlines.

    A part is a mask (N,) and the new outlines of the masked rows.  Returns `outlines` if all masks are empty, `Discs`
    or `Ellipses` if the class can represent all outlines, else `ConvexSums`.
    """
    parts = [(mask, part) for mask, part in parts if mask.any()]
    if not parts:
        return outlines
    before_and_after = [outlines, *(part for _, part in parts)]
    if all(isinstance(curves, Discs) for curves in before_and_after):
        radii = outlines.radii.copy()
        for mask, part in parts:
            radii[mask] = part.radii
        return Discs(outlines.centres, radii)
    most = max(curves.cores.shape[1] for curves in before_and_after)
    frames, cores = outlines.frames.copy(), _padded(outlines.cores, most)
    for mask, part in parts:
        frames[mask], cores[mask] = part.frames, _padded(part.cores, most)
    return Ellipses(outlines.centres, frames) if most == 1 else ConvexSums(outlines.centres, cores, frames)


def elliptic(outlines: Outlines) -> Ellipses:
    """Return outlines as ellipses: discs and ellipses exactly, others as equal-area discs."""
    has_core = outlines.cores.any(axis=(1, 2), keepdims=True)
    return Ellipses(outlines.centres, np.where(has_core, outlines.radii[:, None, None] * np.eye(2), outlines.frames))


def _padded(cores: Float, corners: int) -> Float:
    """Pad cores (k, m, 2) to a number of corners by copies of the last corner."""
    return np.pad(cores, ((0, 0), (0, corners - cores.shape[1]), (0, 0)), mode="edge")
