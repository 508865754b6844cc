"""Outlines of any convex shape: sums of a polygon and an ellipse; among them rounded polygons."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from feti_homog.microstructure.shapes.ellipses import Ellipses
from feti_homog.microstructure.shapes.outlines import ColumnRange, Columns, ConvexCurves, directions, widest
from feti_homog.typing import Bool, Float, Int

# Points of each outline from which distances, curvatures and lengths are taken.
POINTS = 256
# The fewest and the most sides.
SIDES = 3, 12


@dataclass(frozen=True)
class ConvexSums(ConvexCurves):
    """The k sums c + V + F D with convex hulls V and the unit disc D, as `Outlines`.

    V is the hull of `cores` (k, m, 2), about the origin; `frames` F (k, 2, 2); `centres` c (k, 2). The core of circles
    and ellipses is the origin; a core of fewer corners than m repeats one of them.
    """

    cores: Float
    frames: Float

    @property
    def radii(self) -> Float:
        """See `Outlines`; by Steiner's formula A + P r + pi r^2 of a core around which the disc of radius r runs."""
        onward = np.roll(self.cores, -1, axis=1)
        area = (self.cores[..., 0] * onward[..., 1] - self.cores[..., 1] * onward[..., 0]).sum(axis=1) / 2
        around = np.linalg.norm(onward - self.cores, axis=2).sum(axis=1)
        radius = np.sqrt(np.abs(np.linalg.det(self.frames)))
        return np.asarray(np.sqrt((area + around * radius) / np.pi + radius**2))

    @property
    def longest(self) -> Float:
        """See `Outlines`."""
        core = np.linalg.norm(self.cores, axis=2).max(axis=1)
        return np.asarray(core + np.linalg.norm(self.frames, axis=1).max(axis=1))

    @property
    def extents(self) -> Float:
        """See `Outlines`."""
        axes = np.broadcast_to([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]], (len(self), 4, 2))
        return self.support(axes).reshape(-1, 2, 2)

    def grown(self, thickness: Float) -> ConvexSums:
        """See `Outlines`."""
        frames, some = self.frames.copy(), thickness > 0
        is_sharp = some & ~frames.any(axis=(1, 2))
        frames[is_sharp] = thickness[is_sharp, None, None] * np.eye(2)
        round_ = some & ~is_sharp
        frames[round_] = Ellipses(self.centres[round_], frames[round_]).grown(thickness[round_]).frames
        return replace(self, frames=frames)

    def support(self, normal: Float) -> Float:
        """Return max_v v . n + |F^T n| (k, ...) for unit vectors n (k, ..., 2), as in `Outlines`."""
        core = np.einsum("kmi,k...i->k...m", self.cores, normal).max(axis=-1)
        return np.asarray(core + np.linalg.norm(np.einsum("kij,k...i->k...j", self.frames, normal), axis=-1))

    def parting(self, first: Int, second: Int, vector: Float) -> tuple[Float, Float]:
        """Maximise v . n - h_1(n) - h_2(-n), h the supports of both, as in `Outlines`."""
        one, other = self[first], self[second]

        def gap(angle: Float) -> Float:
            n = directions(angle)
            return np.asarray(np.einsum("ki,kmi->km", vector, n) - one.support(n) - other.support(-n))

        normal = directions(widest(vector, gap)[1])
        return normal, one.support(normal) + other.support(-normal)

    def distances(self, offsets: Float) -> Float:
        """Return distances as in `Outlines`, from POINTS points or more."""
        points, _, which = self.at(np.zeros_like(self.centres)).boundary(POINTS)
        first = np.flatnonzero(np.diff(which, prepend=-1))
        each = [np.minimum.reduceat(np.linalg.norm(vectors[which] - points, axis=1), first) for vectors in offsets]
        return np.stack(each)

    def facing(self, normal: Float) -> Float:
        """Return points (k, q, 2) whose outward normals are n (k, q, 2)."""
        corner = np.einsum("kmi,kqi->kqm", self.cores, normal).argmax(axis=2)
        turned = np.einsum("kij,kqi->kqj", self.frames, normal)
        length = np.linalg.norm(turned, axis=2, keepdims=True)
        round_part = np.einsum("kij,kqj->kqi", self.frames, turned / np.where(length > 0, length, 1.0))
        core = np.take_along_axis(self.cores, corner[:, :, None], axis=1)
        return np.asarray(self.centres[:, None] + core + round_part)

    def boundary(self, count: int) -> tuple[Float, Float, Int]:
        """Return points (q, 2) all around, their unit normals (q, 2), and their shapes (q,).

        The points have `count` even normals; on straight sides they are at most 1 / count of the circumference apart.
        """
        normal = directions(np.linspace(0, 2 * np.pi, count, endpoint=False))
        points = self.facing(np.broadcast_to(normal, (len(self), count, 2)))
        onward = np.roll(points, -1, axis=1) - points
        length = np.linalg.norm(onward, axis=2)
        steps = np.maximum(1, np.ceil(count * length / length.sum(axis=1, keepdims=True))).astype(np.intp)
        shape, place = np.divmod(np.repeat(np.arange(steps.size), steps.ravel()), count)
        share = np.arange(len(shape)) - np.repeat(np.cumsum(steps) - steps.ravel(), steps.ravel())
        moved = onward[shape, place] * (share / steps[shape, place])[:, None]
        across = np.column_stack([onward[shape, place, 1], -onward[shape, place, 0]])
        on_side = steps[shape, place] > 1
        across[on_side] /= length[shape, place][on_side][:, None]
        return points[shape, place] + moved, np.where(on_side[:, None], across, normal[place]), shape


class PolygonalRows:
    """Rows with `sides`, as `Shape`.

    Regular polygons with that circumradius, the first corner at `angle`, rounded by circles that touch both sides at a
    corner; `corner` is their radius / the incircle's radius.
    """

    name, sizes, has_tips = "polygons", ("radius",), False
    columns = MappingProxyType({"sides": ColumnRange(0.0, least=0.0), "corner": ColumnRange(0.0, least=0.0)})

    def given(self, rows: Columns) -> Bool:
        """Return which rows (N,) have sides."""
        return np.asarray(rows["sides"] != 0)

    def faults(self, rows: Columns) -> Iterator[tuple[Bool, str]]:
        """See `Shape`."""
        (least, most), sides, corner, given = SIDES, rows["sides"], rows["corner"], self.given(rows)
        are_odd = given & ((sides != np.round(sides)) | (sides < least) | (sides > most))
        yield are_odd, f"expected sides from {least} to {most}, a whole number, or 0"
        yield given & (corner > 1), "expected corner at most 1, which makes a circle"
        yield ~given & (corner > 0), "has a corner, but no sides"
        for name in ("a", "coating", "inner_radius"):
            yield given & (np.nan_to_num(rows[name]) > 0), f"has sides and {name}; give one"

    def outlines(self, rows: Columns, centres: Float) -> ConvexSums:
        """See `Shape`."""
        sides, radius = np.maximum(rows["sides"].astype(np.intp), SIDES[0]), rows["radius"]
        rounding = rows["corner"] * radius * np.cos(np.pi / sides)
        # Corners of the polygon of the centres of the rounding circles.
        core = radius - rounding / np.cos(np.pi / sides)
        corner = np.minimum(np.arange(sides.max()), sides[:, None] - 1)
        turn = np.radians(rows["angle"])[:, None] + 2 * np.pi * corner / sides[:, None]
        return ConvexSums(centres, core[:, None, None] * directions(turn), rounding[:, None, None] * np.eye(2))
