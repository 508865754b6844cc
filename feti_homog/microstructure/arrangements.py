"""Fibres on the torus: outlines, phases, places where the cell's sides pass, and pairs of near fibres."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.errors import MeshError
from feti_homog.microstructure.phase_names import COATING, MATRIX, VOID
from feti_homog.microstructure.shapes.ellipses import Discs
from feti_homog.microstructure.shapes.outlines import Outlines, directions
from feti_homog.typing import Bool, Float, Int

# Decimals in which lengths / width of the cell are compared.
DECIMALS = 10
# Gaps between tangents that are looked at, and the narrowest of them / the widest.
MOST_GAPS, NARROWEST = 4, 0.7
# Directions of the lines that may part a place from a convex outline.
NORMALS = 360
# Fibres beside each other have three pairs each; those on top of each other would fill the memory.
MOST_PAIRS = 100_000_000
# Distances that are computed one by one faster than a tree is made.
FEW = 4000
# Periods from a cell to those around it.
STEPS = np.array([step for step in product((-1, 0, 1), repeat=2) if any(step)])


@dataclass(frozen=True)
class Arrangement:
    """N fibres and voids on the torus with periods `width`, `height`; none touch.

    Attributes:
        outlines: of them, without the rings around some. Fibre k + 1 in a case is number k; voids come after fibres.
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
        """Discs with centres (N, 2), radii (N,) with coatings (N,)."""
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
        both = list(zip(self.phase, self.is_hollow.tolist(), strict=True))
        return tuple(VOID if void else own for own, void in both), tuple(own if void else COATING for own, void in both)

    def precedence(self, fibre: Int, is_ring: Bool) -> Int:
        """(k,) numbers from 1 for the rings of fibres (k,), or for their insides.

        Coatings come behind all fibres, in the same order.
        """
        return np.asarray(fibre + 1 + np.where(is_ring & ~self.is_hollow[fibre], self.fibres, 0))

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
        own = np.concatenate([np.arange(len(self.phase)), coated])
        order = np.argsort(own, kind="stable")
        return self.outer.joined(self.outlines[coated])[order], own[order]


def clearance(arrangement: Arrangement) -> float:
    """Distance from the cell's sides to the nearest position at which they would touch an outline."""
    touching = _tangents(arrangement) / arrangement.size[:, None]
    return float(np.abs((touching - np.round(touching)) * arrangement.width).min())


def clear_shift(arrangement: Arrangement) -> Arrangement:
    """Return the arrangement moved as a whole.

    The cell's boundary then avoids tangency with the outlines.

    Along each axis the candidates are the middles of the widest gaps between the positions where a boundary
    line touches an outline; among their combinations the one whose corner is farthest from an outline is taken. In
    cells with a symmetry, as any two discs have, several are as good but for rounding: it is the first of them, so that
    the choice does not hang on the unit of length. Corners in voids are left out (`in_voids`).
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
    """(n,) which corners (n, 2) are in voids, for cells with polygons; other meshes need no node at a corner."""
    from feti_homog.microstructure.shapes.convex_sums import ConvexSums  # only tables have polygons

    result = np.zeros(len(corners), bool)
    if isinstance(arrangement.outlines, ConvexSums):
        voids = arrangement.outlines[arrangement.is_void | arrangement.is_hollow]
        away = _away(voids, corners, arrangement.size)
        corner, own = np.nonzero((np.abs(away) < voids.extents.max(axis=2)).all(axis=2))
        normal = directions(np.linspace(0.0, 2 * np.pi, NORMALS, endpoint=False))
        reach = voids[own].support(np.broadcast_to(normal, (len(own), *normal.shape)))
        result[corner[(-away[corner, own] @ normal.T < reach).all(axis=1)]] = True
    return result


def _away(outlines: Outlines, places: Float, size: Float) -> Float:
    """(n, k, 2) vectors from places (n, 2) to the nearest image of each outline's centre."""
    return np.asarray((outlines.centres - places[:, None] + size / 2) % size - size / 2)


def _tangents(arrangement: Arrangement) -> Float:
    """(k, 2, 2) where lines across each axis touch each outline, on either side."""
    outlines, _ = arrangement.shells
    return np.asarray(outlines.centres[:, :, None] + outlines.extents * [-1.0, 1.0])


def neighbours(centres: Float, size: Float, reach: float) -> tuple[Int, Int, Float]:
    """All pairs i <= j nearer than `reach`, and the vectors (k, 2) from i to that image of j.

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
        # A place has about 2 pi times as many neighbours as are in its square with diagonal `reach`.
        column, row = np.floor(place * (np.sqrt(2) / reach)).astype(np.int64).T
        _, crowd = np.unique(column * 2**32 + row, return_counts=True)
        if (count := np.pi * float((crowd.astype(float) ** 2).sum())) > MOST_PAIRS:
            raise MeshError(
                f"[cell] about {count:.2g} pairs of fibres are nearer to each other than {reach:.2g}; expected at most "
                f"{MOST_PAIRS}: they lie on top of each other, or one is much larger than the others"
            )
    if len(centres) * len(place) <= FEW:
        away = place - inside[:, None]
        first, second = np.nonzero(np.triu((away * away).sum(axis=2) <= reach * reach, 1))
    else:
        # A tree that is used once is not worth being balanced.
        tree = cKDTree(place, balanced_tree=False, compact_nodes=False)
        first, second = tree.query_pairs(reach, output_type="ndarray").T
    keep = np.flatnonzero((first < len(centres)) & (who[first] <= who[second]))
    keep = keep[np.argsort(first[keep] * len(place) + second[keep])]
    first, second = first[keep], second[keep]
    return who[first], who[second], place[second] - place[first]
