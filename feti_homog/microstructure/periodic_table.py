"""Arrange a fibre table on the torus: merge periodic images, move fibres of cut windows, report faults."""

from dataclasses import replace

import numpy as np

from feti_homog.errors import MOST_FAULTS, MeshError
from feti_homog.microstructure import Arrangement, arrangements, cut_window
from feti_homog.microstructure.fibre_table import SAME_FIBRE, FibreTable
from feti_homog.microstructure.shapes import Discs, Outlines, directions
from feti_homog.microstructure.shapes.shapes import REPLACING, with_parts
from feti_homog.typing import Bool, Float, Int

# Directions in which outlines are compared.
COMPARED = directions(np.linspace(0.0, 2 * np.pi, 24, endpoint=False))
# Ratio of gap to mean radius below which two fibres touch: a smaller gap would need too many elements.
LEAST_GAP = 1e-4
# The least and the largest ratio of coating thickness to radius.
COATINGS = 0.01, 1.0
# Distance between a cell side and a tangent, relative to the mean radius, below which elements are needles.
LEAST_CLEARANCE = 1e-3


def table_arrangement(table: FibreTable, window: str, repairs: bool = False) -> Arrangement:
    """Arrange the fibres of a table, in row order, and then the voids.

    If several rows list images of one fibre, the first row counts. In a cut window (`window` = "cut"), fibres that
    overlap across the border are moved apart. With `repairs`, fibres that overlap slightly shrink first.

    The corner that the table gives remains if no cell side touches a disc and the corner lies in no void (`in_voids`),
    so that the table of a random cell gives the mesh of that cell. Otherwise fibres are shifted (`clear_shift`),
    coordinates are rounded, and `mesh_order` sorts the fibres: tables that differ by a shift, the row order or units
    have the same mesh. Coordinates of fibres that are not discs are always rounded.

    Raises:
        MeshError: rows lie outside, have wrong sizes, occur twice, overlap or touch, one line per fault; or a cut
            window has no room for the moves.
    """
    table, remarks = _repaired(table, window) if repairs else (table, ())
    retained, centres, moves, size = on_torus(table, window)
    if window == "cut":
        distance = np.linalg.norm(moves, axis=1)
        moved = np.flatnonzero(distance > cut_window.TOLERANCE * table.radius.mean())
        farthest = moved[np.argsort(-distance[moved], kind="stable")][:MOST_FAULTS]
        listed = [f"row {table.row[retained[k]]} by {distance[k]:.3g}" for k in farthest]
        if len(moved) > MOST_FAULTS:
            listed.append(f"and {len(moved) - MOST_FAULTS} others by less")
        which = f": {', '.join(listed)}" if listed else ""
        remarks += (f'[cell] window = "cut": {len(moved)} of {len(table.row)} fibres moved{which}',)
    order = np.argsort(table.is_void[retained], kind="stable")
    rows, places = retained[order], (centres + moves)[order] % size / size[0]
    outlines, core = table.outlines[rows].per(size[0]).at(places), table.inner_radius[rows] / size[0]
    is_hollow = core > 0
    fibres = Arrangement(
        width=1.0,
        height=float(size[1] / size[0]),
        outlines=with_parts(outlines, [(is_hollow, Discs(places[is_hollow], core[is_hollow]))]),
        phase=tuple(table.phase[row] for row in rows),
        coating=np.where(is_hollow, outlines.radii - core, table.coating[rows] * outlines.radii),
        is_hollow=is_hollow,
        row=rows,
        origin=tuple(table.corner.tolist()),
        remarks=remarks,
    )
    shifted = arrangements.clear_shift(fibres)
    is_placed = table.left is not None and table.bottom is not None
    clear = min(LEAST_CLEARANCE * float(fibres.radii.mean()), arrangements.clearance(shifted))
    if not is_placed or arrangements.clearance(fibres) < clear or arrangements.in_voids(fibres, np.zeros((1, 2))).all():
        moved = (fibres.centres[0] - shifted.centres[0] + fibres.size / 2) % fibres.size - fibres.size / 2
        rounded = replace(_rounded(shifted), origin=tuple((table.corner + size[0] * moved).tolist()))
        return replace(rounded, mesh_order=np.lexsort((rounded.centres[:, 1], rounded.centres[:, 0])))
    return fibres if isinstance(fibres.outlines, Discs) else _rounded(fibres)


def _repaired(table: FibreTable, window: str) -> tuple[FibreTable, tuple[str, ...]]:
    """Shrink the fibres of a table that overlap slightly.

    Fibres that touch, or overlap by up to SAME_FIBRE times the smaller radius, shrink until they separate, but not
    across the border of a cut window. Returns the table, and one remark with the rows of the shrunk fibres, if any.
    """
    size, centres = table.size, table.places
    retained = np.flatnonzero(_without_images(table, centres, size, window == "cut")[0])
    outer = table.outlines[retained].at(centres[retained]).grown((table.coating * table.radius)[retained])
    first, second, gap, _, across = _gaps(table, retained, outer, size)
    least = LEAST_GAP * (table.outer_radius[retained][first] + table.outer_radius[retained][second]) / 2
    smaller = np.minimum(table.radius[retained][first], table.radius[retained][second])
    near = (gap < least) & (gap > -SAME_FIBRE * smaller) & ~(across & (window == "cut"))
    share = np.zeros(len(table.row))
    for fibre in (first[near], second[near]):
        sizes = np.stack([table.columns[name][retained[fibre]] for name in ("radius", "a", "b")])
        np.maximum.at(share, retained[fibre], (least - gap)[near] / np.nanmin(sizes, axis=0))
    names = {"radius"}.union(*REPLACING)
    # Slightly more than half, because a later check compares the gap with the reduced radii.
    columns = {name: values * (1 - 0.51 * share) if name in names else values for name, values in table.columns.items()}
    rows = table.row[share > 0]
    listed = f"rows {', '.join(map(str, rows[:MOST_FAULTS]))}{', ...' if len(rows) > MOST_FAULTS else ''}"
    words = f"{listed} are smaller by up to {100 * 0.51 * share.max():.2g} %" if len(rows) else "nothing to repair"
    return replace(table, columns=columns), (f'[cell] repair = "overlaps": {words}',)


def _rounded(arrangement: Arrangement) -> Arrangement:
    """Round the lengths of an arrangement to DECIMALS decimals, and its height to GMSH_DECIMALS.

    Coordinates of centres on the right or upper side become 0.
    """
    outlines, least = arrangement.outlines.rounded(arrangements.DECIMALS), 10.0**-arrangements.DECIMALS
    return replace(
        arrangement,
        height=round(arrangement.height, arrangements.GMSH_DECIMALS),
        outlines=outlines.at(np.where(outlines.centres >= arrangement.size - least, 0.0, outlines.centres)),
        coating=arrangement.coating.round(arrangements.DECIMALS),
    )


def on_torus(table: FibreTable, window: str) -> tuple[Int, Float, Float, Float]:
    """Check the fibres of a table and place them on the torus.

    Returns the rows (k,), centres (k, 2) and moves (k, 2) of fibres and voids, and the cell size (2,). Moves are 0
    except in cut windows. Raises MeshError as `table_arrangement` does.
    """
    size, centres, is_cut = table.size, table.places, window == "cut"
    # The largest length of every row, and the column of this length.
    names = ["radius", *(name for sizes in REPLACING for name in sizes)]
    sizes = np.nan_to_num(np.stack([table.columns[name] for name in names]))
    radius, column = sizes.max(axis=0), sizes.argmax(axis=0)
    faults: list[str] = []
    # Discs must reach into a periodic cell; in a cut window the centres must lie inside.
    axes = (("x", "width", table.left), ("y", "height", table.bottom))
    for (axis, name, corner), place, width in zip(axes, centres.T, size.tolist(), strict=True):
        over = np.maximum(-place, place - width)
        reach = np.full_like(radius, 2 * radius.max()) if corner is None else radius
        for k in np.flatnonzero(over > (SAME_FIBRE * radius if is_cut else (1 + SAME_FIBRE) * reach)).tolist():
            value = f"{axis} = {table.columns[axis][k]:g}"
            faults.append(f"row {table.row[k]}: {value}: lies outside the cell, of {name} {width:g}")
    for k in np.flatnonzero((2 * radius >= size.min()) | (radius < arrangements.SMALLEST_RADIUS * size[0])).tolist():
        limits = f"from {arrangements.SMALLEST_RADIUS * size[0]:g} to below {size.min() / 2:g} in this cell"
        faults.append(f"row {table.row[k]}: {names[column[k]]} = {radius[k]:g}: expected {limits}")
    least, most = COATINGS
    for k in np.flatnonzero((table.coating > 0) & ((table.coating < least) | (table.coating > most))).tolist():
        value = table.coating[k]
        faults.append(f"row {table.row[k]}: coating = {value:g}: expected 0, or from {least:g} to {most:g}")
    _raise_faults(table, faults)
    is_first, faults = _without_images(table, centres, size, is_cut)
    _raise_faults(table, faults)
    retained = np.flatnonzero(is_first)
    centres = centres[retained]
    outer = table.outlines[retained].at(centres).grown((table.coating * table.radius)[retained])
    # Fibres that overlap or touch; a cut window may have such pairs across the border.
    one, other, gap, together, across = _gaps(table, retained, outer, size)
    bad = np.flatnonzero((gap < LEAST_GAP * together / 2) & ~(across & is_cut))
    for k in bad[np.unique(np.stack([one[bad], other[bad]]), axis=1, return_index=True)[1]].tolist():
        i, j = table.row[retained[one[k]]], table.row[retained[other[k]]]
        who = f"rows {i} and {j}" if i != j else f"row {i} and its image"
        what = f"overlap by {-gap[k]:.3g}" if gap[k] < -LEAST_GAP * together[k] / 2 else "touch"
        least = SAME_FIBRE * min(table.radius[retained[[one[k], other[k]]]])
        hint = '; repair = "overlaps" makes them smaller' if -gap[k] < least else ""
        faults.append(f"{who}: {what}{' across the border' if across[k] else ''}{hint}")
    if across[bad].any():
        faults.append('fibres meet across the border: give the right width and height, or window = "cut"')
    _raise_faults(table, faults)
    if not is_cut:
        return retained, centres, np.zeros_like(centres), size
    try:
        return retained, centres, cut_window.moves(outer, size), size
    except MeshError as error:
        words = "fibres overlap across the border, and " + str(error)
        raise MeshError(f'[cell] {table.name}: window = "cut": {words}; leave some of them out') from error


def fibre_rows(table: FibreTable, window: str) -> Int:
    """Return the table indices (fibres,) of the fibres in the cell; voids and repeated images are left out."""
    is_first, _ = _without_images(table, table.places, table.size, window == "cut")
    return np.flatnonzero(is_first & ~table.is_void)


def listed_centres(table: FibreTable, window: str, centres: Float, rows: Int | None = None) -> Float:
    """Return, for periodic images `centres` (k, 2), the centres that the table lists, plus moves in a cut window.

    The images belong to the table indices `rows` (k,), by default to `fibre_rows`.
    """
    listed = table.centres[fibre_rows(table, window) if rows is None else rows]
    moves = (centres - listed + table.size / 2) % table.size - table.size / 2
    return np.asarray(listed + np.where(np.abs(moves) > cut_window.TOLERANCE * table.radius.mean(), moves, 0.0))


def _raise_faults(table: FibreTable, faults: list[str]) -> None:
    if faults:
        raise MeshError(*(f"[cell] {table.name}: {fault}" for fault in faults))


def _without_images(table: FibreTable, centres: Float, size: Float, is_cut: bool) -> tuple[Bool, list[str]]:
    """Return the mask (N,) of rows without an earlier image, all True if `is_cut`, and faults of images and places."""
    first, second, vector = arrangements.neighbours(centres, size, SAME_FIBRE * table.radius.max())
    radius, strength, distance = table.radius, table.strength, np.linalg.norm(vector, axis=1)
    smaller = np.minimum(radius[first], radius[second])
    near = (first != second) & (distance < SAME_FIBRE * smaller)
    first, second, vector = first[near], second[near], vector[near]
    in_place = np.linalg.norm(centres[second] - centres[first] - vector, axis=1) < SAME_FIBRE * radius[first]
    reach = table.outlines.support(np.broadcast_to(COMPARED, (len(radius), *COMPARED.shape)))
    both = np.column_stack([reach, radius, table.outer_radius])
    alike = (np.abs(both[second] - both[first]) < SAME_FIBRE * smaller[near, None]).all(axis=1)
    faults = []
    for i, j, is_here, is_alike in zip(first.tolist(), second.tolist(), in_place, alike, strict=True):
        rows = f"rows {table.row[i]} and {table.row[j]}"
        if is_here:
            faults.append(f"{rows}: are at one place; expected each fibre once")
        elif not is_cut and (not is_alike or table.phase[i] != table.phase[j] or strength[i] != strength[j]):
            faults.append(f"{rows}: are images of one fibre, a period apart; expected one shape, phase and strength")
    is_first = np.ones(len(radius), bool)
    is_first[np.maximum(first, second)] = is_cut
    return is_first, faults


def _gaps(table: FibreTable, kept: Int, outer: Outlines, size: Float) -> tuple[Int, Int, Float, Float, Bool]:
    """Find the pairs of near fibres among the rows `kept` (k,), with the outlines `outer`, coatings included.

    Returns, all (p,): indices into `kept` of both fibres, gaps, radius sums, and the mask of pairs across the border.
    """
    centres, radius = outer.centres, table.outer_radius[kept]
    first, second, vector = arrangements.neighbours(centres, size, 2 * outer.longest.max() * (1 + LEAST_GAP))
    normal, reach = outer.parting(first, second, vector)
    gap = (normal * vector).sum(axis=1) - reach
    across = np.linalg.norm(centres[second] - centres[first] - vector, axis=1) > SAME_FIBRE * radius[first]
    return first, second, gap, radius[first] + radius[second], across
