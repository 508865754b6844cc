"""A user's mesh: read from a .msh file, checked, and made into the coarse mesh of the cell."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np

from feti_homog.cell import mesh_checks
from feti_homog.cell.circle_detection import with_circles
from feti_homog.cell.coarse_mesh import CoarseMesh, areas, representatives
from feti_homog.cell.gmsh_mesher import LINE, TRIANGLE, gmsh_session
from feti_homog.cell.interface_edges import can_debond
from feti_homog.cell.mesh_checks import RawMesh
from feti_homog.cell.periodic_sides import paired_sides
from feti_homog.errors import MeshError
from feti_homog.typing import Float, Int

# How a mesh file of gmsh begins; other text would be run as a script.
HEADERS = ("$MeshFormat", "$Comments", "$PhysicalNames", "$NOD")
# What to do about other elements, by order and dimension.
REMEDY = {
    (1, 2): "do not recombine",
    (2, 2): "mesh with Mesh.ElementOrder = 1 and set order = 2 in [cell]",
    (1, 3): "mesh the surfaces only",
    (2, 3): "mesh the surfaces only",
}


def read(path: Path) -> CoarseMesh:
    """The coarse mesh in a .msh file of any gmsh version, moved to [0, width] x [0, height].

    It consists of 3-node triangles in physical surfaces "matrix", "fibre", "fibre:2", ..., fills a rectangle,
    and has matching nodes on opposite sides. Lines in the physical curve "debonded" are edges between a fibre
    and the matrix that are debonded. Round interfaces become circles (`with_circles`).

    Raises:
        MeshError: with all faults of the first stage that has any: file, labels, shapes, connections, sides, debonded
            lines.
    """
    raw = _load(path)
    _refuse(path, mesh_checks.unlabelled(raw), mesh_checks.unknown_phases(raw), mesh_checks.stray_lines(raw))
    _refuse(path, mesh_checks.not_finite(raw))
    _refuse(path, mesh_checks.not_planar(raw), mesh_checks.flat_or_inverted(raw), mesh_checks.duplicate_nodes(raw))
    origin, size, plane = _on_rectangle(raw.points[:, :2])
    corners = mesh_checks.missing_corners(plane, origin, size)
    _refuse(path, mesh_checks.overlapping(raw), mesh_checks.open_edges(raw, plane, size), corners)
    _refuse(path, mesh_checks.uncovered(plane, raw.triangles, size))
    _refuse(path, mesh_checks.not_periodic(raw, plane, size), mesh_checks.unrefined_sides(plane, size))
    mesh = _coarse_mesh(raw, _matched(plane, size), size)
    _refuse(path, mesh_checks.cannot_debond(raw, mesh.debonded_edges, can_debond(mesh, mesh.debonded_edges)))
    return with_circles(mesh)


def _refuse(path: Path, *faults: list[str]) -> None:
    """Raise MeshError if there are faults."""
    found = [f"{path.name}: {fault}" for kind in faults for fault in kind]
    if found:
        raise MeshError(*found)


def _load(path: Path) -> RawMesh:
    """The triangles of a file; only their kind has been checked."""
    try:
        with path.open("rb") as file:
            start = file.read(4096).lstrip().decode("latin-1")
    except OSError as error:
        raise MeshError(f"{path}: cannot be read: {error.strerror}") from None
    if not start.startswith(HEADERS):
        raise MeshError(f"{path.name}: not a gmsh mesh file: it does not begin with {HEADERS[0]}")
    with gmsh_session() as gmsh:
        try:
            gmsh.open(str(path))
        except Exception as error:  # gmsh raises nothing more specific
            raise MeshError(f"{path.name}: gmsh cannot read it: {error}") from None
        _refuse(path, _other_kinds(gmsh))
        return _raw_mesh(gmsh)


def _other_kinds(gmsh: ModuleType) -> list[str]:
    """Elements that are not 3-node triangles, and the lack of these."""
    faults = []
    kinds = [kind for dimension in (2, 3) for kind in gmsh.model.mesh.getElementTypes(dimension)]
    for kind in kinds:
        if kind != TRIANGLE:
            tags, nodes = gmsh.model.mesh.getElementsByType(kind)
            name, dimension, order, *_ = gmsh.model.mesh.getElementProperties(kind)
            points = [gmsh.model.mesh.getNode(node)[0] for node in nodes[: len(nodes) // len(tags)]]
            first = f"element {tags[0]} at {mesh_checks.at(np.mean(points, axis=0))}"
            faults.append(
                f"{first}, the first of {len(tags)}, is a {name}: only 3-node triangles can be used "
                f"({REMEDY[min(order, 2), dimension]})"
            )
    if TRIANGLE not in kinds and not faults:
        faults.append("no triangles in it: mesh the surfaces and put them in physical surfaces before saving")
    return faults


def _raw_mesh(gmsh: ModuleType) -> RawMesh:
    """The triangles of gmsh's current model, with the nodes that they use."""
    tags, nodes, group, groups = [], [], [], []
    for _, entity in gmsh.model.getEntities(2):
        own_tags, own_nodes = gmsh.model.mesh.getElementsByType(TRIANGLE, entity)
        if len(own_tags):
            physical = gmsh.model.getPhysicalGroupsForEntity(2, entity)
            names = (gmsh.model.getPhysicalName(2, tag) or f"number {tag}" for tag in physical)
            groups.append(tuple(names))
            group.append(np.full(len(own_tags), len(groups) - 1))
            tags.append(own_tags)
            nodes.append(own_nodes)
    node_tags, coordinates, _ = gmsh.model.mesh.getNodes()
    used, triangles = np.unique(np.concatenate(nodes), return_inverse=True)
    order = np.argsort(node_tags)
    place = order[np.searchsorted(node_tags[order], used)]
    return RawMesh(
        node_tags=used.astype(np.int64),
        points=coordinates.reshape(-1, 3)[place],
        element_tags=np.concatenate(tags).astype(np.int64),
        triangles=triangles.reshape(-1, 3).astype(np.int32),
        group=np.concatenate(group),
        groups=tuple(groups),
        debonded=_debonded_lines(gmsh),
    )


def _debonded_lines(gmsh: ModuleType) -> Int:
    """Node tags (d, 2) of the lines in the physical curve "debonded"."""
    lines = [np.zeros(0, np.int64)]
    for _, entity in gmsh.model.getEntities(1):
        groups = gmsh.model.getPhysicalGroupsForEntity(1, entity)
        if any(gmsh.model.getPhysicalName(1, tag) == mesh_checks.DEBONDED for tag in groups):
            lines.append(gmsh.model.mesh.getElementsByType(LINE, entity)[1].astype(np.int64))
    return np.concatenate(lines).reshape(-1, 2)


def _on_rectangle(plane: Float) -> tuple[Float, Float, Float]:
    """Origin and size (2,) of the bounding rectangle, and positions (n, 2) in it, exactly on its sides."""
    origin = plane.min(axis=0)
    size = plane.max(axis=0) - origin
    moved = plane - origin
    near = mesh_checks.SAME_PLACE * size.max()
    moved[np.abs(moved) < near] = 0.0
    return origin, size, np.where(np.abs(moved - size) < near, size, moved)


def _matched(plane: Float, size: Float) -> Float:
    """Positions whose partners on opposite sides have the same coordinate along them."""
    plane = plane.copy()
    for axis, low, high in paired_sides(plane, size):
        plane[high, 1 - axis] = plane[low, 1 - axis]
    return plane


def _coarse_mesh(raw: RawMesh, plane: Float, size: Float) -> CoarseMesh:
    """A checked mesh, counter-clockwise, without circles."""
    names = [group[0] for group in raw.groups]
    phases = ("matrix", *sorted(set(names) - {"matrix"}))
    number = np.array([phases.index(name) for name in names], dtype=np.int32)
    clockwise = areas(plane, raw.triangles) < 0
    triangles = np.where(clockwise[:, None], raw.triangles[:, ::-1], raw.triangles)
    width, height = size.tolist()
    return CoarseMesh(
        width=width,
        height=height,
        points=plane,
        triangles=triangles,
        phase=number[raw.group],
        phases=phases,
        precedence=number[raw.group],
        representative=representatives(plane, width, height),
        circles=np.zeros((0, 3)),
        arc_edges=np.zeros((0, 2), np.int32),
        arc_circle=np.zeros(0, np.int32),
        debonded_edges=np.searchsorted(raw.node_tags, raw.debonded).astype(np.int32),
    )
