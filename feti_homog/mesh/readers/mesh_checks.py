"""List the faults of users' meshes; each fault names its first nodes or elements."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.mesh.coarse_mesh import SAME_PLACE, CoarseMesh, areas, edge_keys, edges, on_sides, twins
from feti_homog.mesh.periodic_topology import Torus, components
from feti_homog.mesh.readers.raw_mesh import DEBONDED, RawMesh, at, first_of
from feti_homog.schema import types
from feti_homog.typing import Float, Int, Int32

# All coincident pairs are listed up to this number, because it grows with the square of the nodes.
MOST_PAIRS = 1000
# Limit for pairs of an edge and a nearby node: their number may also grow with the square of the nodes.
MOST_CANDIDATES = 10**7
# Distance / edge length below which a node hangs on an edge; a flatter element would be of no use.
HANGING_DISTANCE = 1e-2
# Triangle area / square of the longest edge, up to which the area is zero except for rounding.
FLAT_AREA = 1e-9
SIDES = {(0, 0): "left", (0, 1): "right", (1, 0): "lower", (1, 1): "upper"}
NO_PARTNER = {(k, i): f"{name} side have no partner on the {SIDES[k, 1 - i]} side: " for (k, i), name in SIDES.items()}
# Fraction of the cell that rounding of coordinates may leave uncovered.
ROUNDING = 1e-6


def _listed(before: str, items: Sequence[Any] | Int | Int32, name: Callable[..., str], after: str = "") -> list[str]:
    """Return one fault: `before`, the first few items in words by `name`, and `after`; [] without items."""
    return [f"{before}{first_of(map(name, items), len(items))}{after}"] if len(items) else []


def unlabelled(mesh: RawMesh) -> list[str]:
    """List faults of groups: elements in no physical surface, or in several physical surfaces."""
    none = np.flatnonzero(np.isin(mesh.group, [k for k, names in enumerate(mesh.groups) if not names]))
    faults = _listed("", none, mesh.element, f": not in any {mesh.container}")
    used, first = np.unique(mesh.group, return_index=True)
    for names, number in zip([mesh.groups[group] for group in used], first, strict=True):
        if len(names) > 1:
            counts = f"is in {len(names)} {mesh.container}s: {', '.join(names)}"
            faults.append(f"{mesh.element(int(number))} {counts}; [cell.phases] names one phase, or change the groups")
    return faults


def not_finite(mesh: RawMesh) -> list[str]:
    """List nodes with coordinates that are not finite; else report a cell that is flat, too small or too large."""
    bad = np.flatnonzero(~np.isfinite(mesh.points).all(axis=1))
    if len(bad):
        return _listed("", bad, mesh.node, ": coordinates are not finite")
    size = np.ptp(mesh.points[:, :2], axis=0)
    if size.min() <= FLAT_AREA * size.max():
        axis = int(size.argmin())
        return [f"all nodes have {'xy'[axis]} = {mesh.points[0, axis]:.9g}: expected a mesh in the plane x, y"]
    if np.abs(mesh.points).max() <= types.LARGEST and size.min() >= types.SMALLEST:
        return []
    expected = f"expected lengths and coordinates from {types.SMALLEST} to {types.LARGEST}"
    return [f"the cell is {size[0]:.3g} x {size[1]:.3g}: {expected}"]


def not_planar(mesh: RawMesh) -> list[str]:
    """Report a mesh that is not planar, with the first node outside the plane of node 0."""
    height = mesh.points[:, 2]
    bad = np.flatnonzero(np.abs(height - height[0]) > SAME_PLACE * np.ptp(mesh.points[:, :2], axis=0).max())
    places = (f"{mesh.node(int(k))} has z = {height[k]:.9g}" for k in (*bad[:1], 0))
    return [f"the mesh is not planar: {', '.join(places)}"] if len(bad) else []


def flat(mesh: RawMesh) -> list[str]:
    """List triangles of zero area."""
    plane = mesh.points[:, :2]
    ends = plane[edges(mesh.triangles)]
    longest = ((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=1).reshape(-1, 3).max(axis=1)
    bad = np.flatnonzero(np.abs(areas(plane, mesh.triangles)) <= FLAT_AREA * longest)
    return _listed("", bad, mesh.element, ": zero area")


def duplicate_nodes(mesh: RawMesh) -> list[str]:
    """List pairs of nodes at one position in the plane.  If there are MOST_PAIRS or more, some may be missing."""
    plane = mesh.points[:, :2]
    reach = SAME_PLACE * np.ptp(plane, axis=0).max()
    column, row = ((plane - plane.min(axis=0)) // (reach / 2)).astype(np.int64).T
    square = column * (row.max() + 1) + row  # a diagonal is shorter than the reach
    order = np.argsort(square, kind="stable")
    same = square[order[1:]] == square[order[:-1]]
    pairs = np.sort(np.column_stack([order[:-1][same], order[1:][same]]), axis=1)
    if len(pairs) < MOST_PAIRS:
        pairs = cKDTree(plane).query_pairs(reach, output_type="ndarray")
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    return _listed("nodes at the same place (merge nodes): ", pairs, lambda pair: " and ".join(map(mesh.node, pair)))


def middle_nodes(mesh: RawMesh) -> list[str]:
    """List middle nodes at wrong positions, and edges whose triangles have different middle nodes."""
    middles, plane = mesh.middles, mesh.points[:, :2]
    if len(middles.tags) == 0:
        return []
    finite = np.asarray(np.isfinite(middles.points).all(axis=1))
    places = np.where(finite[:, None], middles.points, mesh.points[middles.edges].mean(axis=1))
    reach = SAME_PLACE * np.ptp(plane, axis=0).max()
    start, stop = plane[middles.edges[:, 0]], plane[middles.edges[:, 1]]
    bulge = np.zeros(len(start))
    for side in (plane.min(axis=0), plane.max(axis=0)):
        on_side = (np.abs(start - side) < reach) & (np.abs(stop - side) < reach)
        bulge = np.maximum(bulge, (on_side * np.abs(places[:, :2] - side)).max(axis=1))
    far = 2 * np.hypot(*(places[:, :2] - (start + stop) / 2).T) >= np.hypot(*(stop - start).T)
    kinds = {
        "coordinates are not finite": ~finite,
        "not in the plane": np.abs(places[:, 2] - mesh.points[0, 2]) > reach,
        f"off the straight side of the cell, by up to {bulge.max():.2g}{_snap(bulge.max(), plane)}": bulge > reach,
        "farther from the middle than half the edge's length": far,
    }
    faults = []
    for fault, is_faulty in kinds.items():
        first = np.flatnonzero(is_faulty)
        first = first[np.unique(middles.tags[first], return_index=True)[1]]
        faults += _listed("", first, lambda k: f"middle node {middles.tags[k]} {at(middles.points[k])}", f": {fault}")
    # Both triangles of an edge share one middle node.
    pairs = np.stack(twins(edge_keys(middles.edges, len(mesh.points))), axis=1)
    pairs = pairs[middles.tags[pairs[:, 0]] != middles.tags[pairs[:, 1]]]

    def on_edge(pair: Int) -> str:
        return f"nodes {' and '.join(map(str, middles.tags[pair]))} on {mesh.edge(middles.edges[pair[0]])}"

    return faults + _listed("two middle nodes on an edge: ", pairs, on_edge)


def overlapping(mesh: RawMesh) -> list[str]:
    """List edges with more than two triangles, or with two triangles on the same side."""
    pairs = edges(mesh.triangles)
    keys = edge_keys(pairs, len(mesh.points))
    _, first, where, number = np.unique(keys, return_index=True, return_inverse=True, return_counts=True)
    forward = np.bincount(where, pairs[:, 0] < pairs[:, 1], len(first))
    crowded, folded = np.flatnonzero(number > 2), np.flatnonzero((number == 2) & (forward != 1))
    before = "overlapping elements, more than two share an edge: "
    faults = _listed(before, crowded, lambda k: f"{mesh.edge(pairs[first[k]])} ({number[k]})")
    before = "overlapping elements on the same side of an edge: "
    return faults + _listed(before, folded, lambda k: mesh.edge(pairs[first[k]]))


def hanging_nodes(mesh: RawMesh, plane: Float, size: Float) -> list[str]:
    """List nodes that lie on inner edges with a single triangle.

    `plane` (n, 2) are positions in [0, `size`], exact on sides; with too many candidates, one fault counts the edges.
    """
    single = mesh.border
    inner = single[~on_sides(plane[single], size)]
    if len(inner) == 0:
        return []
    nodes = np.unique(inner)
    tree, middle, along = cKDTree(plane[nodes]), plane[inner].mean(axis=1), plane[inner[:, 1]] - plane[inner[:, 0]]
    reach = np.linalg.norm(along, axis=1) / 2
    step = 1 + len(inner) // 1000  # between the edges of a sample
    if step * tree.query_ball_point(middle[::step], reach[::step], return_length=True).sum() > MOST_CANDIDATES:
        return [f"{len(inner)} edges within the cell have one triangle only, and long ones cross: no mesh of a cell"]
    hanging = []
    for candidates, pair, vector in zip(tree.query_ball_point(middle, reach), inner, along, strict=True):
        inner_nodes = np.setdiff1d(nodes[candidates], pair)
        offset = plane[inner_nodes] - plane[pair[0]]
        distance = np.abs(vector[0] * offset[:, 1] - vector[1] * offset[:, 0])
        hanging += [(node, pair) for node in inner_nodes[distance < HANGING_DISTANCE * (vector @ vector)]]
    return _listed("hanging nodes: ", hanging, lambda hung: f"{mesh.node(hung[0])} on {mesh.edge(hung[1])}")


def missing_corners(plane: Float, origin: Float, size: Float) -> list[str]:
    """Return a fault on cell corners, of [0, `size`] from `origin`, without a node of `plane` (n, 2); or []."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size
    bare = corners[[not np.all(plane == corner, axis=1).any() for corner in corners]]
    missing = [at(corner + origin) for corner in bare]
    advice = f"{_nearest(plane, bare, plane)}; if a hole is there, shift the fibres until the corners lie in material"
    return [f"no node at the corner {', '.join(missing)} of the cell{advice}"] if missing else []


def _nearest(plane: Float, places: Float, free: Float) -> str:
    """Write how far `places` (k, 2) are from `free` nodes (m, 2); propose "snap" if each has a near node of its own."""
    away, nearest = cKDTree(free).query(places)
    distance, step = float(away.max(initial=0.0)), cKDTree(plane).query(free[nearest], 2)[0][:, 1].min(initial=np.inf)
    is_clear = 2 * distance < step and len(np.unique(nearest)) == len(nearest)
    return f"; the nearest nodes are up to {distance:.2g} away{_snap(distance, plane) if is_clear else ''}"


def _snap(distance: float, plane: Float) -> str:
    """Write the advice to snap nodes, with a tolerance 10 % above `distance` / width of the mesh `plane` (n, 2)."""
    return f': repair = "snap" in [cell] moves them, with snap_tolerance = {1.1 * distance / np.ptp(plane[:, 0]):.2g}'


def stray_lines(mesh: RawMesh) -> list[str]:
    """List debonded lines with an end that is no node of a triangle."""
    bad = mesh.debonded[~np.isin(mesh.debonded, mesh.node_tags).all(axis=1)]
    fault = f'lines in the {mesh.curve_container} "{DEBONDED}" that are no edges of triangles: '
    return _listed(fault, bad, lambda ends: f"that between nodes {ends[0]} and {ends[1]}")


def cannot_debond(mesh: RawMesh, torus: Torus) -> list[str]:
    """List the debonded lines that are not edges between a fibre and the matrix."""
    one, other, edge = torus.sides
    between, pairs = np.zeros(len(torus.edge_keys), bool), torus.mesh.debonded_edges
    between[edge] = (torus.mesh.phase[one] == 0) != (torus.mesh.phase[other] == 0)
    fit, n = torus.edges[between[torus.torus_edge]].astype(np.int32), len(torus.mesh.points)
    fault = f'lines in the {mesh.curve_container} "{DEBONDED}" that are not between a fibre and the matrix: '
    return _listed(fault, pairs[~np.isin(edge_keys(pairs, n), edge_keys(fit, n))], mesh.edge)


def unused_curves(mesh: RawMesh) -> tuple[str, ...]:
    """Return one remark that lists all curves except DEBONDED; () without such curves."""
    names = [f'"{name}"' for name in mesh.curves if name != DEBONDED]
    advice = f'not used; lines that are debonded from the start belong in "{DEBONDED}"'
    return tuple(_listed(f"{mesh.curve_container} ", names, str, f": {advice}"))


def not_periodic(mesh: RawMesh, plane: Float, size: Float) -> list[str]:
    """List nodes without a partner, unless their side has fewer nodes, and sides without inner nodes."""
    faults = []
    for axis, side in SIDES:
        nodes, partners = (np.flatnonzero(plane[:, axis] == k * size[axis]) for k in (side, 1 - side))
        along, other = plane[nodes, 1 - axis], np.sort(plane[partners, 1 - axis])
        after = np.clip(np.searchsorted(other, along), 1, len(other) - 1)
        gap = np.minimum(np.abs(other[after] - along), np.abs(other[after - 1] - along))
        shift, same = np.where(np.arange(3) == axis, (1 - 2 * side) * size[axis], 0.0), SAME_PLACE * size.max()
        if len(nodes) < len(partners) or not (gap > same).any():  # the side with more nodes lists them
            continue
        places = plane[nodes] + shift[:2]
        advice = _nearest(plane, places[gap > same], plane[cKDTree(places).query(plane)[0] > same])
        if len(nodes) > len(partners) and "snap" not in advice:
            advice = f"; {len(partners)} nodes face {len(nodes)}: mesh both sides alike (gmsh: Periodic Curve){advice}"
        expected = [f"{mesh.node(k)}, expected at {at(mesh.points[k] + shift)}" for k in nodes[gap > same]]
        faults += _listed(f"not periodic, nodes of the {NO_PARTNER[axis, side]}", expected, str, advice)
    # An element between bare sides would be its own neighbour.
    bare = [name for (axis, side), name in SIDES.items() if np.count_nonzero(plane[:, axis] == side * size[axis]) < 3]
    if bare:
        faults.append(f"no node between the corners of the {', '.join(bare)} side: expected one at least")
    return faults


def unmatched_sides(raw: RawMesh, mesh: CoarseMesh) -> list[str]:
    """List side edges that have no image because a void lies along the opposite side."""
    pairs, faults = edges(mesh.triangles), []
    for axis, side in SIDES if mesh.boundary == "periodic" else ():
        levels = (k * mesh.period[axis] for k in (side, 1 - side))
        sides, opposite = (pairs[np.all(mesh.points[pairs, axis] == level, axis=1)] for level in levels)
        keys, images = (edge_keys(mesh.representative[some], len(mesh.points)) for some in (sides, opposite))
        before = f"not periodic, edges of the {NO_PARTNER[axis, side]}"
        faults += _listed(before, sides[~np.isin(keys, images)], raw.edge)
    return faults


def islands(raw: RawMesh, torus: Torus) -> list[str]:
    """List floating parts: mesh parts that share no edge with the largest part."""
    part = components(len(raw.triangles), *torus.sides[:2])
    loose = np.flatnonzero(part != np.bincount(part).argmax())
    first = loose[np.unique(part[loose], return_index=True)[1]]
    return _listed("floating parts, separated from all others by voids: the part with ", first, raw.element)


def void_faults(raw: RawMesh, torus: Torus, has_voids: bool) -> list[str]:
    """List unexpected holes, voids without an area, touching voids, voids at sides with tractions, uncovered areas."""
    mesh, pairs = torus.mesh, torus.low_copies(torus.at_void)
    empty = 1.0 - areas(mesh.points, mesh.triangles).sum() / mesh.period.prod()
    if len(pairs) == 0:
        return [f"the elements leave {empty:.3g} of the cell uncovered"] if empty > ROUNDING else []
    if empty > ROUNDING and not has_voids:
        where = f"holes, {100 * empty:.3g} % of the cell, the first beside {raw.edge(pairs[0])}"
        unsaved = " (gmsh saves no surface outside physical groups)" if raw.container == "physical surface" else ""
        return [f"{where}: expected elements there{unsaved}, or voids = true in [cell] if holes are voids"]
    ends = mesh.representative[pairs]
    crowded = pairs[(np.bincount(ends.ravel(), minlength=len(mesh.points))[ends] > 2).any(axis=1)]
    faults = _listed("voids that touch in a node, as at ", crowded, raw.edge)
    if mesh.boundary == "traction":
        at_sides = pairs[on_sides(mesh.points[pairs].reshape(-1, 1, 2), mesh.period).reshape(-1, 2).any(axis=1)]
        line = 'voids at the sides, where boundary = "traction" has no material to pull at: '
        faults += _listed(line, at_sides, raw.edge)
    slits = first_of(map(raw.edge, pairs), len(pairs), shown=2)
    return faults + ([f"voids without an area, beside {slits}"] if empty < ROUNDING else [])
