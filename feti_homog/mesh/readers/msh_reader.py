"""Read a user's mesh: name its phases, move it onto a rectangle, check it, and make a coarse mesh of it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from feti_homog.case import cell_section
from feti_homog.errors import MeshError, escaped
from feti_homog.mesh.coarse_mesh import CoarseMesh, areas, can_debond, edge_keys, edges, paired_sides, representatives
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.readers import abaqus_file, gmsh_file, mesh_checks, vtk_file, vtu_file
from feti_homog.mesh.readers.raw_mesh import DEBONDED, RawMesh, first_of
from feti_homog.mesh.readers.round_interfaces import with_bent_edges, with_circles, with_ellipses
from feti_homog.microstructure import phase_names
from feti_homog.microstructure.shapes import Ellipses
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
"""Groups that have no other name."""
HOLE = "expected no elements in a void, which is a hole in the mesh (with voids = true in [cell])"
Selectors = Mapping[str, tuple[str | int, ...]]
# Sine of the angle at a node of the hull that is zero but for rounding.
STRAIGHT = 1e-5
# Slope of sides that may be meant to be upright; share of the hull that a cell with voids fills at least.
UPRIGHT, FILLED = 1e-2, 0.4


def read_cell(cell: cell_section.Cell) -> CoarseMesh:
    """Read the user's mesh of a cell, with the repair that the case selects. Raises as `read`."""
    assert cell.file is not None
    snap = cell.snap_tolerance if cell.repair == "snap" else None
    return read(cell.file, snap, cell.phases, bool(cell.voids))


def read(path: Path, snap: float | None = None, phases: Selectors | None = None, has_voids: bool = False) -> CoarseMesh:
    """Read the coarse mesh from a file that one of the LOADERS reads, moved to [0, width] x [0, height].

    It consists of triangles with three or six nodes, in either sense, in physical surfaces "matrix", "fibre", "glass",
    ..., fills a rectangle but for voids, if it `has_voids`, and has matching nodes on opposite sides. Lines in curve
    "debonded" are edges between a fibre and the matrix that are debonded. Round interfaces become circles
    (`with_circles`), elliptic ones ellipses (`with_ellipses`); others follow their middle nodes (`with_bent_edges`).
    `phases` maps phases to their names and numbers in the file, where these differ (`with_phases`).
    With `snap`, nodes on sides are first moved by up to that / width to where they should be (`snapped`).

    Raises:
        MeshError: with all faults of the first stage that has any: file, labels, shapes, middle nodes, connections,
            sides, debonded lines.
    """
    moved = 0.0
    try:
        raw = with_phases(LOADERS[path.suffix](path), phases or {})
    except OSError as error:
        raise MeshError(f"{path}: cannot be read: {error.strerror}") from None
    except MeshError as error:
        raise MeshError(*(f"{path.name}: {fault}" for fault in error.faults)) from None
    _refuse(path.name, mesh_checks.unlabelled(raw), unknown_phases(raw), mesh_checks.stray_lines(raw))
    _refuse(path.name, mesh_checks.not_finite(raw))
    if snap is not None:
        raw, moved = snapped(raw, snap)
    unused = tuple(escaped(f"{path.name}: {remark}") for remark in mesh_checks.unused_curves(raw))
    return replace(made(raw, path.name, has_voids), snapped=moved, remarks=unused)


def made(raw: RawMesh, path: str, has_voids: bool = True) -> CoarseMesh:
    """Check a raw mesh and make it a coarse mesh; faults begin with `path`. Raises as `read`."""
    _refuse(path, mesh_checks.not_planar(raw), mesh_checks.flat(raw), mesh_checks.duplicate_nodes(raw))
    # All counter-clockwise; middle nodes are those of edges, whichever way these run.
    clockwise = areas(raw.points[:, :2], raw.triangles) < 0
    raw = replace(raw, triangles=np.where(clockwise[:, None], raw.triangles[:, ::-1], raw.triangles))
    _refuse(path, mesh_checks.middle_nodes(raw))
    _refuse(path, _lattice(raw.points[:, :2], raw.triangles))
    origin = raw.points[:, :2].min(axis=0)
    size = raw.points[:, :2].max(axis=0) - origin
    plane = raw.points[:, :2] - origin
    for level in (np.zeros(2), size):
        plane = np.where(np.abs(plane - level) < mesh_checks.SAME_PLACE * size.max(), level, plane)
    corners = mesh_checks.missing_corners(plane, origin, size)
    _refuse(path, mesh_checks.overlapping(raw), mesh_checks.hanging_nodes(raw, plane, size), corners)
    _refuse(path, mesh_checks.too_large(plane, raw.triangles, size))
    _refuse(path, mesh_checks.not_periodic(raw, plane, size), mesh_checks.unrefined_sides(plane, size))
    for axis, low, high in paired_sides(plane, size):
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
        representative=representatives(plane, width, height),
        ellipses=Ellipses.round(np.zeros((0, 3))),
        arc_edges=np.zeros((0, 2), np.int32),
        arc_circle=np.zeros(0, np.int32),
        debonded_edges=np.searchsorted(raw.node_tags, raw.debonded).astype(np.int32),
    )
    _refuse(path, mesh_checks.unmatched_sides(raw, mesh))
    _refuse(path, mesh_checks.islands(raw, mesh), mesh_checks.void_faults(raw, mesh, has_voids))
    _refuse(path, mesh_checks.cannot_debond(raw, mesh.debonded_edges, can_debond(mesh, mesh.debonded_edges)))
    middles = replace(raw.middles, points=raw.middles.points - [*origin, 0.0])
    mesh = with_circles(mesh, middles)
    # Fibres keep the numbers that they have without bent edges: round ones first.
    numbers = Torus.of(mesh).constituent.astype(np.int32)
    mesh = with_bent_edges(with_ellipses(mesh, middles), middles)
    return replace(mesh, precedence=numbers)


def _refuse(path: str, *faults: Sequence[str]) -> None:
    """Raise MeshError with all faults, if there are any."""
    if lines := [f"{path}: {fault}" for kind in faults for fault in kind]:
        raise MeshError(*lines)


def snapped(raw: RawMesh, tolerance: float) -> tuple[RawMesh, float]:
    """Move the outer nodes onto a rectangle's sides, opposite each other; also return the largest move.

    A side lies at the median among nodes within `tolerance`, relative to the width, from the outermost. Partners, each
    other's nearest within the tolerance along the side, both move to the middle between them, but for corners. On
    sides, middle nodes in second-order triangles are then midway between the ends of their edges. Nodes that are
    farther stay where they are, for the checks to report.
    """
    plane = raw.points[:, :2].copy()
    pairs = edges(raw.triangles)
    _, first, count = np.unique(edge_keys(pairs, len(plane)), return_index=True, return_counts=True)
    outer = np.asarray(np.unique(pairs[first[count == 1]]), np.int64)
    if not np.isfinite(plane).all() or not len(outer):
        return raw, 0.0
    reach = tolerance * float(np.ptp(plane[:, 0]))
    sides = {}
    for axis in (0, 1):
        for extreme in (np.min, np.max):
            along = plane[outer, axis]
            side = outer[np.abs(along - extreme(along)) <= reach]
            plane[side, axis] = np.median(plane[side, axis])
            sides[axis, extreme is np.max] = side
    for axis in (0, 1):
        low, high, along = sides[axis, False], sides[axis, True], plane[:, 1 - axis]
        away, to_high = cKDTree(along[high, None]).query(along[low, None])
        to_low = cKDTree(along[low, None]).query(along[high, None])[1]
        mutual = (to_low[to_high] == np.arange(len(low))) & (away <= reach)
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
    """Report a cell that is a parallelogram or a hexagon."""
    hull = ConvexHull(plane)
    corners = plane[hull.vertices]
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    # Nodes on straight sides are no corners.
    corners = corners[turn > STRAIGHT * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)]
    if len(corners) not in (4, 6) or np.abs(areas(plane, triangles)).sum() < FILLED * hull.volume:
        return []
    sides = np.roll(corners, -1, axis=0) - corners
    half = len(sides) // 2
    lengths = np.abs(sides[:half])
    is_upright = half == 2 and bool((lengths.min(axis=1) <= UPRIGHT * lengths.max(axis=1)).all())
    if np.abs(sides[:half] + sides[half:]).max() > STRAIGHT * np.abs(sides).max() or is_upright:
        return []
    name = "parallelogram" if half == 2 else "hexagon"
    return [f'the cell is a {name}, expected a rectangle: see "Lattices that are no rectangle" in meshes/README.md']


def with_phases(mesh: RawMesh, phases: Selectors) -> RawMesh:
    """Rename each group to the phase that selects its name, or else its alias.

    Other groups keep their names. `debonded` selects curves.

    Raises:
        MeshError: a name or number that no element has; one line for each.
    """
    pairs, faults = [(phase, name) for phase, selected in phases.items() for name in selected], []
    for phase, name in pairs:
        of_curves = phase == DEBONDED
        if _key(name) not in map(_key, _names(mesh, of_curves)):
            selected = f"[cell.phases] {wording.toml_key(phase)} = {wording.toml_value(name)}"
            kind = "lines" if of_curves else "elements"
            faults.append(f"{selected}: no {kind} of that name; {known_names(mesh, of_curves)}")
    if faults:
        raise MeshError(*faults)
    phase_of = {_key(name): phase for phase, name in pairs if phase != DEBONDED}
    lines = set(map(_key, phases.get(DEBONDED, ())))
    curves = {DEBONDED if _key(name) in lines else name: ends for name, ends in mesh.curves.items()}
    both = zip(mesh.groups, mesh.aliases or ((),) * len(mesh.groups), strict=True)
    groups = tuple(_selecting(names, phase_of) or _selecting(aliases, phase_of) or names for names, aliases in both)
    return replace(mesh, groups=groups, curves=curves)


def _selecting(names: tuple[str, ...], phase_of: Mapping[str, str]) -> tuple[str, ...]:
    """Return the phases that select any of the names, without repetition."""
    return tuple(dict.fromkeys(phase_of[_key(name)] for name in names if _key(name) in phase_of))


def _key(name: str | int) -> str:
    """Convert a name, or the number of a nameless group, for comparison without case."""
    return (f"number {name}" if isinstance(name, int) else name).casefold()


def unknown_phases(mesh: RawMesh) -> list[str]:
    """List physical surfaces whose name is not a phase, and a missing matrix."""
    names = list(dict.fromkeys(chain.from_iterable(mesh.groups)))
    has_matrix = "matrix" in names
    expected = 'expected "matrix", "fibre", "glass", ... of letters, digits, _ and -, "fibre:2"'
    # Without a matrix all groups are named anew, and numbers need no further word.
    faults = [
        f'{mesh.container} "{name}" is not a phase: {HOLE if name == phase_names.VOID else expected}'
        for name in names
        if not phase_names.PHASE.fullmatch(name) and (has_matrix or not NUMBER.fullmatch(name))
    ]
    if not has_matrix:
        faults.append(f'no {mesh.container} is named "matrix"')
    if not faults:
        return []
    faults[-1] += f"; {known_names(mesh)}"
    # Propose the two largest groups for [cell.phases].
    shares: dict[str, float] = {}
    with np.errstate(all="ignore"):  # coordinates are judged later
        sizes = np.bincount(mesh.group, np.abs(areas(mesh.points[:, :2], mesh.triangles)), len(mesh.groups))
        for group, percent in zip(mesh.groups, 100 * sizes / sizes.sum(), strict=True):
            if group and group[0] != phase_names.VOID:
                shares[group[0]] = shares.get(group[0], 0.0) + percent
    if shares:
        largest = [_as_selected(name) for name in sorted(shares, key=lambda name: -shares[name])]
        entries = ", ".join(f"{phase} = {name}" for phase, name in zip(("matrix", "fibre"), largest, strict=False))
        listed = first_of((f"{_as_selected(name)}: {share:.3g} %" for name, share in shares.items()), len(shares), 20)
        faults[-1] += f". If {largest[0]} is the matrix, add to [cell]: phases = {{{entries}}}. "
        faults[-1] += f"Shares of the area: {listed}"
    return faults


def known_names(mesh: RawMesh, of_curves: bool = False) -> str:
    """List the names of groups, or of curves; numbers stand for nameless ones."""
    names = _names(mesh, of_curves)
    return f"the file has {first_of(map(_as_selected, names), len(names), 20) or 'none'}"


def _names(mesh: RawMesh, of_curves: bool) -> list[str]:
    return list(dict.fromkeys(mesh.curves if of_curves else chain(*mesh.groups, *mesh.aliases)))


def _as_selected(name: str) -> str:
    """Write the name or number of a group as in a case file."""
    return name.removeprefix("number ") if NUMBER.fullmatch(name) else wording.toml_value(name)
