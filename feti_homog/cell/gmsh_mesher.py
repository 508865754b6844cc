"""The coarse periodic mesh of a cell of round fibres: gmsh fills the outline with triangles."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain, pairwise
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING

import numpy as np

from feti_homog.cell import element_estimate, elliptic_outline
from feti_homog.cell.arrangement import Arrangement, arrange
from feti_homog.cell.coarse_mesh import CoarseMesh, areas, flip_double_arcs, representatives
from feti_homog.cell.graded_size import MeshSizes
from feti_homog.cell.outline import MATRIX, Curve, Outline, outline
from feti_homog.cell.size_field import MAX_GROWTH
from feti_homog.cell.void_holes import without_voids
from feti_homog.config.mixed_cell import fractions_in_words, mixed_width
from feti_homog.config.phase_names import VOID
from feti_homog.errors import MeshError
from feti_homog.typing import Float, Index, Int32

if TYPE_CHECKING:
    from feti_homog.config.cell_section import Cell


# Elements that are meshed on one rank in some minutes.
MAX_TRIANGLES = 1_000_000
# Radius / width of the cell above which positions on a circle differ by more than rounding.
SMALLEST_RADIUS = 1e-6
NO_MARKS: Mapping[int, Sequence[float]] = MappingProxyType({})
# gmsh's algorithms. The first makes the better triangles of one size, but leaves a disc with thousands of nodes on its
# circle unfilled.
FRONTAL_DELAUNAY, DELAUNAY = 6, 5
# Decimals of the coordinates that gmsh is given. The last bits of the outline's differ from machine to machine, and
# with them gmsh would make other triangles.
DECIMALS = 12
# gmsh's element types.
LINE, TRIANGLE = 1, 2

# Curves of the outline are numbered from 1; a negative number is a curve run backwards.
Signed = tuple[int, Curve]


def generate(cell: Cell, marks: Mapping[int, Sequence[float]] = NO_MARKS) -> CoarseMesh:
    """The periodic coarse mesh of a square, hexagonal or random cell, or of a table.

    Elements have about the size mesh_size * width, on circles interface_size * width.

    It is made at the width 1 and then scaled, so that cells of one shape have one mesh at all sizes.

    `marks` maps a curve (`outline.outline`) to angles in degrees, measured at its centre, where the mesh gets nodes:
    tips of debonded arcs. A mark within MERGED of where the circle crosses the cell's
    boundary, or of another mark, is moved there.

    Raises:
        MeshError: the fibres cannot be arranged, or there would be too many elements.
    """
    sizes = _sizes(cell, marks)
    _refuse_extremes(cell, sizes, sum(len(own) for own in marks.values()))
    arrangement = arrange(cell)
    smallest = int(arrangement.radii.argmin())
    if arrangement.radii[smallest] < SMALLEST_RADIUS * arrangement.width:
        asked = fractions_in_words(cell) if cell.fractions else 'geometry = "table"'
        raise MeshError(
            f"[cell] {asked}: a {'void' if arrangement.is_void[smallest] else 'fibre'} has a radius of "
            f"{arrangement.radii.min():.2g}; expected at least {SMALLEST_RADIUS} of the width of the cell"
        )
    if arrangement.shapes is not None:
        from feti_homog.cell.shape_mesher import mesh_shapes  # it is made of what stands here

        return mesh_shapes(arrangement, sizes, arrangement_scale(cell, arrangement))
    return mesh_arrangement(arrangement, sizes, marks, arrangement_scale(cell, arrangement))


def mesh_arrangement(
    arrangement: Arrangement,
    sizes: MeshSizes,
    marks: Mapping[int, Sequence[float]] = NO_MARKS,
    scale: float = 1.0,
) -> CoarseMesh:
    """The periodic coarse mesh of an arrangement, with elements of these sizes, scaled at the end; see `generate`."""
    has_ellipses = arrangement.frames is not None
    lines = (elliptic_outline.outline if has_ellipses else outline)(arrangement, sizes, marks)
    points, triangles, circle = _fill(lines, sizes, sizes.are_graded(arrangement))
    in_disc, in_ring = arrangement.within
    within = [(in_ring if ring else in_disc)[disc] for disc, ring in zip(lines.disc, lines.is_coating, strict=True)]
    place = {name: number for number, name in enumerate((*arrangement.phases, VOID))}
    phase = np.array([place[name] for name in (*within, arrangement.phases[0])], np.int32)[circle]
    is_coating = lines.is_coating & ~arrangement.is_hollow[lines.disc]
    number = lines.disc + 1 + np.where(is_coating, arrangement.fibres, 0)
    arc_edges, arc_circle = _arc_edges(lines)
    filled = CoarseMesh(
        width=scale * arrangement.width,
        height=scale * arrangement.height,
        points=scale * points,
        triangles=flip_double_arcs(triangles, phase, arc_edges, arc_circle, len(points)),
        phase=phase,
        phases=arrangement.phases,
        precedence=np.append(number, 0)[circle].astype(np.int32),
        representative=representatives(points, arrangement.width, arrangement.height),
        ellipses=lines.ellipses.scaled(scale),
        arc_edges=arc_edges,
        arc_circle=arc_circle,
        debonded_edges=np.zeros((0, 2), np.int32),
        centres=scale * arrangement.centres[: arrangement.fibres] if has_ellipses else None,
    )
    return without_voids(filled, place[VOID]) if VOID in within else filled


def _arc_edges(lines: Outline) -> tuple[Int32, Int32]:
    """Edges (a, 2) on circles, and their circles (a,)."""
    arcs = [curve for curve in lines.curves if curve.circle != MATRIX]
    pairs = [np.stack([arc.nodes[:-1], arc.nodes[1:]], axis=1) for arc in arcs]
    circle = np.repeat(np.array([arc.circle for arc in arcs], np.int32), [len(edges) for edges in pairs])
    return np.concatenate([np.zeros((0, 2), np.int32), *pairs]).astype(np.int32), circle


def _sizes(cell: Cell, marks: Mapping[int, Sequence[float]]) -> MeshSizes:
    """Those that a cell of width 1 is asked for."""
    interface = cell.mesh_size if cell.interface_size is None else cell.interface_size
    tip = interface if cell.tip_size is None or not marks else cell.tip_size
    return MeshSizes(cell.mesh_size, interface, tip)


def arrangement_scale(cell: Cell, arrangement: Arrangement) -> float:
    """Lengths of the cell / those of the arrangement."""
    if cell.fibre_radius is not None:
        return float(cell.fibre_radius / arrangement.radii[: arrangement.fibres].mean())
    width = mixed_width(cell) if cell.table is None else cell.table.width
    return width or 1.0


def _refuse_extremes(cell: Cell, sizes: MeshSizes, tips: int) -> None:
    """Raise MeshError for a cell that would take hours to mesh, before it is begun."""
    around = min(sizes.interface, element_estimate.interface_size(cell))
    at_tips = tips * element_estimate.triangles_of_a_tip(max(1.0, around / sizes.tip))
    count = element_estimate.triangles(cell) + at_tips
    if count > MAX_TRIANGLES:
        keys = ("mesh_size", "interface_size", "tip_size") if at_tips else ("mesh_size", "interface_size")
        given = [f"{name} = {value:.3g}" for name in keys if (value := getattr(cell, name)) is not None]
        given += [] if cell.fibres is None else [f"fibres = {cell.fibres}"]
        raise MeshError(
            f"[cell] {', '.join(given)}: about {count:.2g} elements before refine; expected at most {MAX_TRIANGLES}; "
            "refine splits them on the ranks"
        )


@contextmanager
def gmsh_session() -> Iterator[ModuleType]:
    """gmsh, initialised, silent, with fixed options and an empty model; finalised at the end."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for option, value in {
            "General.Terminal": 0,
            "General.NumThreads": 1,
            "Mesh.Algorithm": FRONTAL_DELAUNAY,
            "Mesh.RandomSeed": 1,
            "Mesh.Renumber": 0,
        }.items():
            gmsh.option.setNumber(option, value)
        gmsh.model.add("cell")
        yield gmsh
    finally:
        gmsh.finalize()


def _fill(lines: Outline, sizes: MeshSizes, is_graded: bool) -> tuple[Float, Int32, Index]:
    """Nodes (n, 2), those of the outline first, triangles (m, 3) and the smallest circle around each (or MATRIX)."""
    with gmsh_session() as gmsh:
        gmsh.option.setNumber("Mesh.MeshSizeMax", sizes.largest)
        surfaces, circle = _add_surfaces(gmsh, lines)
        if is_graded:
            _grow_from_lines(gmsh, surfaces, sizes.largest)
        gmsh.model.mesh.generate(2)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        elements = [gmsh.model.mesh.getElementsByType(TRIANGLE, surface)[1] for surface in surfaces]
    order = np.argsort(tags)
    points = coordinates.reshape(-1, 3)[order, :2]
    points[: len(lines.points)] = lines.points
    triangles = np.searchsorted(tags[order], np.concatenate(elements)).astype(np.int32).reshape(-1, 3)
    clockwise = areas(points, triangles) < 0
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    return points, triangles, np.repeat(circle, [len(nodes) // 3 for nodes in elements])


def _grow_from_lines(gmsh: ModuleType, surfaces: list[int], largest: float) -> None:
    """Let elements be as large as the nearest edge of the outline, h, h + g d at the distance d from it.

    Without this, gmsh interpolates between the lines: a disc would be as fine within as on its circle.
    """
    field = gmsh.model.mesh.field
    extended = field.add("Extend")
    field.setNumbers(extended, "CurvesList", [tag for _, tag in gmsh.model.getEntities(1)])
    field.setNumbers(extended, "SurfacesList", surfaces)
    for option, value in {"SizeMax": largest, "DistMax": largest / MAX_GROWTH, "Power": 1}.items():
        field.setNumber(extended, option, value)
    field.setAsBackgroundMesh(extended)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    gmsh.option.setNumber("Mesh.Algorithm", DELAUNAY)


def _add_lines(gmsh: ModuleType, lines: Outline) -> list[list[int]]:
    """Make each edge of the outline a line of one element, node n a point n + 1; the lines of each curve."""
    geo = gmsh.model.geo
    for tag, (x, y) in enumerate(lines.points.round(DECIMALS).tolist(), 1):
        geo.addPoint(x, y, 0.0, tag=tag)
    made = []
    for curve in lines.curves:
        nodes = (curve.nodes + 1).tolist()
        made.append([geo.addLine(start, stop) for start, stop in pairwise(nodes)])
    for tag in chain.from_iterable(made):
        geo.mesh.setTransfiniteCurve(tag, 2)
    return made


def _add_surfaces(gmsh: ModuleType, lines: Outline) -> tuple[list[int], list[int]]:
    """Add the plane surfaces of fibres, coatings and matrix; their tags, and the circle next around each or MATRIX."""
    geo, made = gmsh.model.geo, _add_lines(gmsh, lines)

    def add_loop(loop: list[Signed]) -> int:
        tags = [made[tag - 1] if tag > 0 else [-line for line in reversed(made[-tag - 1])] for tag, _ in loop]
        return int(geo.addCurveLoop(list(chain.from_iterable(tags))))

    surfaces, circle = [], []
    regions = defaultdict(list)
    for loop in _loops(_bounding_lines(lines)):
        regions[loop[0][1].inside].append(loop)
    # The matrix is last.
    for region in sorted(regions, key=lambda inside: inside == MATRIX):
        for loops in _with_holes(regions[region], lines.points):
            surfaces.append(geo.addPlaneSurface([add_loop(loop) for loop in loops]))
            circle.append(region)
    geo.synchronize()
    return surfaces, circle


def _bounding_lines(lines: Outline) -> list[Signed]:
    """All lines with what they bound on their left: pieces of sides, arcs, and arcs backwards with a negative tag."""
    forwards = list(enumerate(lines.curves, 1))
    backwards = [
        (-tag, Curve(curve.nodes[::-1], curve.circle, curve.outside, curve.inside))
        for tag, curve in forwards
        if curve.circle != MATRIX
    ]
    return forwards + backwards


def _loops(lines: list[Signed]) -> list[list[Signed]]:
    """Closed chains of lines that have one region on their left; each vertex of a region starts one line."""
    after = {(curve.inside, int(curve.nodes[0])): (tag, curve) for tag, curve in lines}
    loops = []
    while after:
        loop = [after.pop(next(iter(after)))]
        while (key := (loop[0][1].inside, int(loop[-1][1].nodes[-1]))) in after:
            loop.append(after.pop(key))
        loops.append(loop)
    return loops


def _with_holes(loops: list[list[Signed]], points: Float) -> list[list[list[Signed]]]:
    """Groups of loops, each an outer one followed by the holes, which are whole circles, within it."""
    holes = [loop for loop in loops if _is_hole(loop)]
    outer = [loop for loop in loops if not _is_hole(loop)]
    if len(outer) == 1:
        return [outer + holes]
    groups = [[loop] for loop in outer]
    polygons = [_polygon(loop, points) for loop in outer]
    for hole in holes:
        place = points[hole[0][1].nodes[0]]
        groups[next(k for k, polygon in enumerate(polygons) if _contains(polygon, place))].append(hole)
    return groups


def _is_hole(loop: list[Signed]) -> bool:
    """Whether the loop is a circle run backwards."""
    return all(tag < 0 for tag, _ in loop)


def _polygon(loop: list[Signed], points: Float) -> Float:
    """(k, 2) nodes of the loop in order."""
    return np.asarray(points[np.concatenate([curve.nodes[:-1] for _, curve in loop])])


def _contains(polygon: Float, point: Float) -> bool:
    """Whether a polygon (k, 2) contains a point, by counting the edges to its right."""
    a, b = polygon - point, np.roll(polygon, -1, axis=0) - point
    crossing = (a[:, 1] > 0) != (b[:, 1] > 0)
    rise = np.where(crossing, b[:, 1] - a[:, 1], 1.0)
    return bool(np.count_nonzero(crossing & (a[:, 0] - a[:, 1] * (b[:, 0] - a[:, 0]) / rise > 0)) % 2)
