"""Where the fibres are: square, hexagonal and random arrangements of discs on the torus."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from math import fsum, pi, sqrt
from typing import TYPE_CHECKING

import numpy as np

from feti_homog.case.mixed_cell import fibre_counts, fractions_in_words, void_count
from feti_homog.case.phase_names import COATING, FIBRE, MATRIX, VOID
from feti_homog.errors import MeshError
from feti_homog.fibres.convex_shapes import ConvexShapes
from feti_homog.fibres.ellipses import Ellipses
from feti_homog.fibres.relaxation import relax
from feti_homog.typing import Bool, Float, Int

if TYPE_CHECKING:
    from feti_homog.case.cell_section import Cell


# Quenched random packings jam near this area fraction.
JAMMED = 0.84
# Steps of the descent after which an arrangement counts as jammed; found ones take less than 200.
MAX_STEPS = 2000


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


def arrange(cell: Cell) -> Arrangement:
    """The arrangement that a case asks for in a cell of width 1, its fractions `cell.fractions` to rounding.

    square: one disc in the middle of a 1 x 1 cell. hexagonal: 1 x sqrt(3), a disc in the middle and one at
    the corner. random: discs in a 1 x 1 cell, see `random_arrangement`, with
    `cell.match` see `matched_arrangement`. table: see `table_arrangement.table_arrangement`.

    Raises:
        MeshError: discs of that fraction touch, no arrangement is found, or the table is faulty.
    """
    if cell.match is not None:
        from feti_homog.fibres.matched_arrangement import matched_arrangement

        return matched_arrangement(cell)
    if cell.geometry == "table":
        from feti_homog.fibres.table_arrangement import table_arrangement

        return table_arrangement(cell)
    return ARRANGEMENTS[cell.geometry](cell)


def square_arrangement(cell: Cell) -> Arrangement:
    """One disc in the middle of the unit square."""
    return _lattice(cell, 1.0, np.array([[0.5, 0.5]]), pi / 4)


def hexagonal_arrangement(cell: Cell) -> Arrangement:
    """Discs at the corner and in the middle of a 1 x sqrt(3) cell: the hexagonal lattice of distance 1."""
    return _lattice(cell, sqrt(3), np.array([[0.0, 0.0], [0.5, sqrt(3) / 2]]), pi / (2 * sqrt(3)))


def _lattice(cell: Cell, height: float, centres: Float, limit: float) -> Arrangement:
    """Equal discs at the centres (N, 2) of a 1 x height cell, which touch at the fraction `limit` if they are bare."""
    fraction = cell.fibre_fraction
    limit /= (1 + (cell.coating or 0.0)) ** 2
    assert fraction is not None
    if fraction >= limit:
        raise MeshError(
            f"[cell] fibre_fraction = {fraction:g}: the fibres of the {cell.geometry} cell touch at "
            f"{limit:.4f}; it must be smaller"
        )
    radius = sqrt(fraction * height / (pi * len(centres)))
    radii = np.full(len(centres), radius)
    return Arrangement(1.0, height, centres, radii, (FIBRE,) * len(centres), coating=_coating(cell, radii))


def _coating(cell: Cell, radii: Float) -> Float | None:
    """Thickness (N,) of the coatings that a case gives all its fibres, of these radii."""
    return None if cell.coating is None else cell.coating * radii


def random_arrangement(cell: Cell, max_steps: int = MAX_STEPS, max_attempts: int | None = None) -> Arrangement:
    """Discs at random in the unit square, periodic, the same for the same case on every machine.

    Radii are uniform in mean * (1 - s, 1 + s), s = `radius_spread`, and scaled to the fraction of each phase; those of
    voids are all alike. Any two discs, coatings and images included, are at least `min_gap` mean diameters of fibres
    apart. Random centres are moved down the gradient of the overlap energy 1/2 sum max(0, R_i + R_j - |x_i - x_j|)^2 of
    the discs grown by half the gap until it is zero; when that has not come after `max_steps`, it starts again from
    other centres, up to `max_attempts` times (default: 10 for few fibres, 3 for many). Last, all is shifted
    (`clear_shift`).

    Raises:
        MeshError: no arrangement is found.
    """
    phase = tuple(name for name, own in fibre_counts(cell).items() for _ in range(own))
    fibres, gap, fraction = len(phase), cell.min_gap, fsum(cell.fractions.values())
    generator = np.random.default_rng(cell.seed)
    radii = 1 + cell.radius_spread * generator.uniform(-1, 1, fibres)
    for name, share in cell.fractions.items():
        own = np.array(phase) == name
        radii[own] *= sqrt(share / (pi * fsum(radii[own] ** 2)))
    coating, clear = _coating(cell, radii), gap * fsum(radii) / fibres
    radii, coating = _with_voids(cell, radii, coating)
    count, phase = len(radii), phase + (VOID,) * (len(radii) - fibres)
    grown = (radii if coating is None else radii + coating) + clear
    ask = f"[cell] {fractions_in_words(cell)} with min_gap = {gap:g} and fibres = {fibres}"
    of_all = "fraction of fibres and voids" if cell.voids else "fibre fraction"
    if pi * np.sum(grown**2) > 0.9:
        raise MeshError(
            f"{ask}: random arrangements with this gap exist up to a {of_all} of at most about "
            f"{JAMMED / (1 + (cell.coating or 0.0) + gap) ** 2:.2f}; lower one of them"
        )
    attempts, best = max_attempts or max(3, min(10, 100 // count)), 0.0
    for _ in range(attempts):
        centres, reached = relax(generator.random((count, 2)), grown, max_steps)
        if reached >= 1:
            return clear_shift(Arrangement(1.0, 1.0, centres, radii, phase, coating=coating))
        best = max(best, reached)
    raise MeshError(
        f"{ask}: no arrangement found in {attempts} attempts; they reached a fibre fraction of at most about "
        f"{fraction * best**2:.2f} with this gap; lower one of them, or change seed"
    )


def _with_voids(cell: Cell, radii: Float, coating: Float | None) -> tuple[Float, Float | None]:
    """Radii and coatings of the fibres, and after them those of the voids."""
    count = void_count(cell, float(radii.mean()))
    if not count:
        return radii, coating
    own = np.full(count, sqrt((cell.voids or 0.0) / (pi * count)))
    return np.append(radii, own), None if coating is None else np.append(coating, np.zeros(count))


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
        touching = np.sort(np.concatenate([centres[:, axis] - radii, centres[:, axis] + radii]) % size[axis])
        gaps = np.diff(touching, append=touching[0] + size[axis])
        wide = np.argsort(-gaps, kind="stable")[:4]
        wide = wide[gaps[wide] > 0.7 * gaps[wide[0]]]
        lines.append(touching[wide] + gaps[wide] / 2)
    corners, half = np.array(list(product(*lines))), np.array(size) / 2
    offset = (centres - corners[:, None] + half) % size - half
    distance = np.abs(np.linalg.norm(offset, axis=2) - radii).min(axis=1)
    return replace(arrangement, centres=(arrangement.centres - corners[np.argmax(distance)]) % size)


ARRANGEMENTS: dict[str, Callable[[Cell], Arrangement]] = {
    "square": square_arrangement,
    "hexagonal": hexagonal_arrangement,
    "random": random_arrangement,
}
