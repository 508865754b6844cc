"""Represent discs and ellipses, affine images of the unit circle: points, tangents, curvature, distances."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from feti_homog.microstructure.shapes.outlines import ColumnRange, Columns, ConvexCurves, directions, on_circle
from feti_homog.typing import Bool, Float, Int

# Relative difference of the squared semi-axes, up to which an ellipse is a circle.
SAME_AXES = 1e-12
# The least ratio of the shorter to the longer semi-axis; thinner tips would need too small elements.
THINNEST = 0.05


@dataclass(frozen=True)
class Ellipses(ConvexCurves):
    """k ellipses of points c + F p with |p| = 1; `centres` c (k, 2), `frames` F (k, 2, 2)."""

    frames: Float

    @classmethod
    def of(cls, centres: Float, a: Float, b: Float, angle: Float) -> Ellipses:
        """Build ellipses about `centres` (k, 2) with semi-axes a, b (k,); a has the direction `angle` (k,), degrees."""
        cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        axes = np.stack([np.stack([cosine, sine], axis=1), np.stack([-sine, cosine], axis=1)], axis=2)
        return cls(centres, axes * np.stack([a, b], axis=1)[:, None])

    @classmethod
    def round(cls, circles: Float) -> Ellipses:
        """Build ellipses with equal semi-axes from circles (k, 3) of centre and radius."""
        return cls(circles[:, :2], circles[:, 2, None, None] * np.eye(2))

    @property
    def circles(self) -> Float:
        """The centres and radii (k, 3); the radius is NaN unless the ellipse is round."""
        return np.column_stack([self.centres, np.where(self.are_round, self.radii, np.nan)])

    @property
    def cores(self) -> Float:
        """The cores (k, 1, 2) of `ConvexCurves`: the origin."""
        return np.zeros((len(self), 1, 2))

    @property
    def radii(self) -> Float:
        """The radii (k,) of equal-area discs."""
        return np.asarray(np.sqrt(np.abs(np.linalg.det(self.frames))))

    def grown(self, thickness: Float) -> Ellipses:
        """Return the ellipses with both semi-axes longer by `thickness` (k,); the columns of F must be semi-axes."""
        lengths = np.linalg.norm(self.frames, axis=1)
        return Ellipses(self.centres, self.frames * (1 + thickness[:, None] / lengths)[:, None])

    @property
    def squares(self) -> Float:
        """The matrices F F^T (k, 2, 2), which determine the ellipses except for the centres."""
        return np.asarray(self.frames @ self.frames.transpose(0, 2, 1))

    @property
    def are_round(self) -> Bool:
        """The mask (k,) of circles."""
        squares, radius = self.squares, np.abs(np.linalg.det(self.frames))
        away = np.abs(squares - radius[:, None, None] * np.eye(2)).max(axis=(1, 2))
        return np.asarray(away < SAME_AXES * radius)

    @property
    def semi_axes(self) -> Float:
        """The lengths (k, 2) of the columns of F, which must be semi-axes."""
        return np.asarray(np.linalg.norm(self.frames, axis=1))

    @property
    def perimeters(self) -> Float:
        """The perimeters (k,) by Ramanujan's second formula, too small by at most 0.04 %; see `semi_axes`."""
        a, b = self.semi_axes.T
        h = 3 * ((a - b) / (a + b)) ** 2
        return np.asarray(np.pi * (a + b) * (1 + h / (10 + np.sqrt(4 - h))))

    @property
    def angles(self) -> Float:
        """The angles (k,) from the x axis to the first column of F, a semi-axis, in degrees."""
        return np.asarray(np.degrees(np.arctan2(self.frames[:, 1, 0], self.frames[:, 0, 0])))

    @property
    def longest(self) -> Float:
        """The longer semi-axis (k,) of each ellipse; see `semi_axes`."""
        return np.asarray(self.semi_axes.max(axis=1))

    def points(self, angle: Float) -> Float:
        """Return the points c + F (cos t, sin t) (k, 2) of the ellipses at parameters t (k,)."""
        return np.asarray(self.centres + np.einsum("kij,kj->ki", self.frames, directions(angle)))

    def unit(self, offsets: Float) -> Float:
        """Map vectors d (k, 2) to coordinates F^-1 d (k, 2) in which the ellipses are unit circles."""
        return np.asarray(np.linalg.solve(self.frames, offsets[:, :, None])[:, :, 0])

    def parameter(self, offsets: Float) -> Float:
        """Return the parameters t (k,) where rays from the centres along d (k, 2) intersect the ellipses."""
        unit = self.unit(offsets)
        return np.arctan2(unit[:, 1], unit[:, 0])

    def parameter_at(self, angle: Float) -> Float:
        """Return the parameters (k,) of the points at polar angles (k,) about the centres, in radians."""
        return self.parameter(directions(angle))

    def chord(self, axis: int) -> tuple[Float, Float]:
        """Return middles (k,) and half lengths (k,) of the chords that ellipses cut from the coordinate `axis`.

        An ellipse that does not intersect the axis has the half length 0.  The points d = x - c, with a known component
        v, satisfy d . (F F^T)^-1 d = 1.
        """
        inverse, other = np.linalg.inv(self.squares), 1 - axis
        v = -self.centres[:, other]
        p, q = inverse[:, axis, axis], inverse[:, axis, other] * v
        root = q**2 - p * (inverse[:, other, other] * v**2 - 1)
        return self.centres[:, axis] - q / p, np.sqrt(np.maximum(root, 0.0)) / p

    def support(self, normal: Float) -> Float:
        """Return the support functions |F^T n| (k, ...) at unit vectors n (k, ..., 2)."""
        turned = normal.reshape(len(normal), math.prod(normal.shape[1:-1]), 2) @ self.frames
        return np.asarray(np.sqrt(np.einsum("kmi,kmi->km", turned, turned)).reshape(normal.shape[:-1]))

    def distances(self, offsets: Float) -> Float:
        """Return distances (n, k) of points at d (n, k, 2) from the centres, about ||F^-1 d| - 1| sqrt|det F|."""
        unit = np.einsum("kij,nkj->nki", np.linalg.inv(self.frames), offsets)
        return np.asarray(np.abs(np.linalg.norm(unit, axis=2) - 1) * self.radii)

    def facing(self, normal: Float) -> Float:
        """Return the points (k, 2) of the ellipses where the outward unit normals are n (k, 2)."""
        along = np.einsum("kij,kj->ki", self.squares, normal)
        return np.asarray(self.centres + along / self.support(normal)[:, None])

    def bend(self, normal: Float) -> Float:
        """Return radii of curvature (k,), det(F)^2 / |F^T n|^3, with `frames` F and outward normals n (k, 2)."""
        return np.asarray(np.linalg.det(self.frames) ** 2 / self.support(normal) ** 3)

    def normal(self, angle: Float) -> Float:
        """Return the outward unit normals (k, 2) at the parameters t (k,) of `points`."""
        across = np.einsum("kji,kj->ki", np.linalg.inv(self.frames), directions(angle))
        return np.asarray(across / np.linalg.norm(across, axis=1)[:, None])


class EllipticRows:
    """The shape of table rows with two different semi-axes a and b."""

    name, sizes, has_tips = "ellipses", ("a", "b"), True
    columns = MappingProxyType(
        {"a": ColumnRange(np.nan, above=0.0), "b": ColumnRange(np.nan, above=0.0), "angle": ColumnRange(0.0)}
    )

    def given(self, rows: Columns) -> Bool:
        """Return the mask (N,) of rows with two different semi-axes."""
        return np.asarray(~np.isnan(rows["a"]) & (rows["a"] != rows["b"]))

    def faults(self, rows: Columns) -> Iterator[tuple[Bool, str]]:
        """Yield each check of this shape: the mask (N,) of faulty rows, maybe all False, and the message."""
        a, b = rows["a"], rows["b"]
        thin = np.minimum(a, b) < THINNEST * np.maximum(a, b)
        yield thin, f"expected a / b from {THINNEST:g} to {1 / THINNEST:g}"
        yield self.given(rows) & (rows["inner_radius"] > 0), "has an inner_radius, which only round fibres may have"

    def outlines(self, rows: Columns, centres: Float) -> Ellipses:
        """Build ellipses about `centres` (k, 2) from table rows (k,) with this shape."""
        return Ellipses.of(centres, rows["a"], rows["b"], rows["angle"])


@dataclass(frozen=True)
class Discs(ConvexCurves):
    """k discs with `centres` (k, 2) and `radii` (k,)."""

    radii: Float

    @property
    def cores(self) -> Float:
        """The cores (k, 1, 2) of `ConvexCurves`: the origin."""
        return np.zeros((len(self), 1, 2))

    @property
    def circles(self) -> Float:
        """The centres and radii (k, 3) of the discs."""
        return np.column_stack([self.centres, self.radii])

    @property
    def frames(self) -> Float:
        """The frames F = r I (k, 2, 2)."""
        return np.asarray(self.radii[:, None, None] * np.eye(2))

    @property
    def longest(self) -> Float:
        """The radii (k,), as bounds on the distances from the centres to the points."""
        return self.radii

    def grown(self, thickness: Float) -> Discs:
        """Return the discs enlarged by rings of thickness (k,)."""
        return replace(self, radii=self.radii + thickness)

    def points(self, angle: Float) -> Float:
        """Return the points (k, 2) of the circles at angles (k,) in radians."""
        return on_circle(self.circles, angle)

    def unit(self, offsets: Float) -> Float:
        """Map vectors d (k, 2) to coordinates d / r (k, 2) in which the discs are unit discs."""
        return np.asarray(offsets / self.radii[:, None])

    def parameter(self, offsets: Float) -> Float:
        """Return the angles (k,) of vectors d (k, 2), in radians: parameters of `points`."""
        return np.arctan2(offsets[:, 1], offsets[:, 0])

    def parameter_at(self, angle: Float) -> Float:
        """Return the parameters (k,) at polar angles (k,): the angles themselves, in radians."""
        return angle

    def chord(self, axis: int) -> tuple[Float, Float]:
        """Return middles and half lengths (k,) of the chords that discs cut from the coordinate `axis`; 0 if none."""
        return self.centres[:, axis], np.sqrt(np.maximum(self.radii**2 - self.centres[:, 1 - axis] ** 2, 0.0))

    def support(self, normal: Float) -> Float:
        """Return the supports (k, ...) at unit vectors n (k, ..., 2): the radii."""
        radii = np.expand_dims(self.radii, axis=tuple(range(1, normal.ndim - 1)))
        return np.broadcast_to(radii, normal.shape[:-1])

    def parting(self, first: Int, second: Int, vector: Float) -> tuple[Float, Float]:
        """Return directions between centres, or x if centres coincide, and radius sums; see `ConvexCurves.parting`."""
        length = np.linalg.norm(vector, axis=1)
        normal = np.where(length[:, None] > 0, vector / np.maximum(length, 1e-300)[:, None], [1.0, 0.0])
        return normal, self.radii[first] + self.radii[second]

    def distances(self, offsets: Float) -> Float:
        """Return the distances (n, k) between circles and points at `offsets` (n, k, 2) from the centres."""
        return np.asarray(np.abs(np.linalg.norm(offsets, axis=2) - self.radii))


Conics = Discs | Ellipses
"""Outlines that may have nodes at the tips of debonded arcs in meshes."""
