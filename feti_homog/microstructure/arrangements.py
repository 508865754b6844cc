"""Fibres on the torus: outlines, phases, places where the cell's sides pass, and pairs of near fibres."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.errors import MeshError
from feti_homog.microstructure.phase_names import COATING, MATRIX, VOID
from feti_homog.microstructure.shapes import Discs, Outlines, convex_sums, directions
from feti_homog.typing import Bool, Float, Int

# Decimals in which lengths / width of the cell are compared.
DECIMALS = 10
# Decimals of coordinates and sizes that gmsh is given. The last bits differ from machine to machine, and with them gmsh
# would make other triangles.
GMSH_DECIMALS = 12
# Radius / width of the cell above which positions on a circle differ by more than rounding.
SMALLEST_RADIUS = 1e-6
# Gaps between tangents that are looked at, and the narrowest of them / the widest.
MOST_GAPS, NARROWEST = 4, 0.7
# Fibres beside each other have three pairs each; those on top of each other would fill the memory.
MOST_PAIRS = 100_000_000
# Periods from a cell to those around it.
STEPS = np.array([step for step in product((-1, 0, 1), repeat=2) if any(step)])


@dataclass(frozen=True)
class Arrangement:
    """N fibres and voids on the torus with periods `width`, `height`; none touch.

    Attributes:
        outlines: without rings. Fibre k + 1 in a case is number k; voids come after fibres.
        phase: (N,) phase of each.
        coating: (N,) ring thickness around each outline, 0 without one.
        is_hollow: (N,) which are voids within rings of the fibre's own phase; other rings are coatings.
        mesh_order: (N,) meshing order, on which a few triangles depend; by number if None.
        row: (N,) place of each in its table; None without one.
        remarks: how the cell differs from its table, a line each.
    """

    width: float
    height: float
    outlines: Outlines
    phase: tuple[str, ...]
    coating: Float
    is_hollow: Bool
    mesh_order: Int | None = None
    row: Int | None = None
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
        """Arrange discs with centres (N, 2), radii (N,) and coatings (N,)."""
        thickness = np.broadcast_to(coating, radii.shape).astype(float)
        return cls(width, height, Discs(centres, radii), phase, thickness, np.zeros(len(radii), bool))

    @property
    def centres(self) -> Float:
        """(N, 2)."""
        return self.outlines.centres

    @cached_property
    def radii(self) -> Float:
        """(N,) radii of equal-area discs, without rings."""
        return self.outlines.radii

    @property
    def size(self) -> Float:
        """(2,) width and height."""
        return np.array([self.width, self.height])

    @property
    def phases(self) -> tuple[str, ...]:
        """The cell's phases: the matrix, fibre phases in the order of their first fibres, coatings."""
        named = dict.fromkeys(name for name in self.phase if name != VOID)
        return (MATRIX, *named, *((COATING,) if (self.coated & ~self.is_hollow).any() else ()))

    @property
    def is_void(self) -> Bool:
        """(N,) which are voids."""
        return np.array([name == VOID for name in self.phase], bool)

    @property
    def voids(self) -> int:
        """Number of voids, also within hollow fibres."""
        return int(self.is_void.sum() + self.is_hollow.sum())

    @property
    def within(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Phases within each outline (N,), and in the ring around it if there is one (N,)."""
        pairs = list(zip(self.phase, self.is_hollow.tolist(), strict=True))
        rings = tuple(name if is_hollow else COATING for name, is_hollow in pairs)
        return tuple(VOID if is_hollow else name for name, is_hollow in pairs), rings

    def precedence(self, fibre: Int, is_ring: Bool) -> Int:
        """Return numbers (k,) from 1 for the rings of fibres (k,), or for their insides.

        Coatings come behind all fibres, in the same order.
        """
        return np.asarray(fibre + 1 + np.where(is_ring & ~self.is_hollow[fibre], self.fibres, 0))

    @property
    def order(self) -> Int:
        """(N,) numbers in meshing order."""
        return np.arange(len(self.phase)) if self.mesh_order is None else self.mesh_order

    @property
    def fibres(self) -> int:
        """Number of fibres."""
        return int((~self.is_void).sum())

    @property
    def walls(self) -> Float:
        """(N,) thickness of hollow fibres, 0 for others."""
        return np.where(self.is_hollow, self.coating, 0.0)

    @property
    def coated(self) -> Bool:
        """(N,) which have a ring."""
        return np.asarray(self.coating > 0)

    @cached_property
    def outer(self) -> Outlines:
        """(N,) the outlines with their rings."""
        return self.outlines.grown(self.coating)

    @property
    def outer_radii(self) -> Float:
        """(N,) radii of equal-area discs, with rings."""
        return np.asarray(self.radii + self.coating)

    @cached_property
    def shells(self) -> tuple[Outlines, Int]:
        """All outlines (k,) and their fibres (k,): of each the outer outline, then the one within a ring."""
        coated = np.flatnonzero(self.coated)
        fibre = np.concatenate([np.arange(len(self.phase)), coated])
        order = np.argsort(fibre, kind="stable")
        return self.outer.joined(self.outlines[coated])[order], fibre[order]


def clearance(arrangement: Arrangement) -> float:
    """Return the distance of the cell's sides from tangency with an outline."""
    touching = _tangents(arrangement) / arrangement.size[:, None]
    return float(np.abs((touching - np.round(touching)) * arrangement.width).min())


def clear_shift(arrangement: Arrangement) -> Arrangement:
    """Shift an arrangement such that the cell's sides are tangent to no outline.

    Along each axis the candidates are the middles of the widest gaps between positions of tangency. Of their
    combinations the corner farthest from an outline is chosen. In cells with a symmetry, as any two discs have, several
    corners are equal but for rounding: the first one is chosen, so that the unit of length does not matter. Corners in
    voids are left out (`in_voids`).
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
    """Return which corners (n, 2) are in voids, for cells with polygons.

    Other meshes need no node at a corner.
    """
    result = np.zeros(len(corners), bool)
    if isinstance(arrangement.outlines, convex_sums.ConvexSums):
        voids = arrangement.outlines[arrangement.is_void | arrangement.is_hollow]
        away = _away(voids, corners, arrangement.size)
        corner, void = np.nonzero((np.abs(away) < voids.extents.max(axis=2)).all(axis=2))
        normal = directions(np.linspace(0.0, 2 * np.pi, convex_sums.POINTS, endpoint=False))
        reach = voids[void].support(np.broadcast_to(normal, (len(void), *normal.shape)))
        result[corner[(-away[corner, void] @ normal.T < reach).all(axis=1)]] = True
    return result


def _away(outlines: Outlines, places: Float, size: Float) -> Float:
    """Return vectors (n, k, 2) from places (n, 2) to the nearest images of the centres."""
    return np.asarray((outlines.centres - places[:, None] + size / 2) % size - size / 2)


def _tangents(arrangement: Arrangement) -> Float:
    """Return where lines across each axis touch each outline (k, 2, 2), on either side."""
    outlines, _ = arrangement.shells
    return np.asarray(outlines.centres[:, :, None] + outlines.extents * [-1.0, 1.0])


def neighbours(centres: Float, size: Float, reach: float) -> tuple[Int, Int, Float]:
    """Find all pairs i <= j nearer than `reach`, and vectors (k, 2) to that image of j.

    Images of one disc are pairs i = j; each image pair comes once or, where i = j, from both ends.

    Raises:
        MeshError: there are more than MOST_PAIRS.
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
        if (count := np.pi * float((crowd.astype(float) ** 2).sum())) > MOST_PAIRS:
            raise MeshError(
                f"[cell] about {count:.2g} pairs of fibres are nearer to each other than {reach:.2g}; expected at most "
                f"{MOST_PAIRS}: they lie on top of each other, or one is much larger than the others"
            )
    # A tree that is used once is not worth being balanced.
    tree = cKDTree(place, balanced_tree=False, compact_nodes=False)
    first, second = tree.query_pairs(reach, output_type="ndarray").T
    keep = np.flatnonzero((first < len(centres)) & (who[first] <= who[second]))
    keep = keep[np.argsort(first[keep] * len(place) + second[keep])]
    first, second = first[keep], second[keep]
    return who[first], who[second], place[second] - place[first]
