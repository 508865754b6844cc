"""Mesh a label image within smooth outlines: contours by marching squares, filled by gmsh.

The cell sides run through pixel centres. Contours cross opposite sides at equal positions, so that sides match.
"""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates, zoom
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from feti_homog.case import cell_section
from feti_homog.errors import CaseError, MeshError
from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.fill.element_estimate import refuse_many
from feti_homog.mesh.fill.shape_mesher import filled
from feti_homog.mesh.outline.graded_size import MAX_GROWTH, MIN_EDGES_AROUND, NEAREST, PASSAGE_EDGE, SizeField
from feti_homog.mesh.readers.gmsh_file import MshContent, raw_mesh
from feti_homog.mesh.readers.msh_reader import made
from feti_homog.mesh.tiles.tile_filling import gmsh_session
from feti_homog.microstructure import phase_names
from feti_homog.typing import Bool, Float, Int32


def mesh_contours(phase: Int32, phases: tuple[str, ...], cell: cell_section.Cell) -> CoarseMesh:
    """Mesh the regions of an image within smooth outlines; `phase` (rows, columns) indexes `phases`.

    A Gaussian filter, with a standard deviation of one pixel, smooths the mask from `_every_other`; splines follow the
    contour that encloses the area of the mask.

    Raises:
        CaseError: scikit-image is not installed.
        MeshError: three phases touch each other, elements are too many, or gmsh cannot fill the outlines.
    """
    try:
        from skimage import measure
    except ImportError:
        raise CaseError('[cell] smooth = true: needs scikit-image: pip install "feti_homog[images]"') from None
    mask = _every_other(phase, phases)
    indicator = gaussian_filter(mask.astype(float), 1.0, mode="wrap")
    # Pixels have few distinct values, so that more of them exceed a level than the area within its contour has.
    quarters = zoom(indicator, 2, order=1, mode="grid-wrap", grid_mode=True)
    level = float(np.quantile(quarters, 1.0 - mask.mean(), method="midpoint"))
    # The cell sides run where they cross contours most steeply.
    away = np.abs(indicator - level)
    across = [(away + np.abs(np.roll(indicator, -1, axis) - indicator)).min(axis=axis) for axis in (0, 1)]
    i = int(np.argmax(across[0]))
    # No corner of the cell lies in a void.
    is_void = phase[:, i] == (*phases, phase_names.VOID).index(phase_names.VOID)
    j = int(np.argmax(np.where(is_void, -1.0, np.minimum(across[1], away[:, i]))))
    indicator, phase = (np.roll(array, (-j, -i), (0, 1)) for array in (indicator, phase))
    rows, width = phase.shape
    curves = []
    for contour in measure.find_contours(np.pad(indicator, ((0, 1), (0, 1)), mode="wrap"), level):
        # Points about two pixels apart, both ends included.
        length = np.append(0.0, np.cumsum(np.hypot(*np.diff(contour, axis=0).T)))
        places = np.linspace(0.0, length[-1], max(8, round(length[-1] / 2.0)) + 1)
        curve = np.column_stack([np.interp(places, length, x) for x in contour.T])
        curve[[0, -1]] = contour[[0, -1]]
        curves.append(curve)
    size = np.array([1.0, rows / width])
    field = _size_field(curves, indicator, cell.mesh_size, size)
    refuse_many(field, field.least, size)
    with gmsh_session() as gmsh:
        occ, lines = gmsh.model.occ, []
        for curve in curves:
            *places, last = (curve / width).tolist()
            tags = [occ.addPoint(x, y, 0.0) for y, x in places]
            tags.append(tags[0] if last == places[0] else occ.addPoint(last[1], last[0], 0.0))
            lines.append((1, occ.addSpline(tags)))
        occ.fragment([(2, occ.addRectangle(0.0, 0.0, 0.0, *size.tolist()))], lines)
        occ.synchronize()
        advice = "larger regions of a phase: filter the image, or smooth = false"
        content = filled(gmsh, size, field, "smooth = true", advice)
    mesh = made(raw_mesh(_with_phases(content, phase, phases)), "smooth outlines").scaled(width * cell.pixel)
    # Of the images of the corner, the nearest to the corner of the user's image.
    column, row = (i - width if 2 * i > width else i), (j - rows if 2 * j > rows else j)
    counts = zip(phases, np.bincount(phase.ravel()).tolist(), strict=True)
    shares = ", ".join(f"{name} {count / phase.size:.6g}" for name, count in counts)
    remark = f"[cell] smooth = true: fractions in the image: {shares}"
    return replace(mesh, origin=(cell.pixel * (column + 0.5), cell.pixel * (row + 0.5)), remarks=(remark,))


def _every_other(phase: Int32, phases: tuple[str, ...]) -> Bool:
    """Return the mask (rows, columns) of pixels in phases that are 1, 3, ... contacts away from the matrix.

    Raises MeshError if two touching phases are both in the mask, or both outside: then three phases touch each other.
    """
    n = len(phases)
    a, b = np.divmod(np.unique([phase * n + np.roll(phase, 1, axis) for axis in (0, 1)]), n)
    a, b = a[a != b], b[a != b]
    touching = csr_matrix((np.ones(len(a)), (a, b)), shape=(n, n))
    is_odd = dijkstra(touching, directed=False, indices=0, unweighted=True) % 2 == 1
    for k in np.flatnonzero(is_odd[a] == is_odd[b])[:1]:
        names = f"{phases[a[k]]} and {phases[b[k]]} touch beside a third phase"
        raise MeshError(f"[cell] smooth = true: {names}; expected only two phases along each outline")
    return np.asarray(is_odd[phase])


def _size_field(curves: list[Float], indicator: Float, largest: float, size: Float) -> SizeField:
    """Return the field of edge sizes, in cell widths, for contours with points (k, 2) in pixels.

    A closed curve has at least MIN_EDGES_AROUND edges, and an open curve, which sides cut, half as many, unless the
    edges would be shorter than a pixel. Edges are also shorter in narrow passages: between points with opposite
    gradients of the smoothed mask `indicator`. No edge is longer than `largest`; `size` (2,) is the cell size.
    """
    unit, period = 1.0 / indicator.shape[1], np.array(indicator.shape, float)
    points = np.concatenate([np.zeros((1, 2)), *curves])
    edges = [MIN_EDGES_AROUND / (1 if (curve[0] == curve[-1]).all() else 2) for curve in curves]
    lengths = [np.hypot(*np.diff(curve, axis=0).T).sum() / n for curve, n in zip(curves, edges, strict=True)]
    length = np.repeat([np.inf, *lengths], [1, *map(len, curves)])
    slopes = [np.roll(indicator, -1, k) - np.roll(indicator, 1, k) for k in (0, 1)]
    normal = np.column_stack([map_coordinates(slope, points.T, order=1, mode="grid-wrap") for slope in slopes])
    normal /= np.maximum(np.hypot(*normal.T), np.finfo(float).tiny)[:, None]
    ranks = list(range(1, min(NEAREST, len(points)) + 1))
    distance, nearest = cKDTree(points % period, boxsize=period).query(points % period, k=ranks)
    faces = np.einsum("ijk,ik->ij", normal[nearest], normal) < -0.5
    length = np.minimum(length, PASSAGE_EDGE * np.where(faces, distance, np.inf).min(axis=1))
    length = np.minimum(largest, unit * np.maximum(length, 1.0))
    return SizeField([(unit * points[:, ::-1], length, np.full(len(points), MAX_GROWTH))], size, largest)


def _with_phases(content: MshContent, phase: Int32, phases: tuple[str, ...]) -> MshContent:
    """Give each surface the phase of most of its elements, and remove the elements of voids.

    Edges that rise by more than 0.2 of their length, and so turn by more than 87 degrees, become straight.
    """
    ((tags, nodes, entity),) = (rows for kind, rows in content.elements.items() if kind.startswith("Triangle"))
    order, points = np.argsort(content.tags), content.points.copy()
    place = order[np.searchsorted(content.tags[order], nodes)]
    corners, middles = points[place[:, :3], :2], place[:, 3:]
    onward = np.roll(corners, -1, axis=1)
    straight = (corners + onward) / 2
    rise, length = np.linalg.norm(points[middles, :2] - straight, axis=2), np.linalg.norm(onward - corners, axis=2)
    points[middles[rise > 0.2 * length], :2] = straight[rise > 0.2 * length]
    column, row = np.round(corners.mean(axis=1) * phase.shape[1]).astype(np.int64).T
    surfaces, which = np.unique(entity, return_inverse=True)
    votes = np.zeros((len(surfaces), len(phases)), np.int64)
    np.add.at(votes, (which, phase[row % phase.shape[0], column % phase.shape[1]]), 1)
    phase_of = votes.argmax(axis=1)
    solid = np.flatnonzero(phase_of[which] != (*phases, phase_names.VOID).index(phase_names.VOID))
    numbers = zip(surfaces.tolist(), (phase_of + 1).tolist(), strict=True)
    groups: dict[tuple[int, int], tuple[int, ...]] = {(2, surface): (number,) for surface, number in numbers}
    names = {(2, k + 1): name for k, name in enumerate(phases)}
    return MshContent(content.tags, points, {"Triangle 6": (tags[solid], nodes[solid], entity[solid])}, groups, names)
