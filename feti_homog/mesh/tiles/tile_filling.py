"""Fill the regions of an outline with triangles by gmsh."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from math import isclose
from types import ModuleType

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.mesh.coarse_mesh import areas, flip_double_arcs
from feti_homog.mesh.outline.graded_size import MAX_GROWTH
from feti_homog.mesh.outline.lines import MATRIX, OUTSIDE, Curves
from feti_homog.microstructure import arrangements
from feti_homog.typing import Array, Float, Int, Int32

# Number of gmsh's Delaunay algorithm. The default makes better triangles of one size, but fails in a disc with
# thousands of nodes on the circle.
DELAUNAY = 5

# A closed line: inner area, negative for a clockwise line, corners x + i y (k,), and tags of the gmsh lines, negative
# for backward lines.
Loop = tuple[float, Array, list[int]]


@dataclass(frozen=True)
class Tile:
    """Regions of an outline that gmsh fills together.

    Attributes:
        points: (n, 2) nodes on the lines.
        nodes, classes: (n,) node numbers in the cell, and representatives of the periodic node classes.
        curves: curves through the nodes; the region beyond a tile border is OUTSIDE.
        largest: largest element size.
        is_graded: whether elements grow from the sizes on lines; otherwise gmsh interpolates the sizes.
    """

    points: Float
    nodes: Int
    classes: Int
    curves: Curves
    largest: float
    is_graded: bool


@dataclass(frozen=True)
class Filling:
    """The triangles that gmsh puts into a tile.

    Attributes:
        inner: (k, 2) inner nodes, numbered after the nodes on lines.
        triangles: (m, 3) counter-clockwise nodes.
        circle: (m,) the smallest circle around each triangle, or MATRIX.
    """

    inner: Float
    triangles: Int32
    circle: Int


@contextmanager
def gmsh_session() -> Iterator[ModuleType]:
    """Context manager: run gmsh silently, with fixed options and an empty model."""
    import gmsh

    gmsh.initialize(["gmsh", "-v", "0", "-skip_petscrc"], False, interruptible=False)  # gmsh starts PETSc
    try:
        options = {"General.Terminal": 0, "General.NumThreads": 1, "Mesh.RandomSeed": 1, "Mesh.Renumber": 0}
        for option, value in {**options, "General.Verbosity": 5}.items():
            gmsh.option.setNumber(option, value)
        gmsh.model.add("cell")
        yield gmsh
    finally:
        gmsh.finalize()


def fill(tile: Tile) -> Filling:
    """Fill a tile with triangles, and avoid triangles with two edges on one circle.  Raises MeshError if gmsh fails."""
    with gmsh_session() as gmsh:
        gmsh.option.setNumber("Mesh.MeshSizeMax", tile.largest)
        surfaces, circle, within = _add_surfaces(gmsh, tile)
        if tile.is_graded:
            # The element size is h + g d at the distance d from the nearest outline edge, of length h. Otherwise gmsh
            # would interpolate between the lines, and elements inside a disc would have the size on the circle.
            field = gmsh.model.mesh.field
            extended = field.add("Extend")
            field.setNumbers(extended, "CurvesList", [tag for _, tag in gmsh.model.getEntities(1)])
            field.setNumbers(extended, "SurfacesList", surfaces)
            for option, value in {"SizeMax": tile.largest, "DistMax": tile.largest / MAX_GROWTH, "Power": 1}.items():
                field.setNumber(extended, option, value)
            field.setAsBackgroundMesh(extended)
            gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
            gmsh.option.setNumber("Mesh.Algorithm", DELAUNAY)
        try:
            gmsh.model.mesh.generate(2)
        except Exception as error:  # gmsh raises no other class
            raise _unfilled(tile, str(error)) from error
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        triangle = gmsh.model.mesh.getElementType("Triangle", 1)
        elements = [gmsh.model.mesh.getElementsByType(triangle, surface)[1] for surface in surfaces]
    order = np.argsort(tags)
    points = coordinates.reshape(-1, 3)[order, :2]
    points[: len(tile.points)] = tile.points
    triangles = np.searchsorted(tags[order], np.concatenate(elements)).astype(np.int32).reshape(-1, 3)
    area = areas(points, triangles)
    if not isclose(np.abs(area).sum(), within):
        raise _unfilled(tile, "triangles are missing")
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    circle_of = np.repeat(circle, [len(nodes) // 3 for nodes in elements])
    arcs, circles = arc_edges(tile.curves)
    triangles = flip_double_arcs(triangles, circle_of.astype(np.int32), arcs, circles, len(points))
    return Filling(points[len(tile.points) :], triangles, circle_of)


def _unfilled(tile: Tile, why: str) -> MeshError:
    curves = tile.curves
    # If a side cuts a disc, pieces of the disc are on the opposite side of the cell.
    in_matrix = np.flatnonzero((curves.inside == MATRIX) | (curves.outside == MATRIX))
    points = tile.points[curves.chosen(in_matrix).node] if len(in_matrix) else tile.points
    (x, y), (right, top) = points.min(axis=0), points.max(axis=0)
    part = f"the part from ({x:.4g}, {y:.4g}) to ({right:.4g}, {top:.4g}) of the cell of width 1"
    return MeshError(f"[cell] gmsh cannot fill {part}: {why}; expected another seed, mesh_size or interface_size")


def arc_edges(curves: Curves) -> tuple[Int32, Int32]:
    """Find the edges (a, 2) on circles, and the circle (a,) of each edge."""
    pairs, curve = curves.edges
    circle = curves.circle[curve]
    return pairs[circle != MATRIX].astype(np.int32), circle[circle != MATRIX].astype(np.int32)


def _add_surfaces(gmsh: ModuleType, tile: Tile) -> tuple[list[int], list[int], float]:
    """Add the surfaces of all regions to gmsh.

    Each outline edge is a line with one element, and node n is point n + 1. Returns the surface tags, the circle
    around each surface or MATRIX, and the total area. Raises MeshError if a hole lies in no surface.
    """
    curves, geo = tile.curves, gmsh.model.geo
    for tag, (x, y) in enumerate(tile.points.round(arrangements.GMSH_DECIMALS).tolist(), 1):
        geo.addPoint(x, y, 0.0, tag=tag)
    nodes = np.split(curves.node, curves.first[1:-1])
    lines = [np.array([geo.addLine(*ends) for ends in pairwise((curve + 1).tolist())]) for curve in nodes]
    for tag in np.concatenate(lines).tolist():
        geo.mesh.setTransfiniteCurve(tag, 2)
    # Curves run forwards, then backwards with negative tags, with a region on the left.
    directed = list(zip(curves.inside.tolist(), nodes, lines, strict=True))
    for region, curve, tags in zip(curves.outside.tolist(), nodes, lines, strict=True):
        directed.append((region, curve[::-1], -tags[::-1]))
    # At each vertex one curve of a region starts.
    after = {(region, int(curve[0])): (curve, tags) for region, curve, tags in directed if region != OUTSIDE}
    regions: dict[int, list[Loop]] = {}
    while after:
        loop, (region, node) = [], next(iter(after))
        while (region, node) in after:
            loop.append(after.pop((region, node)))
            node = int(loop[-1][0][-1])
        polygon = tile.points[np.concatenate([curve[:-1] for curve, _ in loop])] @ [1, 1j]
        offset = polygon - polygon[0]
        area = float((offset.conj() * np.roll(offset, -1)).imag.sum() / 2)
        tags = np.concatenate([tags for _, tags in loop])
        regions.setdefault(region, []).append((area, polygon, tags.tolist()))
    surfaces, circle = [], []
    # The matrix is last.
    for region in sorted(regions, key=lambda inside: inside == MATRIX):
        loops = regions[region]
        outer_and_holes = {k: [line_tags] for k, (area, _, line_tags) in enumerate(loops) if area >= 0}
        holes = [(polygon, line_tags) for area, polygon, line_tags in loops if area < 0]
        for polygon, line_tags in holes:
            # A polygon turns once around an inner point. Of nested polygons, the smallest surrounds the hole.
            offsets = [loops[k][1] - polygon[0] for k in outer_and_holes]
            turns = [np.angle(np.roll(vectors, -1) / vectors).sum() for vectors in offsets]
            around = [(loops[k][0], k) for k, turn in zip(outer_and_holes, turns, strict=True) if turn > np.pi]
            if not around:
                raise _unfilled(tile, "a hole lies in no surface")
            outer_and_holes[min(around)[1]].append(line_tags)
        for group in outer_and_holes.values():
            surfaces.append(geo.addPlaneSurface([geo.addCurveLoop(line_tags) for line_tags in group]))
            circle.append(region)
    geo.synchronize()
    return surfaces, circle, sum(area for loops in regions.values() for area, *_ in loops)
