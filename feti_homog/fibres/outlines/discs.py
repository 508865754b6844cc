"""Discs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class Discs:
    """k of them, as `Outlines`; `centres` (k, 2), `radii` (k,)."""

    centres: Float
    radii: Float

    @property
    def cores(self) -> Float:
        """The origin."""
        return np.zeros((len(self), 1, 2))

    @property
    def frames(self) -> Float:
        """See `Outlines`."""
        return np.asarray(self.radii[:, None, None] * np.eye(2))

    @property
    def longest(self) -> Float:
        """The radii."""
        return self.radii

    @property
    def extents(self) -> Float:
        """The radii."""
        return np.broadcast_to(self.radii[:, None, None], (len(self), 2, 2))

    def __len__(self) -> int:
        return len(self.radii)

    def __getitem__(self, rows: Int | Bool) -> Discs:
        return Discs(self.centres[rows], self.radii[rows])

    def at(self, centres: Float) -> Discs:
        """See `Outlines`."""
        return replace(self, centres=centres)

    def per(self, unit: float) -> Discs:
        """See `Outlines`."""
        return Discs(self.centres / unit, self.radii / unit)

    def rounded(self, decimals: int) -> Discs:
        """See `Outlines`."""
        return Discs(self.centres.round(decimals), self.radii.round(decimals))

    def grown(self, thickness: Float) -> Discs:
        """See `Outlines`."""
        return replace(self, radii=self.radii + thickness)

    def joined(self, others: Discs) -> Discs:
        """See `Outlines`."""
        return Discs(np.concatenate([self.centres, others.centres]), np.concatenate([self.radii, others.radii]))

    def support(self, normal: Float) -> Float:
        """See `Outlines`."""
        return np.broadcast_to(self.radii.reshape(-1, *[1] * (normal.ndim - 2)), normal.shape[:-1])

    def parting(self, first: Int, second: Int, vector: Float) -> tuple[Float, Float]:
        """Gaps as in `Outlines`: along the vectors, or along x where that is 0."""
        length = np.linalg.norm(vector, axis=1)
        normal = np.where(length[:, None] > 0, vector / np.maximum(length, 1e-300)[:, None], [1.0, 0.0])
        return normal, self.radii[first] + self.radii[second]

    def distances(self, offsets: Float) -> Float:
        """See `Outlines`."""
        return np.asarray(np.abs(np.linalg.norm(offsets, axis=2) - self.radii))
