"""The checks of a user's mesh: each function finds one kind of fault and names the first offenders."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.mesh.coarse_mesh import CoarseMesh, areas, edge_keys, edges, void_edges
from feti_homog.mesh.periodic_topology import Torus, components, edge_pairs
from feti_homog.mesh.readers.raw_mesh import DEBONDED, RawMesh, at, first_of
from feti_homog.typing import Bool, Float, Int32

# Nodes nearer than this, relative to the cell, are at the same place: files may round coordinates.
SAME_PLACE = 1e-7
# Nodes at the same place of which all pairs are listed: their number grows as the square of that of nodes.
MOST_PAIRS = 1000
# Pairs of an edge and a node near it that are looked at; they may grow as the square too.
MOST_CANDIDATES = 10**7
# A node nearer to an edge than this, relative to its length, hangs on it; an element that flat would be of no use.
HANGING_DISTANCE = 1e-2
# Area of a triangle, relative to its longest edge squared, up to which it is zero but for rounding of coordinates.
FLAT_AREA = 1e-9
# Lengths that can be computed with, as of the numbers in a case file.
SMALLEST, LARGEST = 1e-100, 1e100
SIDES = {(0, 0): "left", (0, 1): "right", (1, 0): "lower", (1, 1): "upper"}
# Share of the cell that rounding of coordinates may leave uncovered.
ROUNDING = 1e-6


def unlabelled(mesh: RawMesh) -> list[str]:
    """Elements that are in no physical surface, or in several."""
    faults = []
    none = np.flatnonzero(np.isin(mesh.group, [k for k, names in enumerate(mesh.groups) if not names]))
    if len(none):
        faults.append(f"{first_of(map(mesh.element, none), len(none))}: not in any {mesh.container}")
    used, first = np.unique(mesh.group, return_index=True)
    for names, number in zip([mesh.groups[group] for group in used], first, strict=True):
        if len(names) > 1:
            element = mesh.element(int(number))
            counts = f"is in {len(names)} {mesh.container}s: {', '.join(names)}"
            faults.append(f"{element} {counts}; [cell.phases] names the phases among them")
    return faults


def not_finite(mesh: RawMesh) -> list[str]:
    """Nodes whose coordinates are not numbers, or no lengths to compute with."""
    bad = np.flatnonzero(~np.isfinite(mesh.points).all(axis=1))
    if len(bad):
        return [f"{first_of(map(mesh.node, bad), len(bad))}: coordinates are not finite"]
    size = np.ptp(mesh.points[:, :2], axis=0)
    if np.abs(mesh.points).max() > LARGEST or size.min() < SMALLEST:
        return [
            f"the cell is {size[0]:.3g} x {size[1]:.3g}: expected lengths and coordinates from {SMALLEST} to {LARGEST}"
        ]
    return []


def not_planar(mesh: RawMesh) -> list[str]:
    """Nodes off the plane of the first one."""
    height = mesh.points[:, 2]
    bad = np.flatnonzero(np.abs(height - height[0]) > SAME_PLACE * np.ptp(mesh.points[:, :2], axis=0).max())
    if len(bad) == 0:
        return []
    where = f"{mesh.node(int(bad[0]))} has z = {height[bad[0]]:.9g}, {mesh.node(0)} has z = {height[0]:.9g}"
    return [f"the mesh is not planar: {where}"]


def flat(mesh: RawMesh) -> list[str]:
    """Triangles of zero area."""
    plane = mesh.points[:, :2]
    ends = plane[edges(mesh.triangles)]
    longest = ((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=1).reshape(-1, 3).max(axis=1)
    found = np.flatnonzero(np.abs(areas(plane, mesh.triangles)) <= FLAT_AREA * longest)
    return [f"{first_of(map(mesh.element, found), len(found))}: zero area"] if len(found) else []


def duplicate_nodes(mesh: RawMesh) -> list[str]:
    """Different nodes at the same place."""
    plane = mesh.points[:, :2]
    near = SAME_PLACE * np.ptp(plane, axis=0).max()
    column, row = ((plane - plane.min(axis=0)) // (near / 2)).astype(np.int64).T
    square = column * (row.max() + 1) + row  # all of whose nodes are nearer than that to each other
    order = np.argsort(square, kind="stable")
    same = square[order[1:]] == square[order[:-1]]
    pairs = np.sort(np.column_stack([order[:-1][same], order[1:][same]]), axis=1)
    if len(pairs) < MOST_PAIRS:
        pairs = cKDTree(plane).query_pairs(near, output_type="ndarray")
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    names = (f"{mesh.node(a)} and {mesh.node(b)}" for a, b in pairs)
    return [f"nodes at the same place: {first_of(names, len(pairs))}"] if len(pairs) else []


def overlapping(mesh: RawMesh) -> list[str]:
    """Edges of more than two triangles, or of two on the same side."""
    pairs = edges(mesh.triangles)
    _, first, where, number = np.unique(
        edge_keys(pairs, len(mesh.points)), return_index=True, return_inverse=True, return_counts=True
    )
    forward = np.bincount(where, pairs[:, 0] < pairs[:, 1], len(first))
    crowded = np.flatnonzero(number > 2)
    folded = np.flatnonzero((number == 2) & (forward != 1))
    faults = []
    if len(crowded):
        names = (f"{mesh.edge(pairs[first[k]])} ({number[k]})" for k in crowded)
        faults.append(f"overlapping elements, more than two share an edge: {first_of(names, len(crowded))}")
    if len(folded):
        names = (mesh.edge(pairs[first[k]]) for k in folded)
        faults.append(f"overlapping elements on the same side of an edge: {first_of(names, len(folded))}")
    return faults


def hanging_nodes(mesh: RawMesh, plane: Float, size: Float) -> list[str]:
    """Nodes within edges of one triangle only that are not on the boundary of the cell.

    `plane` (n, 2) are positions with the lower left corner at the origin, nodes on sides exactly there.
    """
    pairs = edges(mesh.triangles)
    _, first, number = np.unique(edge_keys(pairs, len(plane)), return_index=True, return_counts=True)
    single = pairs[first[number == 1]]
    ends = plane[single]
    on_side = np.any(np.all(ends == 0, axis=1) | np.all(ends == size, axis=1), axis=1)
    inner = single[~on_side]
    if len(inner) == 0:
        return []
    nodes = np.unique(inner)
    tree, middle = cKDTree(plane[nodes]), plane[inner].mean(axis=1)
    reach = np.linalg.norm(plane[inner[:, 1]] - plane[inner[:, 0]], axis=1) / 2
    some = slice(None, None, 1 + len(inner) // 1000)
    if some.step * tree.query_ball_point(middle[some], reach[some], return_length=True).sum() > MOST_CANDIDATES:
        return [f"{len(inner)} edges within the cell have one triangle only, and long ones cross: no mesh of a cell"]
    hanging = _hanging(plane, inner, nodes, tree.query_ball_point(middle, reach))
    names = (f"{mesh.node(node)} on {mesh.edge(pair)}" for node, pair in hanging)
    return [f"hanging nodes: {first_of(names, len(hanging))}"] if hanging else []


def _hanging(plane: Float, pairs: Int32, nodes: Int32, near: Sequence[list[int]]) -> list[tuple[int, tuple[int, int]]]:
    """Nodes that lie within edges (k, 2), not at their ends, with these edges; of `nodes` those `near` each edge."""
    found = []
    start, stop = plane[pairs[:, 0]], plane[pairs[:, 1]]
    for candidates, pair, a, b in zip(near, pairs, start, stop, strict=True):
        others = np.setdiff1d(nodes[candidates], pair)
        along, away = b - a, plane[others] - a
        distance = np.abs(along[0] * away[:, 1] - along[1] * away[:, 0])
        close = others[distance < HANGING_DISTANCE * (along @ along)]
        found += [(int(node), (int(pair[0]), int(pair[1]))) for node in close]
    return found


def missing_corners(plane: Float, origin: Float, size: Float) -> list[str]:
    """Corners of the bounding rectangle without a node."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size
    missing = [corner for corner in corners if not np.all(plane == corner, axis=1).any()]
    names = first_of((at(corner + origin) for corner in missing), len(missing), shown=4)
    return [f"no node at the corner {names} of the cell"] if missing else []


def too_large(plane: Float, triangles: Int32, size: Float) -> list[str]:
    """Triangles that add up to more than the rectangle."""
    total, whole = abs(areas(plane, triangles).sum()), size.prod()
    if total <= (1 + 1e-6) * whole:
        return []
    return [f"the elements overlap: their area is {total:.9g}, that of the cell {whole:.9g}"]


def unrefined_sides(plane: Float, size: Float) -> list[str]:
    """Sides without a node between their corners: there an element would be its own neighbour."""
    bare = [
        SIDES[axis, side]
        for axis in (0, 1)
        for side, level in enumerate((0.0, size[axis]))
        if np.count_nonzero(plane[:, axis] == level) < 3
    ]
    return (
        [f"no node between the corners of the {first_of(bare, len(bare), 4)} side: expected one at least"]
        if bare
        else []
    )


def stray_lines(mesh: RawMesh) -> list[str]:
    """Debonded lines whose ends are not nodes of triangles."""
    bad = mesh.debonded[~np.isin(mesh.debonded, mesh.node_tags).all(axis=1)]
    names = (f"that between nodes {start} and {stop}" for start, stop in bad)
    what = f'lines in the {mesh.curve_container} "{DEBONDED}" that are no edges of triangles'
    return [f"{what}: {first_of(names, len(bad))}"] if len(bad) else []


def cannot_debond(mesh: RawMesh, pairs: Int32, fit: Bool) -> list[str]:
    """Debonded lines (d, 2) that are not edges between a fibre and the matrix; `fit` (d,) marks those that are."""
    bad = pairs[~fit]
    what = f'lines in the {mesh.curve_container} "{DEBONDED}" that are not between a fibre and the matrix'
    return [f"{what}: {first_of(map(mesh.edge, bad), len(bad))}"] if len(bad) else []


def unused_curves(mesh: RawMesh) -> tuple[str, ...]:
    """List the curves that are not DEBONDED, in one line."""
    names = [f'"{name}"' for name in mesh.curves if name != DEBONDED]
    if not names:
        return ()
    return (
        f"{mesh.curve_container} {first_of(names, len(names))}: not used; lines that are debonded from the start "
        f'belong in "{DEBONDED}"',
    )


def not_periodic(mesh: RawMesh, plane: Float, size: Float) -> list[str]:
    """Nodes on a side without a partner at the same place of the opposite one."""
    faults = []
    for axis in (0, 1):
        sides = [np.flatnonzero(plane[:, axis] == level) for level in (0.0, size[axis])]
        for here in (0, 1):
            other = np.sort(plane[sides[1 - here], 1 - axis])
            own = plane[sides[here], 1 - axis]
            after = np.clip(np.searchsorted(other, own), 1, len(other) - 1)
            away = np.minimum(np.abs(other[after] - own), np.abs(other[after - 1] - own))
            alone = sides[here][away > SAME_PLACE * size.max()]
            if len(alone):
                shift = np.where(np.arange(3) == axis, (1 - 2 * here) * size[axis], 0.0)
                names = (f"{mesh.node(k)}, expected at {at(mesh.points[k] + shift)}" for k in alone)
                faults.append(
                    f"not periodic, nodes of the {SIDES[axis, here]} side have no partner on the "
                    f"{SIDES[axis, 1 - here]} side: {first_of(names, len(alone))}"
                )
    return faults


def unmatched_sides(raw: RawMesh, mesh: CoarseMesh) -> list[str]:
    """Edges on a side of the cell whose image on the opposite side is no edge: a void lies along the side."""
    pairs = edges(mesh.triangles)
    faults = []
    for axis in (0, 1):
        on = [np.all(mesh.points[pairs, axis] == level, axis=1) for level in (0.0, mesh.period[axis])]
        keys = [edge_keys(mesh.representative[pairs[own]].astype(np.int32), len(mesh.points)) for own in on]
        for here in (0, 1):
            alone = pairs[on[here]][~np.isin(keys[here], keys[1 - here])]
            if len(alone):
                sides = f"edges of the {SIDES[axis, here]} side have no partner on the {SIDES[axis, 1 - here]} side"
                faults.append(f"not periodic, {sides}: {first_of(map(raw.edge, alone), len(alone))}")
    return faults


def islands(raw: RawMesh, mesh: CoarseMesh) -> list[str]:
    """Parts of the mesh that share no edge with the largest: nothing would hold them."""
    part = components(len(mesh.triangles), *edge_pairs(Torus.of(mesh).triangle_torus_edges))
    loose = np.flatnonzero(part != np.bincount(part).argmax())
    first = loose[np.unique(part[loose], return_index=True)[1]]
    held = "floating parts, which voids part from all others"
    return [f"{held}: that with {first_of(map(raw.element, first), len(first))}"] if len(first) else []


def void_faults(raw: RawMesh, mesh: CoarseMesh, has_voids: bool) -> list[str]:
    """Holes where no voids are expected, voids without an area or that touch, and uncovered parts without edges."""
    pairs, empty = void_edges(mesh), 1.0 - areas(mesh.points, mesh.triangles).sum() / mesh.period.prod()
    if len(pairs) == 0:
        return [f"the elements leave {empty:.3g} of the cell uncovered"] if empty > ROUNDING else []
    if empty > ROUNDING and not has_voids:
        where = f"holes, {100 * empty:.3g} % of the cell, the first beside {raw.edge(pairs[0])}"
        return [f"{where}: expected elements there, or voids = true in [cell] if holes are voids"]
    crowded = pairs[_is_crowded(mesh, pairs)]
    names = first_of(map(raw.edge, crowded), len(crowded))
    touching = [f"voids that touch in a node, as at {names}"] if len(crowded) else []
    slits = first_of(map(raw.edge, pairs), len(pairs), shown=2)
    return touching + ([f"voids without an area, beside {slits}"] if empty < ROUNDING else [])


def _is_crowded(mesh: CoarseMesh, pairs: Int32) -> Bool:
    """(k,) whether an end of each edge beside a void has more than two of them."""
    ends = mesh.representative[pairs]
    return np.asarray((np.bincount(ends.ravel(), minlength=len(mesh.points))[ends] > 2).any(axis=1))
