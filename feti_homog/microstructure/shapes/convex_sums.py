"""Represent outlines of any convex shape, such as rounded polygons, by sums of a polygon and an ellipse."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from feti_homog.microstructure.shapes.ellipses import Discs, Ellipses
from feti_homog.microstructure.shapes.outlines import ColumnRange, Columns, ConvexCurves, directions
from feti_homog.typing import Bool, Float, Int

# Points that represent an outline for distances, curvatures and lengths.
POINTS = 256
# The fewest and the most sides.
SIDES = 3, 12


@dataclass(frozen=True)
class ConvexSums(ConvexCurves):
    """k Minkowski sums c + V + F D of a polygon V and an ellipse F D, with the unit disc D.

    `centres` c (k, 2); V is the hull of `cores` (k, m, 2) about the origin; `frames` F (k, 2, 2).  The core of a circle
    or an ellipse is the origin; a core with fewer corners than m repeats a corner.
    """

    cores: Float
    frames: Float

    @property
    def radii(self) -> Float:
        """The radii (k,) of discs with the area A + P r + pi r^2 (Steiner): core area A, perimeter P, r^2 = |det F|."""
        onward = np.roll(self.cores, -1, axis=1)
        area = (self.cores[..., 0] * onward[..., 1] - self.cores[..., 1] * onward[..., 0]).sum(axis=1) / 2
        around = np.linalg.norm(onward - self.cores, axis=2).sum(axis=1)
        radius = np.sqrt(np.abs(np.linalg.det(self.frames)))
        return np.asarray(np.sqrt((area + around * radius) / np.pi + radius**2))

    @property
    def longest(self) -> Float:
        """Upper bounds (k,) on the distances from the centres to the points of the outlines."""
        core = np.linalg.norm(self.cores, axis=2).max(axis=1)
        return np.asarray(core + np.linalg.norm(self.frames, axis=1).max(axis=1))

    def grown(self, thickness: Float) -> ConvexSums:
        """Return the outlines enlarged by rings of `thickness` (k,), with rounded corners."""
        frames, some = self.frames.copy(), thickness > 0
        is_sharp = some & ~frames.any(axis=(1, 2))
        frames[is_sharp] = thickness[is_sharp, None, None] * np.eye(2)
        round_ = some & ~is_sharp
        frames[round_] = Ellipses(self.centres[round_], frames[round_]).grown(thickness[round_]).frames
        return replace(self, frames=frames)

    def support(self, normal: Float) -> Float:
        """Return the supports (k, ...) at unit vectors n (k, ..., 2): max_v v . n + |F^T n| over corners v of V."""
        flat = normal.reshape(len(normal), math.prod(normal.shape[1:-1]), 2)
        core, turned = (flat @ self.cores.transpose(0, 2, 1)).max(axis=2), flat @ self.frames
        return np.asarray((core + np.sqrt(np.einsum("kmi,kmi->km", turned, turned))).reshape(normal.shape[:-1]))

    def distances(self, offsets: Float) -> Float:
        """Return distances (n, k) from about POINTS outline points to points at `offsets` (n, k, 2) from centres."""
        points, _, which = self.at(np.zeros_like(self.centres)).boundary(POINTS)
        first = np.flatnonzero(np.diff(which, prepend=-1))
        each = [np.minimum.reduceat(np.linalg.norm(vectors[which] - points, axis=1), first) for vectors in offsets]
        return np.stack(each)

    def facing(self, normal: Float) -> Float:
        """Return the points (k, q, 2) of the outlines where the outward unit normals are n (k, q, 2)."""
        corner = np.einsum("kmi,kqi->kqm", self.cores, normal).argmax(axis=2)
        turned = np.einsum("kij,kqi->kqj", self.frames, normal)
        length = np.linalg.norm(turned, axis=2, keepdims=True)
        round_part = np.einsum("kij,kqj->kqi", self.frames, turned / np.where(length > 0, length, 1.0))
        core = np.take_along_axis(self.cores, corner[:, :, None], axis=1)
        return np.asarray(self.centres[:, None] + core + round_part)

    def boundary(self, count: int) -> tuple[Float, Float, Int]:
        """Return q points along all outlines (q, 2), outward unit normals (q, 2), and outline numbers (q,).

        Normals have `count` equidistant directions; points on straight sides are at most perimeter / count apart.
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


Outlines = Discs | Ellipses | ConvexSums


class PolygonalRows:
    """The shape of table rows with `sides`: regular polygons with rounded corners.

    `radius` is the circumradius; the first corner lies at `angle`.  The rounding circles touch both sides of a corner;
    `corner` is the ratio of their radius to the radius of the incircle.
    """

    name, sizes, has_tips = "polygons", ("radius",), False
    columns = MappingProxyType({"sides": ColumnRange(0.0, least=0.0), "corner": ColumnRange(0.0, least=0.0)})

    def given(self, rows: Columns) -> Bool:
        """Return the mask (N,) of rows whose `sides` are not 0."""
        return np.asarray(rows["sides"] != 0)

    def faults(self, rows: Columns) -> Iterator[tuple[Bool, str]]:
        """Yield each check of this shape: the mask (N,) of faulty rows, maybe all False, and the message."""
        (least, most), sides, corner, given = SIDES, rows["sides"], rows["corner"], self.given(rows)
        are_odd = given & ((sides != np.round(sides)) | (sides < least) | (sides > most))
        yield are_odd, f"expected sides from {least} to {most}, a whole number, or 0"
        yield given & (corner > 1), "expected corner at most 1, which makes a circle"
        yield ~given & (corner > 0), "has a corner, but no sides"
        for name in ("a", "coating", "inner_radius"):
            yield given & (np.nan_to_num(rows[name]) > 0), f"has sides and {name}; give one"

    def outlines(self, rows: Columns, centres: Float) -> ConvexSums:
        """Build rounded polygons about `centres` (k, 2) from table rows (k,) with this shape."""
        sides, radius = np.maximum(rows["sides"].astype(np.intp), SIDES[0]), rows["radius"]
        rounding = rows["corner"] * radius * np.cos(np.pi / sides)
        # The centres of the rounding circles are the corners of the core.
        core = radius - rounding / np.cos(np.pi / sides)
        corner = np.minimum(np.arange(sides.max()), sides[:, None] - 1)
        turn = np.radians(rows["angle"])[:, None] + 2 * np.pi * corner / sides[:, None]
        return ConvexSums(centres, core[:, None, None] * directions(turn), rounding[:, None, None] * np.eye(2))
