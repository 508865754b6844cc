"""Mesh a periodic cell with convex outlines of any shape: gmsh cuts the outlines at the sides and fills the cell.

Middle nodes on second-order edges define the curves, as in users' meshes.
"""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.errors import MeshError
from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.fill.element_estimate import refuse_many
from feti_homog.mesh.outline.graded_size import MAX_GROWTH, MIN_EDGES_AROUND, PASSAGE_EDGE, MeshSizes, SizeField, wrap
from feti_homog.mesh.outline.outline import images
from feti_homog.mesh.readers.gmsh_file import MshContent, raw_mesh
from feti_homog.mesh.readers.msh_reader import made
from feti_homog.mesh.tiles.tile_filling import gmsh_session
from feti_homog.microstructure import Arrangement, arrangements, phase_names
from feti_homog.microstructure.shapes import Ellipses, convex_sums
from feti_homog.typing import Float

# Distance / cell size up to which a curve lies on a side; core / semi-axis up to which a shape is an ellipse.
SAME_PLACE = 1e-6
# Fewest and most grid cells along a side, for the grid of sizes that gmsh reads.
FEWEST_CELLS, MOST_CELLS = 32, 1000
# Edge length on a coating, in thicknesses; cosine between outline and side normals, above which they face each other.
COATING_EDGE, FACING = 2.0, 0.9
# Smallest edge size, relative to the longer side of the cell.
LEAST = 1e-5


def mesh_outlines(arrangement: Arrangement, sizes: MeshSizes, scale: float) -> CoarseMesh:
    """Mesh convex outlines; arguments as in `UnmeshedCell`. Raises MeshError for too many elements or if gmsh fails."""
    field = _size_field(arrangement, sizes)
    refuse_many(field, field.least, arrangement.size)
    with gmsh_session() as gmsh:
        number = _add_surfaces(gmsh, arrangement)
        raw = raw_mesh(filled(gmsh, arrangement.size, field, "fibres", "larger gaps or another mesh_size"))
        precedence = np.array([number[tag] for _, tag in gmsh.model.getEntities(2)], np.int32)
    return replace(
        made(raw, "table").scaled(scale),
        precedence=precedence[raw.group],
        centres=scale * arrangement.centres[: arrangement.fibres],
        origin=arrangement.origin,
    )


def filled(gmsh: ModuleType, size: Float, field: SizeField, key: str, advice: str) -> MshContent:
    """Fill the surfaces in gmsh with periodic second-order triangles; return the mesh.

    `size` (2,) is the cell size, and `field` gives the element sizes.  Raises MeshError if gmsh fails: the message
    names the entry `key` of [cell] and gives `advice`.
    """
    # Curves on the right and upper sides copy the nodes of the left and lower sides.
    curves = [tag for _, tag in gmsh.model.getEntities(1)]
    boxes = np.array([gmsh.model.getBoundingBox(1, tag) for tag in curves]).reshape(-1, 2, 3)[:, :, :2]
    for axis, width in enumerate(size):
        sides = []
        for level in (0.0, width):
            indices = np.flatnonzero(np.abs(boxes[:, :, axis] - level).max(axis=1) < SAME_PLACE)
            sides.append([curves[k] for k in indices[np.argsort(boxes[indices, :, 1 - axis].mean(axis=1))]])
        moved = np.eye(4)
        moved[axis, 3] = width
        gmsh.model.mesh.setPeriodic(1, sides[1], sides[0], moved.ravel().tolist())
    for option in ("MeshSizeFromPoints", "MeshSizeExtendFromBoundary"):
        gmsh.option.setNumber(f"Mesh.{option}", 0)
    # gmsh interpolates sizes on a grid, which it reads from a file.
    structured = gmsh.model.mesh.field.add("Structured")
    counts = np.clip(np.ceil(size / field.least), FEWEST_CELLS, MOST_CELLS).astype(np.int32) + 1
    x, y = (np.linspace(0.0, width, count) for width, count in zip(size, counts, strict=True))
    values = field(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2))
    spacing = np.append(size / (counts - 1), 1.0)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "sizes"
        with path.open("wb") as stream:
            for part in (np.zeros(3), spacing, np.append(counts, 2).astype(np.int32), np.repeat(values, 2)):
                part.tofile(stream)
        gmsh.model.mesh.field.setString(structured, "FileName", str(path))
        gmsh.model.mesh.field.setAsBackgroundMesh(structured)
        try:
            gmsh.model.mesh.generate(2)
        except Exception as error:  # gmsh raises only Exception
            raise MeshError(f"[cell] {key}: gmsh cannot fill the outlines ({error}); expected {advice}") from None
        gmsh.model.mesh.setOrder(2)
        return MshContent.of(gmsh)


def _add_surfaces(gmsh: ModuleType, arrangement: Arrangement) -> dict[int, int]:
    """Add the surfaces of matrix and fibres to gmsh, in one group for each phase; return their precedences by tag."""
    occ, (curves, disc, around) = gmsh.model.occ, images(arrangement)
    assert isinstance(curves, convex_sums.ConvexSums)
    rectangle = (2, occ.addRectangle(0.0, 0.0, 0.0, *arrangement.size.tolist()))
    _, parts = occ.fragment([rectangle], [(2, _add_shape(gmsh, curves, number)) for number in range(len(curves))])
    occ.synchronize()
    number_of, phase = dict.fromkeys(parts[0], 0), dict.fromkeys(parts[0], phase_names.MATRIX)
    ring = np.isin(np.arange(len(disc)), around)
    numbers = arrangement.precedence(disc, ring)
    for pieces, entry, is_ring, precedence in zip(parts[1:], disc, ring, numbers, strict=True):
        within = set(pieces) & set(number_of)
        number_of |= dict.fromkeys(within, int(precedence))
        phase |= dict.fromkeys(within, arrangement.within[int(is_ring)][entry])
    outside = {piece for pieces in parts for piece in pieces} - set(number_of)
    voids = {piece for piece, name in phase.items() if name == phase_names.VOID}
    occ.remove(sorted(outside | voids), recursive=True)
    occ.synchronize()
    for name in sorted(set(phase.values()) - {phase_names.VOID}):
        gmsh.model.addPhysicalGroup(2, sorted(tag for (_, tag), entry in phase.items() if entry == name), name=name)
    return {tag: entry for (_, tag), entry in number_of.items()}


def _add_shape(gmsh: ModuleType, shapes: convex_sums.ConvexSums, number: int) -> int:
    """Add the surface of outline `number`, an ellipse or a polygon with sharp or round corners; return the tag."""
    occ, centre = gmsh.model.occ, shapes.centres[number]
    frame, core = shapes.frames[number], shapes.cores[number]
    semi_axes = np.linalg.norm(frame, axis=0)
    a, b = semi_axes.max(), semi_axes.min()
    if np.abs(core).max() <= SAME_PLACE * a:
        surface, (x, y) = occ.addDisk(*centre.tolist(), 0.0, a, b), frame[:, semi_axes.argmax()]
        occ.rotate([(2, surface)], *centre.tolist(), 0.0, 0.0, 0.0, 1.0, np.arctan2(y, x))
        return int(surface)

    def point(place: Float) -> int:
        return int(occ.addPoint(*place.tolist(), 0.0))

    # Corners, lines and, around a margin, arcs are in counter-clockwise order.
    corners = core[np.sort(np.unique(core.round(14), axis=0, return_index=True)[1])] + centre
    following = np.roll(corners, -1, axis=0)
    along = (following - corners) / np.linalg.norm(following - corners, axis=1, keepdims=True)
    outward = np.column_stack([along[:, 1], -along[:, 0]]) * a
    starts = [point(corner) for corner in corners + outward]
    stops = [point(corner) for corner in following + outward] if a else starts[1:] + starts[:1]
    lines = []
    for k, corner in enumerate(following):
        lines.append(occ.addLine(starts[k], stops[k]))
        if a:
            # The sense of a half turn, around one of two corners, needs a middle point.
            middle = [point(corner + a * along[k])] if len(corners) == 2 else []
            around, places = point(corner), [stops[k], *middle, starts[(k + 1) % len(starts)]]
            lines += [occ.addCircleArc(begin, around, end) for begin, end in pairwise(places)]
    return int(occ.addPlaneSurface([occ.addCurveLoop(lines)]))


def _size_field(arrangement: Arrangement, sizes: MeshSizes) -> SizeField:
    """Return the size field min(`sizes.largest`, min_k (h_k + g |x - x_k|)), g = MAX_GROWTH, x_k on all outlines.

    h_k is at most the interface size, 2 pi R / MIN_EDGES_AROUND with the radius of curvature R at rounded corners and
    on ellipses, COATING_EDGE times the coating thickness, and PASSAGE_EDGE times the distance to the next outline, or
    to a cell side that the outline faces; h_k is at least LEAST times the longer side.
    """
    size, shapes = arrangement.size, arrangement.outer
    assert isinstance(shapes, convex_sums.ConvexSums)
    places, normal, shape = shapes.boundary(convex_sums.POINTS)
    rounds, is_round = np.full(len(places), np.inf), np.asarray(shapes.frames.any(axis=(1, 2)))[shape]
    rounds[is_round] = Ellipses(shapes.centres, shapes.frames)[shape[is_round]].bend(normal[is_round])
    thickness = np.where(arrangement.coated, arrangement.coating, np.inf)
    # The distance to the nearest point on another shape, or on an image.
    distance = np.full(len(places), np.inf)
    for label in np.unique(shape):
        points, other_points = places[shape == label], places[shape != label]
        if len(other_points):
            distance[shape == label] = cKDTree(wrap(other_points, size), boxsize=size).query(wrap(points, size))[0]
        image_points = (points + (arrangements.STEPS * size)[:, None]).reshape(-1, 2)
        distance[shape == label] = np.minimum(distance[shape == label], cKDTree(image_points).query(points)[0])
    length = np.minimum(sizes.interface, PASSAGE_EDGE * distance)
    length = np.minimum(length, np.minimum(2 * np.pi * rounds / MIN_EDGES_AROUND, COATING_EDGE * thickness[shape]))
    for axis in (0, 1):
        to_side = np.abs(places[:, axis] - np.round(places[:, axis] / size[axis]) * size[axis])
        faces = np.abs(normal[:, axis]) > FACING
        length = np.where(faces, np.minimum(length, PASSAGE_EDGE * to_side), length)
    length = np.maximum(length, LEAST * size.max())
    growth = np.full(len(places), MAX_GROWTH)
    return SizeField([(places, length, growth)], size, sizes.largest)
