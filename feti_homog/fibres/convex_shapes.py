"""Convex outlines of fibres: circles, ellipses and rounded polygons, as sums of a polygon and an ellipse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.fibres.ellipses import Ellipses, directions, widest
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class ConvexShapes:
    """The k sums c + V + F D of the convex hull V of `cores` (k, m, 2), about the origin, and the unit disc D under
    `frames` (k, 2, 2); `centres` (k, 2). A core of circles and ellipses is the origin, one of fewer corners than m
    repeats one of them."""

    centres: Float
    cores: Float
    frames: Float

    @classmethod
    def of(cls, ellipses: Ellipses, sides: Int, radius: Float, rounding: Float, angle: Float) -> ConvexShapes:
        """Ellipses, but where there are `sides` (k,) regular polygons with that circumradius (k,), the first corner at
        `angle` (k,) in degrees from x, rounded with circles of radius `rounding` (k,) along their sides."""
        corner = np.minimum(np.arange(max(1, sides.max(initial=1))), np.maximum(sides, 1)[:, None] - 1)
        turn = np.radians(angle)[:, None] + 2 * np.pi * corner / np.maximum(sides, 1)[:, None]
        # Corners of the polygon of the centres of the rounding circles.
        core = np.where(sides > 0, radius - rounding / np.cos(np.pi / np.maximum(sides, 3)), 0.0)
        is_polygon = (sides > 0)[:, None, None]
        frames = np.where(is_polygon, rounding[:, None, None] * np.eye(2), ellipses.frames)
        return cls(ellipses.centres, core[:, None, None] * directions(turn), frames)

    def __len__(self) -> int:
        return len(self.centres)

    def __getitem__(self, rows: Int | Bool) -> ConvexShapes:
        return ConvexShapes(self.centres[rows], self.cores[rows], self.frames[rows])

    def at(self, centres: Float) -> ConvexShapes:
        """The same about other centres (k, 2)."""
        return ConvexShapes(centres, self.cores, self.frames)

    def rounded(self, decimals: int) -> ConvexShapes:
        """The same with coordinates of so many decimals."""
        return ConvexShapes(*(each.round(decimals) for each in (self.centres, self.cores, self.frames)))

    def support(self, normal: Float) -> Float:
        """(k, q) how far each reaches from its centre along unit vectors n (k, q, 2): max_v v . n + |F^T n|."""
        core = np.einsum("kmi,kqi->kqm", self.cores, normal).max(axis=2)
        return np.asarray(core + np.linalg.norm(np.einsum("kij,kqi->kqj", self.frames, normal), axis=2))

    def facing(self, normal: Float) -> Float:
        """(k, q, 2) a point of each whose outward normal is n (k, q, 2)."""
        corner = np.einsum("kmi,kqi->kqm", self.cores, normal).argmax(axis=2)
        turned = np.einsum("kij,kqi->kqj", self.frames, normal)
        length = np.linalg.norm(turned, axis=2, keepdims=True)
        round_part = np.einsum("kij,kqj->kqi", self.frames, turned / np.where(length > 0, length, 1.0))
        core = np.take_along_axis(self.cores, corner[:, :, None], axis=1)
        return np.asarray(self.centres[:, None] + core + round_part)

    @property
    def extents(self) -> Float:
        """(k, 2, 2) how far they reach along each axis, backwards and forwards."""
        axes = np.broadcast_to([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]], (len(self), 4, 2))
        return self.support(axes).reshape(-1, 2, 2)

    def boundary(self, count: int) -> tuple[Float, Float, Int]:
        """(q, 2) points all around the shapes, (q, 2) unit normals there and (q,) which shape has them.

        They are those of `count` even normals, and between them where these are farther apart than 1 / count of the
        circumference.
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


def shape_gaps(first: ConvexShapes, second: ConvexShapes) -> Float:
    """The gap (k,) between each of the first and of the second.

    Of convex bodies it is max_n (c_2 - c_1) . n - h_1(n) - h_2(-n) with their supports h: the distance where they are
    apart, else minus the shortest way that parts them.
    """
    vector = second.centres - first.centres

    def gap(angle: Float) -> Float:
        n = directions(angle)
        return np.asarray(np.einsum("ki,kmi->km", vector, n) - first.support(n) - second.support(-n))

    return widest(vector, gap)[0]
