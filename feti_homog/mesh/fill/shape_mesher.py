"""The coarse periodic mesh of a table with polygons: gmsh cuts their outlines and fills them.

The middle nodes of its second-order edges tell the curves, as those of users' meshes do.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

import numpy as np

from feti_homog.case.phase_names import MATRIX, VOID
from feti_homog.fibres.arrangement import Arrangement
from feti_homog.fibres.convex_shapes import ConvexShapes
from feti_homog.fibres.shaped_table import outer_shapes
from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.readers.gmsh_file import triangles_of_model
from feti_homog.mesh.readers.msh_reader import made
from feti_homog.mesh.sizes.graded_size import MeshSizes
from feti_homog.mesh.sizes.shape_sizes import SizeAt, shape_sizes
from feti_homog.mesh.tiles.filling import gmsh_session
from feti_homog.typing import Float

# Distance from a line / size of the cell within which curves lie on it.
ON_SIDE = 1e-6
# Core / frame of a polygon below which it is a circle.
ROUND = 1e-9
# Cells of the grid of sizes along a side.
FEWEST_CELLS, MOST_CELLS = 32, 1000

Surface = tuple[int, int]


def mesh_shapes(arrangement: Arrangement, sizes: MeshSizes, scale: float) -> CoarseMesh:
    """As `gmsh_mesher.mesh_arrangement`, of an arrangement with `shapes`."""
    with gmsh_session() as gmsh:
        number = _add_surfaces(gmsh, arrangement)
        _match_sides(gmsh, arrangement)
        for option in ("MeshSizeFromPoints", "MeshSizeExtendFromBoundary"):
            gmsh.option.setNumber(f"Mesh.{option}", 0)
        with TemporaryDirectory() as folder:
            _set_sizes(gmsh, Path(folder) / "sizes", arrangement, *shape_sizes(arrangement, sizes))
            gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        own = np.array([number[tag] for _, tag in gmsh.model.getEntities(2)], np.int32)
        raw = triangles_of_model(gmsh)
    mesh = made(raw, "table")
    return replace(
        mesh,
        width=scale * mesh.width,
        height=scale * mesh.height,
        points=scale * mesh.points,
        ellipses=mesh.ellipses.scaled(scale),
        precedence=own[raw.group],
        centres=scale * arrangement.centres[: arrangement.fibres],
    )


def _add_surfaces(gmsh: ModuleType, arrangement: Arrangement) -> dict[int, int]:
    """Add the surfaces within the cell in physical groups of their phases; the precedence of each, 0 of the matrix."""
    occ = gmsh.model.occ
    rectangle = (2, occ.addRectangle(0.0, 0.0, 0.0, arrangement.width, arrangement.height))
    added, disc, ring = _add_outlines(gmsh, arrangement)
    _, parts = occ.fragment([rectangle], added)
    occ.synchronize()
    number, phase = dict.fromkeys(parts[0], 0), dict.fromkeys(parts[0], MATRIX)
    for pieces, own, is_ring in zip(parts[1:], disc, ring, strict=True):
        inside = set(pieces) & set(number)
        number |= dict.fromkeys(inside, _precedence(arrangement, own, is_ring))
        phase |= dict.fromkeys(inside, arrangement.within[is_ring][own])
    outside = {piece for pieces in parts for piece in pieces} - set(number)
    voids = {piece for piece, name in phase.items() if name == VOID}
    occ.remove(sorted(outside | voids), recursive=True)
    occ.synchronize()
    for name in sorted(set(phase.values()) - {VOID}):
        gmsh.model.addPhysicalGroup(2, sorted(tag for (_, tag), own in phase.items() if own == name), name=name)
    return {tag: own for (_, tag), own in number.items()}


def _precedence(arrangement: Arrangement, disc: int, is_ring: bool) -> int:
    """The number of the fibre, from 1; of coatings those behind them in the same order."""
    return disc + 1 + arrangement.fibres * (is_ring and not arrangement.is_hollow[disc])


def _add_outlines(gmsh: ModuleType, arrangement: Arrangement) -> tuple[list[Surface], list[int], list[bool]]:
    """Surfaces of all images that reach into the cell, their discs, and which have another within: outer ones first."""
    size, outer, inner = (
        np.array([arrangement.width, arrangement.height]),
        outer_shapes(arrangement),
        arrangement.shapes,
    )
    assert inner is not None
    inner = inner.at(arrangement.centres)
    order = range(len(outer)) if arrangement.mesh_order is None else arrangement.mesh_order.tolist()
    low, high = (outer.centres + sign * outer.extents[:, :, side] for side, sign in ((0, -1), (1, 1)))
    added, disc, ring = list[Surface](), list[int](), list[bool]()
    for number, step in product(order, product((-1, 0, 1), repeat=2)):
        shift = np.array(step) * size
        if np.all((high[number] + shift > 0) & (low[number] + shift < size)):
            kinds = (True, False) if arrangement.coated[number] else (False,)
            for is_ring in kinds:
                added.append((2, _add_shape(gmsh, outer if is_ring else inner, number, shift)))
                disc.append(number)
                ring.append(is_ring)
    return added, disc, ring


def _add_shape(gmsh: ModuleType, shapes: ConvexShapes, number: int, shift: Float) -> int:
    """The plane surface of one shape, moved."""
    occ, (x, y) = gmsh.model.occ, (shapes.centres[number] + shift).tolist()
    frame, core = shapes.frames[number], shapes.cores[number]
    a, b = np.linalg.norm(frame, axis=0).tolist()
    if np.abs(core).max() <= ROUND * max(a, b):
        longer = 0 if a >= b else 1
        surface = occ.addDisk(x, y, 0.0, max(a, b), min(a, b))
        turn = float(np.arctan2(frame[1, longer], frame[0, longer]))
        occ.rotate([(2, surface)], x, y, 0.0, 0.0, 0.0, 1.0, turn)
        return int(surface)
    corners = core[np.sort(np.unique(core.round(14), axis=0, return_index=True)[1])] + [x, y]
    return int(occ.addPlaneSurface([occ.addCurveLoop(_rounded_lines(occ, corners, a))]))


def _rounded_lines(occ: ModuleType, corners: Float, rounding: float) -> list[int]:
    """The straight sides and the arcs of a polygon with a margin around, whose corners (n, 2) run counter-clockwise."""
    following = np.roll(corners, -1, axis=0)
    along = (following - corners) / np.linalg.norm(following - corners, axis=1, keepdims=True)
    outward = np.column_stack([along[:, 1], -along[:, 0]]) * rounding

    def point(place: Float) -> int:
        return int(occ.addPoint(*place.tolist(), 0.0))

    if rounding == 0.0:
        tags = [point(corner) for corner in corners]
        return [occ.addLine(*ends) for ends in zip(tags, tags[1:] + tags[:1], strict=True)]
    starts, stops = ([point(place) for place in ends + outward] for ends in (corners, following))
    lines = []
    for k, corner in enumerate(following):
        onward = starts[(k + 1) % len(starts)]
        lines += [occ.addLine(starts[k], stops[k]), occ.addCircleArc(stops[k], point(corner), onward)]
    return lines


def _match_sides(gmsh: ModuleType, arrangement: Arrangement) -> None:
    """Let the curves on the right and upper side have the nodes of those on the left and lower one."""
    size = np.array([arrangement.width, arrangement.height])
    curves = [tag for _, tag in gmsh.model.getEntities(1)]
    boxes = np.array([gmsh.model.getBoundingBox(1, tag) for tag in curves]).reshape(-1, 2, 3)[:, :, :2]
    for axis in (0, 1):
        sides = []
        for level in (0.0, size[axis]):
            on = np.flatnonzero(np.abs(boxes[:, :, axis] - level).max(axis=1) < ON_SIDE)
            sides.append([curves[k] for k in on[np.argsort(boxes[on, :, 1 - axis].mean(axis=1))]])
        moved = np.eye(4)
        moved[axis, 3] = size[axis]
        gmsh.model.mesh.setPeriodic(1, sides[1], sides[0], moved.ravel().tolist())


def _set_sizes(gmsh: ModuleType, path: Path, arrangement: Arrangement, least: float, size_at: SizeAt) -> None:
    """Let gmsh interpolate the sizes at positions (n, 2), the least of which is told, on a grid, by way of a file."""
    size = np.array([arrangement.width, arrangement.height])
    counts = np.clip(np.ceil(size / least), FEWEST_CELLS, MOST_CELLS).astype(np.int32) + 1
    x, y = (np.linspace(0.0, width, count) for width, count in zip(size, counts, strict=True))
    values = size_at(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2))
    spacing = np.append(size / (counts - 1), 1.0)
    with path.open("wb") as stream:
        for part in (np.zeros(3), spacing, np.append(counts, 2).astype(np.int32), np.repeat(values, 2)):
            part.tofile(stream)
    field = gmsh.model.mesh.field.add("Structured")
    gmsh.model.mesh.field.setString(field, "FileName", str(path))
    gmsh.model.mesh.field.setAsBackgroundMesh(field)
