"""Meshes as users make them, by gmsh."""

from pathlib import Path

import gmsh
import numpy as np

from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.refinement import ReferenceLattice, refine
from feti_homog.mesh.tiles.tile_filling import gmsh_session
from support.subdomains import cut


def polar_cell(
    centre: tuple[float, float],
    radius: float,
    path: Path,
    stretch: float = 1.0,
    order: int = 1,
    size: float = 0.1,
    turn: float = 0.0,
    halvings: int = 0,
    wave: float = 0.0,
    **options: float,
) -> None:
    """Write a periodic mesh of the unit cell by gmsh's OpenCASCADE kernel, with one elliptic fibre about `centre`.

    Its semi-axes are radius * stretch and radius, the first at `turn` radians from the horizontal. Elements are halved
    so many times, and then all nodes are moved as `waved` moves them. `options` are those of gmsh's Mesh."""
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        cell = (2, occ.addRectangle(0, 0, 0, 1, 1))
        places = [(centre[0] + i, centre[1] + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        discs = [(2, occ.addDisk(x, y, 0, radius * stretch, radius)) for x, y in places]
        for disc, (x, y) in zip(discs, places, strict=True):
            occ.rotate([disc], x, y, 0, 0, 0, 1, turn)
        parts, origin = occ.fragment([cell], discs)
        inside = set(origin[0])
        occ.remove([part for part in parts if part not in inside], recursive=True)
        fibres = sorted(inside & {part for images in origin[1:] for part in images})
        occ.synchronize()
        matrix = sorted(inside - set(fibres))
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in matrix], name="matrix")
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in fibres], name="fibre")
        for axis in (0, 1):
            _make_periodic(axis)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        for name, value in options.items():
            gmsh.option.setNumber(f"Mesh.{name}", value)
        gmsh.model.mesh.generate(2)
        for _ in range(halvings):
            gmsh.model.mesh.refine()
        gmsh.model.mesh.setOrder(order)
        tags, places, _ = gmsh.model.mesh.getNodes()
        moved = waved(places.reshape(-1, 3)[:, :2], wave)
        for tag, (x, y) in zip(tags, moved, strict=True) if wave else ():
            gmsh.model.mesh.setNode(tag, [x, y, 0.0], [])
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def converted(source: Path, target: Path, parts: int = 0, **options: float) -> Path:
    """Return the file that gmsh makes of another one, with these options of Mesh, in so many partitions."""
    with gmsh_session() as session:
        session.open(str(source))
        if parts:
            session.option.setNumber("Mesh.PartitionCreatePhysicals", 0)
            session.model.mesh.partition(parts)
        for name, value in options.items():
            session.option.setNumber(f"Mesh.{name}", value)
        session.write(str(target))
    return target


def waved(points: np.ndarray, wave: float) -> np.ndarray:
    """Points (n, 2) of the unit cell moved by a smooth map of the torus that keeps its sides."""
    x, y = 2 * np.pi * points.T
    return points + wave * np.stack([np.sin(x) * np.cos(y), np.sin(y) * np.sin(x)], axis=1)


def _make_periodic(axis: int) -> None:
    """Copy the mesh of each curve on the low side along an axis to its partner on the high side."""
    for _, curve in gmsh.model.getEntities(1):
        box = np.array(gmsh.model.getBoundingBox(1, curve))
        shift = np.eye(3)[axis]
        if abs(box[axis]) < 1e-4 and abs(box[3 + axis]) < 1e-4:
            low, high = box[:3] + shift - 1e-4, box[3:] + shift + 1e-4
            (partner,) = gmsh.model.getEntitiesInBoundingBox(*low, *high, dim=1)
            matrix = np.eye(4)
            matrix[axis, 3] = 1
            gmsh.model.mesh.setPeriodic(1, [partner[1]], [curve], matrix.ravel())


def fibre_area(mesh: CoarseMesh, refinements: int, order: int) -> float:
    """Area within the fine vertices and middle nodes of the fibre's elements."""
    torus, lattice = Torus.of(mesh), ReferenceLattice.of(refinements, order)
    (fibre,) = (s for s in cut(torus, torus.constituent) if s.phase == "fibre")
    fine = refine(fibre, lattice)
    order_of_corners = [0, 1, 2] if order == 1 else [0, 3, 1, 4, 2, 5]
    x, y = np.moveaxis(fine.points[fine.triangles[:, order_of_corners]], 2, 0)
    return float(np.sum(x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)) / 2)
