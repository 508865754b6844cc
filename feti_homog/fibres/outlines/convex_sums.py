"""Outlines of any convex shape: sums of a polygon and an ellipse."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from feti_homog.fibres.outlines.ellipses import Ellipses
from feti_homog.fibres.outlines.outlines import directions, widest
from feti_homog.typing import Bool, Float, Int

# Points of each outline from which distances are taken.
POINTS = 256


@dataclass(frozen=True)
class ConvexSums:
    """The k sums c + V + F D of convex hulls V and the unit disc D, as `Outlines`.

    V is that of `cores` (k, m, 2), about the origin; `frames` F (k, 2, 2); `centres` c (k, 2). The core of circles and
    ellipses is the origin, one of fewer corners than m repeats one of them.
    """

    centres: Float
    cores: Float
    frames: Float

    def __len__(self) -> int:
        return len(self.centres)

    def __getitem__(self, rows: Int | Bool) -> ConvexSums:
        return ConvexSums(self.centres[rows], self.cores[rows], self.frames[rows])

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

    def at(self, centres: Float) -> ConvexSums:
        """See `Outlines`."""
        return replace(self, centres=centres)

    def per(self, unit: float) -> ConvexSums:
        """See `Outlines`."""
        return ConvexSums(self.centres / unit, self.cores / unit, self.frames / unit)

    def rounded(self, decimals: int) -> ConvexSums:
        """See `Outlines`."""
        return ConvexSums(*(each.round(decimals) for each in (self.centres, self.cores, self.frames)))

    def grown(self, thickness: Float) -> ConvexSums:
        """See `Outlines`."""
        frames, some = self.frames.copy(), thickness > 0
        is_sharp = some & ~frames.any(axis=(1, 2))
        frames[is_sharp] = thickness[is_sharp, None, None] * np.eye(2)
        round_ = some & ~is_sharp
        frames[round_] = Ellipses(self.centres[round_], frames[round_]).grown(thickness[round_]).frames
        return replace(self, frames=frames)

    def joined(self, others: ConvexSums) -> ConvexSums:
        """See `Outlines`; for cores of as many corners."""
        pairs = ((self.centres, others.centres), (self.cores, others.cores), (self.frames, others.frames))
        return ConvexSums(*(np.concatenate(pair) for pair in pairs))

    def support(self, normal: Float) -> Float:
        """(k, ...) max_v v . n + |F^T n| for unit vectors n (k, ..., 2), as in `Outlines`."""
        core = np.einsum("kmi,k...i->k...m", self.cores, normal).max(axis=-1)
        return np.asarray(core + np.linalg.norm(np.einsum("kij,k...i->k...j", self.frames, normal), axis=-1))

    def parting(self, first: Int, second: Int, vector: Float) -> tuple[Float, Float]:
        """Gaps as in `Outlines`: of convex bodies max_n v . n - h_1(n) - h_2(-n) with their supports h."""
        one, other = self[first], self[second]

        def gap(angle: Float) -> Float:
            n = directions(angle)
            return np.asarray(np.einsum("ki,kmi->km", vector, n) - one.support(n) - other.support(-n))

        normal = directions(widest(vector, gap)[1])
        return normal, one.support(normal) + other.support(-normal)

    def distances(self, offsets: Float) -> Float:
        """Distances as in `Outlines`: those of POINTS points or more."""
        points, _, which = self.at(np.zeros_like(self.centres)).boundary(POINTS)
        first = np.flatnonzero(np.diff(which, prepend=-1))
        each = [np.minimum.reduceat(np.linalg.norm(own[which] - points, axis=1), first) for own in offsets]
        return np.stack(each)

    def facing(self, normal: Float) -> Float:
        """(k, q, 2) a point of each whose outward normal is n (k, q, 2)."""
        corner = np.einsum("kmi,kqi->kqm", self.cores, normal).argmax(axis=2)
        turned = np.einsum("kij,kqi->kqj", self.frames, normal)
        length = np.linalg.norm(turned, axis=2, keepdims=True)
        round_part = np.einsum("kij,kqj->kqi", self.frames, turned / np.where(length > 0, length, 1.0))
        core = np.take_along_axis(self.cores, corner[:, :, None], axis=1)
        return np.asarray(self.centres[:, None] + core + round_part)

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
