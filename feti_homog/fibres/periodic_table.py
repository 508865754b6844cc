"""A table of fibres on the torus: images that are one fibre, and what is wrong with it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.fibres import cut_window
from feti_homog.fibres.convex_shapes import ConvexShapes, shape_gaps
from feti_homog.fibres.ellipses import Ellipses, gaps
from feti_homog.fibres.elliptic_table import ellipses_of, with_coatings
from feti_homog.fibres.shaped_table import shapes_of
from feti_homog.fibres.torus_pairs import neighbours
from feti_homog.typing import Bool, Float, Int

if TYPE_CHECKING:
    from feti_homog.case.fibre_table import FibreTable

# Relative to the radius: rows nearer than this, or a period apart to this, are one fibre.
SAME_FIBRE = 0.01
# Gap / mean radius of two fibres below which they touch: elements between them would be too many.
LEAST_GAP = 1e-4
# Radius / width of the cell above which positions on a circle differ by more than rounding.
SMALLEST_RADIUS = 1e-6
# Thickness / radius of the thinnest and of the thickest coating.
COATINGS = 0.01, 1.0
# Faults that are told one by one.
MAX_FAULTS = 30


def fibres(table: FibreTable, window: str) -> tuple[Int, Float, Float, float]:
    """The rows (k,) that are fibres, then voids, their centres (k, 2), radii (k,), and the height; all / width of the
    cell.

    In a periodic window, rows a period apart are images of one fibre, the first of them. In one that is cut out of
    something larger, fibres that overlap across its border are moved apart.

    Raises:
        MeshError: rows lie outside, come twice, overlap or touch; a line for each fault.
    """
    kept, centres, moved, size = _on_torus(table, window)
    order = np.argsort(table.is_void[kept], kind="stable")
    kept, places = kept[order], (centres + moved)[order]
    return kept, places % size / size[0], table.radius[kept] / size[0], float(size[1] / size[0])


def moved_rows(table: FibreTable, window: str) -> tuple[Int, Float]:
    """The rows (m,) whose fibres a cut window moves, numbered as the table has them, and how far (m,). Raises as
    `fibres`.
    """
    kept, _, moved, _ = _on_torus(table, window)
    distance = np.linalg.norm(moved, axis=1)
    far = distance > cut_window.TOLERANCE * table.radius.mean()
    return table.row[kept[far]], distance[far]


def _on_torus(table: FibreTable, window: str) -> tuple[Int, Float, Float, Float]:
    """Rows (k,) that are fibres, where they are (k, 2) in the cell, their moves (k, 2), and the cell's size (2,)."""
    assert table.width is not None and table.height is not None
    size = np.array([table.width, table.height])
    centres = table.centres - _corner(table)
    is_cut = window == "cut"
    _raise_faults(table, _outside(table, centres, size, is_cut))
    first, faults = _without_images(table, centres, size, is_cut)
    _raise_faults(table, faults)
    kept = np.flatnonzero(first)
    centres = centres[kept]
    ellipses = None if table.a is None else with_coatings(table, kept, centres)
    shapes = None if table.polygons is None else _shapes(table, kept, centres, ellipses)
    _raise_faults(table, _contacts(table, kept, centres, size, is_cut, ellipses, shapes))
    if not is_cut:
        return kept, centres, np.zeros_like(centres), size
    frames = None if ellipses is None else ellipses.frames
    try:
        return kept, centres, cut_window.moves(centres, table.outer_radius[kept], size, frames), size
    except MeshError as error:
        words = "fibres overlap across the border, and " + str(error)
        raise MeshError(f'[cell] {table.name}: window = "cut": {words}; leave some of them out') from error


def _shapes(table: FibreTable, kept: Int, centres: Float, ellipses: Ellipses | None) -> ConvexShapes:
    """Those of the rows `kept` (k,), with their coatings."""
    assert table.polygons is not None
    discs = Ellipses.round(np.column_stack([centres, table.outer_radius[kept]]))
    return shapes_of(discs if ellipses is None else ellipses, table.polygons[kept])


def _corner(table: FibreTable) -> Float:
    """(2,) the lower left corner of the cell; the lowest coordinates of centres if the table does not say."""
    given = np.array([table.left, table.bottom], float)
    return np.where(np.isnan(given), table.centres.min(axis=0), given)


def _raise_faults(table: FibreTable, faults: list[str]) -> None:
    if faults:
        more = len(faults) - MAX_FAULTS
        rest = [f"[cell] {table.name}: {more} more faults like these"] if more > 0 else []
        raise MeshError(*(f"[cell] {table.name}: {fault}" for fault in faults[:MAX_FAULTS]), *rest)


def _outside(table: FibreTable, centres: Float, size: Float, is_cut: bool) -> list[str]:
    """Faults of fibres that are no part of the cell, or too large or too small for it.

    Discs reach into a periodic cell; of a cut window the centres are within.
    """
    radius, faults, called = table.radius, [], ["radius"] * len(table.row)
    if table.polygons is not None:
        radius = np.where(table.polygons.sides > 0, table.polygons.circumradius, radius)
    if table.a is not None and table.b is not None:
        radius = np.maximum(radius, np.maximum(table.a, table.b))
        called = np.where(table.a == table.b, "radius", np.where(table.a > table.b, "a", "b")).tolist()
    for axis, (name, width) in enumerate(zip(("width", "height"), size.tolist(), strict=True)):
        over = np.maximum(-centres[:, axis], centres[:, axis] - width)
        reach = radius if (table.left, table.bottom)[axis] is not None else np.full_like(radius, 2 * radius.max())
        for k in np.flatnonzero(over > (SAME_FIBRE * radius if is_cut else (1 + SAME_FIBRE) * reach)).tolist():
            value = table.centres[k, axis]
            faults.append(f"row {table.row[k]}: {'xy'[axis]} = {value:g}: lies outside the cell, of {name} {width:g}")
    for k in np.flatnonzero((2 * radius >= size.min()) | (radius < SMALLEST_RADIUS * size[0])).tolist():
        limits = f"from {SMALLEST_RADIUS * size[0]:g} to below {size.min() / 2:g} in this cell"
        faults.append(f"row {table.row[k]}: {called[k]} = {radius[k]:g}: expected {limits}")
    return faults + _unlikely_coatings(table)


def _unlikely_coatings(table: FibreTable) -> list[str]:
    """Faults of coatings that are too thin or too thick to be meshed."""
    if table.coating is None:
        return []
    least, most = COATINGS
    bad = np.flatnonzero((table.coating > 0) & ((table.coating < least) | (table.coating > most)))
    expected = f"expected 0, or from {least:g} to {most:g}"
    return [f"row {table.row[k]}: coating = {table.coating[k]:g}: {expected}" for k in bad.tolist()]


def _without_images(table: FibreTable, centres: Float, size: Float, is_cut: bool) -> tuple[Bool, list[str]]:
    """(N,) which rows are the first of their fibre, and faults of rows at one place that are not one fibre."""
    first, second, vector = neighbours(centres, size, SAME_FIBRE * table.radius.max())
    radius, apart = table.radius, np.linalg.norm(vector, axis=1)
    smaller = np.minimum(radius[first], radius[second])
    near = (first != second) & (apart < SAME_FIBRE * smaller)
    first, second, vector = first[near], second[near], vector[near]
    in_place = np.linalg.norm(centres[second] - centres[first] - vector, axis=1) < SAME_FIBRE * radius[first]
    both = np.column_stack([radius, table.outer_radius])
    alike = (np.abs(both[second] - both[first]) < SAME_FIBRE * smaller[near, None]).all(axis=1)
    if table.a is not None:
        squares = ellipses_of(table, np.arange(len(radius)), centres).squares
        alike &= np.abs(squares[second] - squares[first]).max(axis=(1, 2)) < SAME_FIBRE * smaller[near] ** 2
    faults = []
    for i, j, is_here, is_alike in zip(first.tolist(), second.tolist(), in_place, alike, strict=True):
        rows = f"rows {table.row[i]} and {table.row[j]}"
        if is_here:
            faults.append(f"{rows}: are at one place; expected each fibre once")
        elif not is_cut and (not is_alike or table.phase[i] != table.phase[j]):
            faults.append(f"{rows}: are images of one fibre, a period apart; expected one shape and one phase")
    is_first = np.ones(len(radius), bool)
    is_first[np.maximum(first, second)] = is_cut
    return is_first, faults


def _contacts(
    table: FibreTable,
    kept: Int,
    centres: Float,
    size: Float,
    is_cut: bool,
    ellipses: Ellipses | None,
    shapes: ConvexShapes | None,
) -> list[str]:
    """Faults of fibres, the rows `kept` (k,) and their ellipses or shapes if some are not round, that overlap or touch;
    of a cut window only of those that do within."""
    radius = table.outer_radius[kept]
    longest = radius.max() if ellipses is None else ellipses.longest.max()
    longest = longest if shapes is None else float(shapes.extents.max())
    first, second, vector = neighbours(centres, size, 2 * longest * (1 + LEAST_GAP))
    together = radius[first] + radius[second]
    if shapes is not None:
        gap = shape_gaps(shapes[first], shapes[second].at(centres[first] + vector))
    elif ellipses is None:
        gap = np.linalg.norm(vector, axis=1) - together
    else:
        gap, _ = gaps(ellipses[first], Ellipses(centres[first] + vector, ellipses.frames[second]))
    across = np.linalg.norm(centres[second] - centres[first] - vector, axis=1) > SAME_FIBRE * radius[first]
    bad = np.flatnonzero((gap < LEAST_GAP * together / 2) & ~(across & is_cut))
    faults = []
    for k in bad[np.unique(np.stack([first[bad], second[bad]]), axis=1, return_index=True)[1]].tolist():
        i, j = table.row[kept[first[k]]], table.row[kept[second[k]]]
        who = f"rows {i} and {j}" if i != j else f"row {i} and its image"
        what = f"overlap by {-gap[k]:.3g}" if gap[k] < -LEAST_GAP * together[k] / 2 else "touch"
        faults.append(f"{who}: {what}{' across the border' if across[k] else ''}")
    if (across[bad]).any():
        faults.append('fibres meet across the border: give the right width and height, or window = "cut"')
    return faults
