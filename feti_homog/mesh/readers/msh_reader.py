"""Read a mesh file of a user: name the phases, repair and check the mesh, and convert it into a coarse mesh."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from feti_homog.errors import MeshError, escaped
from feti_homog.mesh.coarse_mesh import SAME_PLACE, CoarseMesh, areas, paired_sides, representatives
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.readers import abaqus_file, gmsh_file, mesh_checks, vtk_file, vtu_file
from feti_homog.mesh.readers.raw_mesh import DEBONDED, RawMesh, first_of
from feti_homog.mesh.readers.round_interfaces import with_bent_edges, with_circles, with_ellipses
from feti_homog.microstructure import phase_names
from feti_homog.schema import wording
from feti_homog.typing import Float, Int32

LOADERS = {
    ".msh": gmsh_file.load,
    ".inp": abaqus_file.load,
    ".vtu": vtu_file.load,
    ".vtk": vtk_file.load,
    ".mesh": vtk_file.load_medit,
}
NUMBER = re.compile("number [0-9]+")
"""Names of groups that have only a number in the file."""
HOLE = "expected no elements in a void, which is a hole in the mesh (with voids = true in [cell])"
Selectors = Mapping[str, tuple[str | int, ...]]
# Sine of the turn at a hull node, up to which the node lies on a straight side.
STRAIGHT = 1e-5
# Slope up to which sides count as upright; least fraction of the hull that a cell with voids fills.
UPRIGHT, FILLED = 1e-2, 0.4


def read(
    path: Path,
    snap: float | None = None,
    phases: Selectors | None = None,
    has_voids: bool = False,
    boundary: str = "periodic",
    materials: Collection[str] = (),
    order: int = 2,
) -> CoarseMesh:
    """Read the coarse mesh from a file, and move it to [0, width] x [0, height].

    The file, with a suffix in LOADERS, has triangles or quadrilaterals of first or second order, in physical surfaces
    "matrix", "fibre", "glass", ... The elements fill a rectangle, except voids if `has_voids`. In a periodic cell,
    opposite sides have matching nodes. Lines in the curve "debonded" are edges between a fibre and the matrix that are
    debonded from the start. Round interfaces become circles (`with_circles`), elliptic interfaces ellipses
    (`with_ellipses`); other interfaces follow the middle nodes (`with_bent_edges`). `phases` maps phases to names and
    numbers in the file (`with_phases`); messages propose the phases in `materials`. With the tolerance `snap`, relative
    to the width, nodes first move onto sides (`snapped`). A remark reports `order` 1 for a quadratic mesh.

    Raises:
        MeshError: all faults of the first faulty stage: file, labels, shapes, middle nodes, connections, sides,
            debonded lines.
    """
    try:
        loaded = LOADERS[path.suffix.lower()](path)
        raw = with_phases(loaded, phases or {})
    except OSError as error:
        raise MeshError(f"{path}: cannot be read: {error.strerror}") from None
    except MeshError as error:
        raise MeshError(*(f"{path.name}: {fault}" for fault in error.faults)) from None
    unknown = unknown_phases(raw, known_names(loaded), phases or {}, sorted(materials, key=phase_names.COATING.__eq__))
    _refuse(path.name, mesh_checks.unlabelled(raw), unknown, mesh_checks.stray_lines(raw))
    _refuse(path.name, mesh_checks.not_finite(raw))
    raw, moved = (raw, 0.0) if snap is None else snapped(raw, snap)
    mesh = made(raw, path.name, has_voids, boundary)
    lower = "[cell] order = 1: linear elements, but the file has quadratic elements: order = 2 keeps them"
    linear = [lower] if order == 1 and len(raw.middles.tags) else []
    remarks = (*mesh_checks.unused_curves(raw), *linear, *mesh.remarks)
    return replace(mesh, snapped=moved, remarks=tuple(escaped(f"{path.name}: {remark}") for remark in remarks))


def made(raw: RawMesh, path: str, has_voids: bool = True, boundary: str = "periodic") -> CoarseMesh:
    """Check a raw mesh and convert it; faults begin with `path`. Raises MeshError, see `read`."""
    _refuse(path, mesh_checks.not_planar(raw), mesh_checks.flat(raw), mesh_checks.duplicate_nodes(raw))
    # All triangles become counter-clockwise; middle nodes belong to edges of either direction.
    clockwise = areas(raw.points[:, :2], raw.triangles) < 0
    raw = replace(raw, triangles=np.where(clockwise[:, None], raw.triangles[:, ::-1], raw.triangles))
    _refuse(path, mesh_checks.middle_nodes(raw))
    _refuse(path, _lattice(raw.points[:, :2], raw.triangles))
    origin, size = raw.points[:, :2].min(axis=0), np.ptp(raw.points[:, :2], axis=0)
    plane = raw.points[:, :2] - origin
    for level in (np.zeros(2), size):
        plane = np.where(np.abs(plane - level) < SAME_PLACE * size.max(), level, plane)
    corners = mesh_checks.missing_corners(plane, origin, size)
    _refuse(path, mesh_checks.overlapping(raw), mesh_checks.hanging_nodes(raw, plane, size), corners)
    total, cell = abs(areas(plane, raw.triangles).sum()), size.prod()
    overlap = [f"the elements overlap: their area is {total:.9g}, that of the cell {cell:.9g}"]
    _refuse(path, overlap if total > (1 + mesh_checks.ROUNDING) * cell else [])
    _refuse(path, mesh_checks.not_periodic(raw, plane, size) if boundary == "periodic" else [])
    shift = size if boundary == "periodic" else np.full(2, np.inf)
    for axis, low, high in paired_sides(plane, shift):
        plane[high, 1 - axis] = plane[low, 1 - axis]
    names, (width, height) = [group[0] for group in raw.groups], size.tolist()
    phases = ("matrix", *sorted(set(names) - {"matrix"}))
    phase = np.array([phases.index(name) for name in names], np.int32)[raw.group]
    mesh = CoarseMesh(
        width=width,
        height=height,
        points=plane,
        triangles=raw.triangles,
        phase=phase,
        phases=phases,
        precedence=phase,
        representative=representatives(plane, *shift),
        debonded_edges=np.searchsorted(raw.node_tags, raw.debonded).astype(np.int32),
        origin=(float(origin[0]), float(origin[1])),
        boundary=boundary,
    )
    _refuse(path, mesh_checks.unmatched_sides(raw, mesh))
    torus = Torus.of(mesh)
    _refuse(path, mesh_checks.islands(raw, torus), mesh_checks.void_faults(raw, torus, has_voids))
    _refuse(path, mesh_checks.cannot_debond(raw, torus))
    middles = replace(raw.middles, points=raw.middles.points - [*origin, 0.0])
    pairs = torus.low_copies(torus.is_outline)
    mesh = with_circles(mesh, pairs, middles)
    # Number the fibres before edges bend, so that round fibres come first.
    numbers = Torus.of(mesh).constituent.astype(np.int32)
    return replace(with_bent_edges(with_ellipses(mesh, pairs, middles), pairs, middles), precedence=numbers)


def _refuse(path: str, *faults: Sequence[str]) -> None:
    """Raise MeshError if there are faults; each line begins with `path`."""
    if lines := [f"{path}: {fault}" for kind in faults for fault in kind]:
        raise MeshError(*lines)


def snapped(raw: RawMesh, tolerance: float) -> tuple[RawMesh, float]:
    """Move outer nodes onto the sides of a rectangle; also return the largest move.

    A side is at the median of outer nodes within twice the `tolerance`, relative to the width, of the outermost node.
    Outer nodes within the tolerance move to the side. Two nodes on opposite sides are partners if each is the nearest
    to the other, within the tolerance along the side; both move to the mean position along the side, except corners.
    Middle nodes on sides move midway between the edge ends. Nodes beyond the tolerance stay, and meshes with nodes that
    are not finite do not change: later checks report such nodes.
    """
    plane = raw.points[:, :2].copy()
    outer = np.unique(raw.border)
    if not np.isfinite(plane).all() or not len(outer):
        return raw, 0.0
    reach = tolerance * float(np.ptp(plane[:, 0]))
    sides = {}
    for axis in (0, 1):
        for end, extreme in (("low", np.min), ("high", np.max)):
            along = plane[outer, axis]
            place = np.median(along[np.abs(along - extreme(along)) <= 2.0 * reach])
            sides[axis, end] = outer[np.abs(along - place) <= reach]
            plane[sides[axis, end], axis] = place
    for axis in (0, 1):
        low, high, along = sides[axis, "low"], sides[axis, "high"], plane[:, 1 - axis]
        distance, to_high = cKDTree(along[high, None]).query(along[low, None])
        to_low = cKDTree(along[low, None]).query(along[high, None])[1]
        mutual = (to_low[to_high] == np.arange(len(low))) & (distance <= reach)
        corners = along.min(), along.max()
        mutual &= ~np.isin(along[low], corners) & ~np.isin(along[high[to_high]], corners)
        a, b = low[mutual], high[to_high[mutual]]
        along[a] = along[b] = (along[a] + along[b]) / 2
    moved = float(np.linalg.norm(plane - raw.points[:, :2], axis=1).max())
    points, middles = np.column_stack([plane, raw.points[:, 2]]), raw.middles
    on_side = np.any([np.isin(middles.edges, side).all(axis=1) for side in sides.values()], axis=0)
    straight = np.where(on_side[:, None], points[middles.edges].mean(axis=1), middles.points)
    return replace(raw, points=points, middles=replace(middles, points=straight)), moved


def _lattice(plane: Float, triangles: Int32) -> list[str]:
    """Return the fault that a cell is a parallelogram, a turned rectangle or a hexagon; [] for other cells."""
    hull = ConvexHull(plane)
    corners = plane[hull.vertices]
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    # A node on a straight side is not a corner.
    corners = corners[turn > STRAIGHT * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)]
    if len(corners) not in (4, 6) or np.abs(areas(plane, triangles)).sum() < FILLED * hull.volume:
        return []
    sides, half = np.roll(corners, -1, axis=0) - corners, len(corners) // 2
    lengths = np.abs(sides[:half])
    is_upright = half == 2 and bool((lengths.min(axis=1) <= UPRIGHT * lengths.max(axis=1)).all())
    if np.abs(sides[:half] + sides[half:]).max() > STRAIGHT * np.abs(sides).max() or is_upright:
        return []
    name = "parallelogram" if half == 2 else "hexagon"
    if half == 2 and abs(sides[0] @ sides[1]) <= STRAIGHT * (sides[0] @ sides[0] + sides[1] @ sides[1]):
        name = f"rectangle turned by {np.degrees(np.arctan2(sides[0, 1], sides[0, 0])) % 90.0:.3g} degrees"
    return [f'the cell is a {name}, expected a rectangle: see "Lattices that are not rectangular" in meshes/README.md']


def with_phases(mesh: RawMesh, phases: Selectors) -> RawMesh:
    """Rename groups to the phases that select their name or number or, if none does, one of their aliases.

    Groups that no phase selects keep their names. The entry `debonded` selects curves.

    Raises:
        MeshError: names or numbers that no element has, or groups in two phases, one per line.
    """
    pairs, faults = [(phase, name) for phase, selected in phases.items() for name in selected], list[str]()
    phase_of = dict[str, str]()
    for phase, name in pairs:
        of_curves = phase == DEBONDED
        selected = f"[cell.phases] {wording.toml_key(phase)} = {wording.toml_value(name)}"
        if _key(name) not in map(_key, _names(mesh, of_curves)):
            kind = "lines" if of_curves else "elements"
            faults.append(f"{selected}: no {kind} of that name; {known_names(mesh, of_curves)}")
        elif not of_curves and (other := phase_of.setdefault(_key(name), phase)) != phase:
            faults.append(f"{selected}: also in {other}; expected each group in one phase")
    if faults:
        raise MeshError(*faults)
    lines = set(map(_key, phases.get(DEBONDED, ())))
    curves = {DEBONDED if _key(name) in lines else name: ends for name, ends in mesh.curves.items()}
    groups = list[tuple[str, ...]]()
    for names, aliases in zip(mesh.groups, mesh.aliases or ((),) * len(mesh.groups), strict=True):
        numbered = (*names, *filter(NUMBER.fullmatch, aliases))  # a name and its number may not be in two phases
        groups.append(_selecting(numbered, phase_of) or _selecting(aliases, phase_of) or names)
    return replace(mesh, groups=tuple(groups), curves=curves)


def _selecting(names: tuple[str, ...], phase_of: Mapping[str, str]) -> tuple[str, ...]:
    """Return the phases of group names, once each: `phase_of` maps `_key` to the phase; other names have none."""
    return tuple(dict.fromkeys(phase_of[_key(name)] for name in names if _key(name) in phase_of))


def _key(name: str | int) -> str:
    """Convert a group name or number into a key for comparisons that ignore case."""
    return (f"number {name}" if isinstance(name, int) else name).casefold()


def unknown_phases(mesh: RawMesh, content: str, phases: Selectors, materials: Collection[str]) -> list[str]:
    """List groups whose name is no phase, and a missing matrix; the last fault proposes phases for the case.

    `content` lists the names in the file, `phases` has the entries of the case so far; the proposal uses `materials`.
    """
    names = list(dict.fromkeys(chain.from_iterable(mesh.groups)))
    has_matrix = "matrix" in names
    expected = 'expected "matrix", "fibre", "glass", ... of letters, digits, _ and -, "fibre:2"'
    # Without a matrix, the user must rename all groups: numbers are then no further fault.
    faults = [
        f'{mesh.container} "{name}" is not a phase: {HOLE if name == phase_names.VOID else expected}'
        for name in names
        if not phase_names.PHASE.fullmatch(name) and (has_matrix or not NUMBER.fullmatch(name))
    ]
    if not has_matrix:
        faults.append(f'no {mesh.container} is named "matrix"')
    if not faults:
        return []
    faults[-1] += f"; {content}"
    shares: dict[str, float] = {}
    with np.errstate(all="ignore"):  # coordinates are checked later
        sizes = np.bincount(mesh.group, np.abs(areas(mesh.points[:, :2], mesh.triangles)), len(mesh.groups))
        for group, percent in zip(mesh.groups, 100 * sizes / sizes.sum(), strict=True):
            if group and group[0] != phase_names.VOID:
                shares[group[0]] = shares.get(group[0], 0.0) + percent
    usual = ("matrix", *materials, "fibre", *(f"fibre:{k}" for k in range(2, len(shares) + 1)))
    mixed = any("fib" not in name.casefold() for name in shares)  # numbers of an array are called fibre, fibre:2, ...
    order = sorted(shares, key=lambda k: (mixed and k in materials, mixed and "fib" in k.casefold(), -shares[k]))
    others = sorted({*order} - {"matrix", *phases}, key=lambda k: (k.casefold() != "matrix", order.index(k)))
    to_matrix = [] if has_matrix else others[:1]
    if renamed := to_matrix + [name for name in others if name not in (*to_matrix, *usual)]:  # usual names stay
        entries = {name: wording.toml_value(list(some) if len(some) > 1 else some[0]) for name, some in phases.items()}
        alike = {k: k.casefold() for k in renamed if k.casefold() in {*usual} - {*names, *entries}}
        entries |= {name: _as_selected(k) for k, name in alike.items()}
        targets = [name for name in dict.fromkeys(usual) if name not in (*names, *entries)]
        entries |= dict(zip(targets, (_as_selected(k) for k in renamed if k not in alike), strict=False))
        written = ", ".join(f"{wording.toml_key(a)} = {b}" for a, b in entries.items())
        condition = f"If {_as_selected(to_matrix[0])} is the matrix" if to_matrix else "If these are fibres"
        verb = "set in" if phases else "add to"
        listed = first_of((f"{_as_selected(name)}: {share:.3g} %" for name, share in shares.items()), len(shares), 20)
        faults[-1] += f". {condition}, {verb} [cell]: phases = {{{written}}}. Shares of the area: {listed}"
    return faults


def known_names(mesh: RawMesh, of_curves: bool = False) -> str:
    """List the names of groups, or of curves, in a phrase for messages."""
    names = _names(mesh, of_curves)
    return f"the file has {first_of(map(_as_selected, names), len(names), 20) or 'none'}"


def _names(mesh: RawMesh, of_curves: bool) -> list[str]:
    return list(dict.fromkeys(mesh.curves if of_curves else chain(*mesh.groups, *mesh.aliases)))


def _as_selected(name: str) -> str:
    """Write the name or number of a group as in a case file."""
    return name.removeprefix("number ") if NUMBER.fullmatch(name) else wording.toml_value(name)
