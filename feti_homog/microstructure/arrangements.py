"""Arrange fibres on the torus: outlines and phases, the position of the cell sides, and pairs of near fibres."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.errors import MeshError
from feti_homog.microstructure.phase_names import COATING, MATRIX, VOID
from feti_homog.microstructure.shapes import Conics, Discs, Outlines, directions
from feti_homog.typing import Bool, Float, Int

# Decimals of lengths relative to the cell width in comparisons.
DECIMALS = 10
# Decimals of coordinates and sizes passed to gmsh: the last bits differ between machines, and gmsh would make other
# triangles.
GMSH_DECIMALS = 12
# Radius / width of the cell above which positions on a circle differ by more than rounding.
SMALLEST_RADIUS = 1e-6
# The largest number of candidate gaps between tangents, and the least ratio of a candidate to the widest gap.
MOST_GAPS, NARROWEST = 4, 0.7
# Limit for pairs of near fibres: usually about three per fibre, but fibres on top of each other would fill the memory.
MOST_PAIRS = 100_000_000
# Periods from a cell to the neighbouring cells.
STEPS = np.array([step for step in product((-1, 0, 1), repeat=2) if any(step)])


@dataclass(frozen=True)
class Arrangement:
    """N separate fibres and voids on the torus with periods `width` and `height`.

    Attributes:
        outlines: N outlines without rings: coatings, walls of hollow fibres. Fibre k + 1 has the index k; voids follow.
        phase: (N,) phases of the outlines.
        coating: (N,) thickness of the rings around the outlines, 0 without a ring.
        is_hollow: (N,) mask of voids in hollow fibres; their rings have the fibre phase, other rings are coatings.
        mesh_order: (N,) meshing order, which changes a few triangles; by index if None.
        row: (N,) row indices in the fibre table; None for cells without a table.
        origin: lower left corner of the cell in the coordinates of the table.
        remarks: lines for the user on the differences between the cell and the table.
    """

    width: float
    height: float
    outlines: Outlines
    phase: tuple[str, ...]
    coating: Float
    is_hollow: Bool
    mesh_order: Int | None = None
    row: Int | None = None
    origin: tuple[float, float] = (0.0, 0.0)
    remarks: tuple[str, ...] = ()

    @classmethod
    def of_discs(
        cls,
        width: float,
        height: float,
        centres: Float,
        radii: Float,
        phase: tuple[str, ...],
        coating: Float | float = 0.0,
    ) -> Arrangement:
        """Make the arrangement of discs with centres (N, 2), radii (N,) and coating thicknesses (N,) or ()."""
        thickness = np.broadcast_to(coating, radii.shape).astype(float)
        return cls(width, height, Discs(centres, radii), phase, thickness, np.zeros(len(radii), bool))

    @property
    def centres(self) -> Float:
        """The centres (N, 2) of the outlines."""
        return self.outlines.centres

    @cached_property
    def radii(self) -> Float:
        """The radii (N,) of discs with the areas of the outlines, without rings."""
        return self.outlines.radii

    @property
    def size(self) -> Float:
        """The width and height (2,) of the torus."""
        return np.array([self.width, self.height])

    @property
    def phases(self) -> tuple[str, ...]:
        """The phases of the cell: matrix, fibre phases in the order of first occurrence, coating if any; no voids."""
        named = dict.fromkeys(name for name in self.phase if name != VOID)
        has_coating = (self.coated & ~self.is_hollow).any()
        return (MATRIX, *named, COATING) if has_coating else (MATRIX, *named)

    @property
    def is_void(self) -> Bool:
        """The mask (N,) of voids."""
        return np.array([name == VOID for name in self.phase], bool)

    @property
    def voids(self) -> int:
        """The number of voids, including the voids within hollow fibres."""
        return int(self.is_void.sum() + self.is_hollow.sum())

    @property
    def within(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The phases (N,) within the outlines, and the phases (N,) of the rings around the outlines, if any."""
        pairs = list(zip(self.phase, self.is_hollow.tolist(), strict=True))
        rings = tuple(name if is_hollow else COATING for name, is_hollow in pairs)
        return tuple(VOID if is_hollow else name for name, is_hollow in pairs), rings

    def precedence(self, fibre: Int, is_ring: Bool) -> Int:
        """Return the region numbers (k,), from 1, of fibres (k,) or, where `is_ring` (k,), of their rings.

        Coatings follow all fibres, in the order of fibres; the ring of a hollow fibre has the fibre number.
        """
        return np.asarray(fibre + 1 + np.where(is_ring & ~self.is_hollow[fibre], self.fibres, 0))

    @property
    def order(self) -> Int:
        """The indices (N,) of the outlines in meshing order."""
        return np.arange(len(self.phase)) if self.mesh_order is None else self.mesh_order

    @property
    def fibres(self) -> int:
        """The fibre count, without voids."""
        return int((~self.is_void).sum())

    @property
    def walls(self) -> Float:
        """The wall thickness (N,) of hollow fibres, 0 for other outlines."""
        return np.where(self.is_hollow, self.coating, 0.0)

    @property
    def coated(self) -> Bool:
        """The mask (N,) of outlines with a ring."""
        return np.asarray(self.coating > 0)

    @cached_property
    def outer(self) -> Outlines:
        """The N outlines, enlarged by their rings."""
        return self.outlines.grown(self.coating)

    @property
    def outer_radii(self) -> Float:
        """The radii (N,) of discs with the areas of the outlines, plus the thickness of rings."""
        return np.asarray(self.radii + self.coating)

    @cached_property
    def shells(self) -> tuple[Outlines, Int]:
        """All k outlines, with the outer before the inner outline of a ring, and the indices (k,) of their fibres."""
        coated = np.flatnonzero(self.coated)
        fibre = np.concatenate([np.arange(len(self.phase)), coated])
        order = np.argsort(fibre, kind="stable")
        return self.outer.joined(self.outlines[coated])[order], fibre[order]


def clearance(arrangement: Arrangement) -> float:
    """Return the least distance between a cell side and a parallel tangent to an outline."""
    tangents, size = _tangents(arrangement), arrangement.size[:, None]
    return float(np.abs(tangents - size * np.round(tangents / size)).min())


def clear_shift(arrangement: Arrangement) -> Arrangement:
    """Shift an arrangement so that no cell side is tangent to an outline.

    The candidates along an axis are the middles of the widest gaps between tangents. Two candidates make a corner; the
    corner farthest from all outlines is selected. In symmetric cells, for example with two discs, several corners are
    equally far up to rounding errors: the first is selected, so that cells scaled to another length unit have the same
    corner. Corners in voids (`in_voids`) are excluded if others exist.
    """
    size, outlines = arrangement.size, arrangement.shells[0]
    for narrowest in (NARROWEST, 0.0):
        lines = []
        for touching, period in zip(_tangents(arrangement).transpose(1, 0, 2), size, strict=True):
            places = np.sort(touching.ravel() % period)
            gaps = np.diff(places, append=places[0] + period)
            wide = np.argsort(-gaps.round(DECIMALS), kind="stable")[:MOST_GAPS]
            wide = wide[gaps[wide] > narrowest * gaps[wide[0]]]
            lines.append(places[wide] + gaps[wide] / 2)
        corners = np.array(list(product(*lines)))
        inside = in_voids(arrangement, corners)
        if not inside.all():
            corners = corners[~inside]
            break
    nearest = outlines.distances(-_away(outlines, corners, size)).min(axis=1)
    corner = corners[np.argmax(nearest.round(DECIMALS))]
    return replace(arrangement, outlines=arrangement.outlines.at((arrangement.centres - corner) % size))


def in_voids(arrangement: Arrangement, corners: Float) -> Bool:
    """Return the mask (n,) of corners (n, 2) within voids, for cells with polygons.

    All entries are False for other cells: their meshes need no node at a corner.
    """
    result = np.zeros(len(corners), bool)
    if isinstance(arrangement.outlines, Conics):
        return result
    from feti_homog.microstructure.shapes import convex_sums  # few cells have polygons

    voids = arrangement.outlines[arrangement.is_void | arrangement.is_hollow]
    away = _away(voids, corners, arrangement.size)
    corner, void = np.nonzero((np.abs(away) < voids.extents.max(axis=2)).all(axis=2))
    normal = directions(np.linspace(0.0, 2 * np.pi, convex_sums.POINTS, endpoint=False))
    reach = voids[void].support(np.broadcast_to(normal, (len(void), *normal.shape)))
    result[corner[(-away[corner, void] @ normal.T < reach).all(axis=1)]] = True
    return result


def _away(outlines: Outlines, places: Float, size: Float) -> Float:
    """Return the vectors (n, k, 2) from `places` (n, 2) to the nearest images of the k centres of outlines."""
    return np.asarray((outlines.centres - places[:, None] + size / 2) % size - size / 2)


def _tangents(arrangement: Arrangement) -> Float:
    """Return the coordinates (k, 2, 2), axis by axis, where each of k outlines and rings begins and ends."""
    outlines, _ = arrangement.shells
    return np.asarray(outlines.centres[:, :, None] + outlines.extents * [-1.0, 1.0])


def neighbours(centres: Float, size: Float, reach: float) -> tuple[Int, Int, Float]:
    """Find all pairs i <= j of centres, periodic images included, that are closer than `reach`.

    A centre and its image form a pair i = j, which occurs from both ends; other pairs of images occur once.  Returns
    i (k,), j (k,), and the vectors (k, 2) from i to the image of j.  Raises MeshError beyond about MOST_PAIRS pairs.
    """
    inside = centres % size
    images = inside + STEPS[:, None] * size
    is_near = ((images > -reach) & (images < size + reach)) | (STEPS[:, None] == 0)
    step, near = np.nonzero(is_near.all(axis=2))
    place, who = np.concatenate([inside, images[step, near]]), np.concatenate([np.arange(len(centres)), near])
    if len(place) ** 2 >= 2 * MOST_PAIRS and reach > 0:
        # A place has about 2 pi times as many neighbours as its square with diagonal `reach` contains.
        column, row = np.floor(place * (np.sqrt(2) / reach)).astype(np.int64).T
        _, crowd = np.unique(column * 2**32 + row, return_counts=True)
        count = np.pi * float((crowd.astype(float) ** 2).sum())
        if count > MOST_PAIRS:
            raise MeshError(
                f"[cell] about {count:.2g} pairs of fibres are nearer to each other than {reach:.2g}; expected at most "
                f"{MOST_PAIRS}: they overlap, or one of them or mesh_size is much larger than the others"
            )
    # Balancing does not pay for a single query.
    tree = cKDTree(place, balanced_tree=False, compact_nodes=False)
    first, second = tree.query_pairs(reach, output_type="ndarray").T
    keep = np.flatnonzero((first < len(centres)) & (who[first] <= who[second]))
    keep = keep[np.argsort(first[keep] * len(place) + second[keep])]
    first, second = first[keep], second[keep]
    return who[first], who[second], place[second] - place[first]
