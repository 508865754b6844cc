"""Where the nodes of a curve are: at distances that follow the size of edges along it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from feti_homog.cell.graded_size import SizeField
from feti_homog.errors import MeshError
from feti_homog.typing import Float, Int

# Something (n,) of the curves (n,) at the positions (n,) in [0, 1] on them.
OnCurves = Callable[[Int, Float], Float]


@dataclass(frozen=True)
class Sampling:
    """How sizes are sampled: at so many positions along an arc, a piece of a side and a bridge, and for at most so many
    nodes on all arcs, on the sides along one axis, and on all bridges."""

    arc: int
    side: int
    bridge: int
    most_nodes: int


# Of a cell that one rank meshes in minutes, and of one that all ranks mesh: there an arc is a few edges long.
WHOLE, IN_TILES = Sampling(65, 513, 17, 120_000), Sampling(17, 129, 17, 3_000_000)


@dataclass(frozen=True)
class EdgeSamples:
    """The size of edges h sampled along c curves: at positions `share` (n,) in [0, 1] of them there is ds / h `density`
    (n,); those of curve k are from first[k] up to first[k + 1]."""

    share: Float
    density: Float
    first: Int

    @classmethod
    def of(cls, field: SizeField, point: OnCurves, lengths: Float, cap: OnCurves, least: int) -> EdgeSamples:
        """Samples at `least` equidistant positions, and between them as far as the field asks for more.

        `point` gives the points (n, 2) and `cap` the largest sizes (n,) there; `lengths` (c,) are those of the curves.
        """
        count = len(lengths)
        curve, share = np.repeat(np.arange(count), least), np.tile(np.linspace(0, 1, least), count)
        along = point(curve, share).reshape(count, least, 2)
        sizes = np.minimum(field.on_lines(along).ravel(), cap(curve, share))
        while True:
            way = np.diff(share) * lengths[curve[:-1]]
            wide = (np.diff(curve) == 0) & (way > field.step * np.minimum(sizes[:-1], sizes[1:]))
            if not wide.any():
                break
            at = np.flatnonzero(wide) + 1
            between, own = (share[at - 1] + share[at]) / 2, curve[at]
            more = np.minimum(field.at(point(own, between)), cap(own, between))
            curve, share, sizes = (np.insert(*x) for x in ((curve, at, own), (share, at, between), (sizes, at, more)))
        return cls(share, lengths[curve] / sizes, np.searchsorted(curve, np.arange(count + 1)))

    def stations(self, least: Int, most: int) -> tuple[Float, Int]:
        """Positions (m,) in [0, 1] of the nodes of each curve, with where its begin (c + 1,): `least` (c,) edges or
        more, equidistant in ds / h.

        Raises MeshError if they would be more than `most`.
        """
        measure = self._measures()
        whole = measure[self.first[1:] - 1]
        if whole.sum() > most:
            raise MeshError(
                f"[cell] the lines of the cell need about {whole.sum():.2g} nodes; expected at most "
                f"{most}: make mesh_size and interface_size larger, or fibre_fraction or fibres smaller"
            )
        edges = np.maximum(np.ceil(whole - 1e-6).astype(int), least)
        first = np.concatenate([[0], np.cumsum(edges + 1)])
        curve = np.repeat(np.arange(len(edges)), edges + 1)
        target = (np.arange(first[-1]) - first[curve]) * (whole / edges)[curve]
        target[first[1:] - 1] = whole
        return self._at(measure, curve, target), first

    def _measures(self) -> Float:
        """(n,) int ds / h from the beginning of the curve, by the trapezoidal rule."""
        measure, counts = np.zeros(len(self.share)), np.diff(self.first)
        for count in np.unique(counts):
            rows = self.first[:-1][counts == count, None] + np.arange(count)
            d, s = self.density[rows], self.share[rows]
            measure[rows[:, 1:]] = np.cumsum((d[:, 1:] + d[:, :-1]) / 2 * np.diff(s, axis=1), axis=1)
        return measure

    def _at(self, measure: Float, curve: Int, target: Float) -> Float:
        """The positions (m,) where the measure of curves (m,) is `target` (m,), linear between samples."""
        last = self.first[1:] - 1
        # All in one ascending row, the curves 1 apart; the rounding of large sums may miss an interval by one.
        shift = np.concatenate([[0.0], np.cumsum(measure[last] + 1)[:-1]])
        row = measure + np.repeat(shift, np.diff(self.first))
        j = np.searchsorted(row, target + shift[curve], side="right") - 1
        j = np.clip(j, self.first[curve], last[curve] - 1)
        j = np.maximum(j - (measure[j] > target), self.first[curve])
        j = np.minimum(j + (measure[j + 1] <= target), last[curve] - 1)
        slope = (self.share[j + 1] - self.share[j]) / (measure[j + 1] - measure[j])
        at = slope * (target - measure[j]) + self.share[j]
        return np.where(target == measure[last[curve]], 1.0, at)
