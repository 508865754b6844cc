"""Fibres on the torus: which outlines they have, of what they are made, and where the sides of the cell pass."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from feti_homog.case.phase_names import COATING, MATRIX, VOID
from feti_homog.fibres.clear_sides import farthest, widest_gaps
from feti_homog.fibres.convex_shapes import ConvexShapes
from feti_homog.fibres.ellipses import Ellipses
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class Arrangement:
    """Discs with `centres` (N, 2) and `radii` (N,) on the torus of periods `width`, `height`; none touch.

    `phase` (N,) names what each disc is made of. Fibre k + 1 of a case is disc k; voids come after the fibres.
    `mesh_order` (N,) are the discs in the order in which they are meshed, on which a few triangles depend; that of the
    discs if it is None. `coating` (N,) is the thickness of the ring around each disc, 0 where there is none; None if no
    disc has one. Rings do not touch. `frames` (N, 2, 2) are those of `Ellipses` where some discs are ellipses, with
    `radii` of the same areas; else None. A coating makes the semi-axes of an ellipse longer by its thickness. Discs
    that are `hollow` (N,), if any, are voids within rings of the fibre's own phase. `shapes` are the outlines where
    some are polygons, with `radii` of the same areas; else None.
    """

    width: float
    height: float
    centres: Float
    radii: Float
    phase: tuple[str, ...]
    mesh_order: Int | None = None
    coating: Float | None = None
    frames: Float | None = None
    hollow: Bool | None = None
    shapes: ConvexShapes | None = None

    @property
    def phases(self) -> tuple[str, ...]:
        """The phases of the cell: the matrix, those of the fibres in the order in which they first appear, coatings."""
        named = dict.fromkeys(name for name in self.phase if name != VOID)
        return (MATRIX, *named, *((COATING,) if (self.coated & ~self.is_hollow).any() else ()))

    @property
    def is_void(self) -> Bool:
        """(N,) which discs are voids."""
        return np.array([name == VOID for name in self.phase], bool)

    @property
    def is_hollow(self) -> Bool:
        """(N,) which discs are hollow fibres."""
        return np.zeros(len(self.radii), bool) if self.hollow is None else self.hollow

    @property
    def within(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """What is in each disc (N,), and what is in the ring around it if there is one (N,)."""
        both = list(zip(self.phase, self.is_hollow.tolist(), strict=True))
        return tuple(VOID if void else own for own, void in both), tuple(own if void else COATING for own, void in both)

    @property
    def fibres(self) -> int:
        """Number of fibres."""
        return int((~self.is_void).sum())

    @property
    def thickness(self) -> Float:
        """(N,) of the coatings."""
        return np.zeros(len(self.radii)) if self.coating is None else self.coating

    @property
    def coated(self) -> Bool:
        """(N,) which discs have a coating."""
        return np.asarray(self.thickness > 0)

    @property
    def outer_radii(self) -> Float:
        """(N,) of the discs with their coatings."""
        return np.asarray(self.radii + self.thickness)

    @property
    def circles(self) -> tuple[Float, Int]:
        """Radii (k,) of all circles, and their discs (k,): for each disc the outer circle, then that within a coating.

        The circles come in the order of the discs.
        """
        disc = np.concatenate([np.arange(len(self.radii)), np.flatnonzero(self.coated)])
        radii = np.concatenate([self.outer_radii, self.radii[self.coated]])
        order = np.argsort(disc, kind="stable")
        return radii[order], disc[order]

    @property
    def ellipses(self) -> Ellipses:
        """The discs and ellipses."""
        assert self.frames is not None
        return Ellipses(self.centres, self.frames)


def clearance(arrangement: Arrangement) -> float:
    """Distance of the sides of the cell from the nearest position at which they would touch a disc."""
    size = np.array([arrangement.width, arrangement.height])
    radii, disc = arrangement.circles
    reach = radii[:, None] * [1, -1]
    touching = np.concatenate([(arrangement.centres[disc, axis, None] + reach) / size[axis] for axis in (0, 1)])
    return float(np.abs((touching - np.round(touching)) * arrangement.width).min())


def clear_shift(arrangement: Arrangement) -> Arrangement:
    """The arrangement moved as a whole such that the cell's boundary stays clear of tangency with the discs.

    Along each axis the candidates are the middles of the widest gaps between the positions where a boundary
    line touches a disc; among their combinations the one whose corner is farthest from a circle is taken.
    """
    size = (arrangement.width, arrangement.height)
    radii, disc = arrangement.circles
    centres = arrangement.centres[disc]
    lines = []
    for axis in (0, 1):
        touching = np.concatenate([centres[:, axis] - radii, centres[:, axis] + radii])
        lines.append(widest_gaps(touching, size[axis]))
    corners, half = np.array(list(product(*lines))), np.array(size) / 2
    offset = (centres - corners[:, None] + half) % size - half
    distance = np.abs(np.linalg.norm(offset, axis=2) - radii).min(axis=1)
    return replace(arrangement, centres=(arrangement.centres - farthest(corners, distance)) % size)
