"""Where the nodes of a curve are: at distances that follow the size of edges along it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from feti_homog.cell.graded_size import SizeField
from feti_homog.errors import MeshError
from feti_homog.typing import Float, Int

# Nodes on lines with which a cell is still meshed in minutes.
MAX_LINE_NODES = 120_000


@dataclass(frozen=True)
class EdgeSamples:
    """The size of edges sampled along curves: for each of them the positions in [0, 1], and there ds / h."""

    shares: list[Float]
    densities: list[Float]

    @classmethod
    def of(
        cls, field: SizeField, point: Callable[[Int, Float], Float], lengths: Float, caps: Float, least: int
    ) -> EdgeSamples:
        """Samples at `least` equidistant positions, and between them as far as the field asks for more.

        `point` gives the points (n, 2) of curves (n,) at the positions (n,); `lengths` and `caps`, the largest size,
        are those of the curves (c,).
        """
        count = len(lengths)
        curve, share = np.repeat(np.arange(count), least), np.tile(np.linspace(0, 1, least), count)
        sizes = np.minimum(field.at(point(curve, share)), caps[curve])
        while True:
            way = np.diff(share) * lengths[curve[:-1]]
            wide = (np.diff(curve) == 0) & (way > field.step * np.minimum(sizes[:-1], sizes[1:]))
            if not wide.any():
                break
            at = np.flatnonzero(wide) + 1
            between, own = (share[at - 1] + share[at]) / 2, curve[at]
            more = np.minimum(field.at(point(own, between)), caps[own])
            curve, share, sizes = (np.insert(*x) for x in ((curve, at, own), (share, at, between), (sizes, at, more)))
        ends = np.flatnonzero(np.diff(curve)) + 1
        return cls(np.split(share, ends), np.split(lengths[curve] / sizes, ends))

    def stations(self, least: Int) -> list[Float]:
        """For each curve the positions in [0, 1] of its nodes, `least` (c,) edges or more, equidistant in ds / h.

        Raises MeshError if they would be too many.
        """
        pairs = list(zip(self.shares, self.densities, strict=True))
        measures = [np.concatenate([[0.0], np.cumsum((d[1:] + d[:-1]) / 2 * np.diff(share))]) for share, d in pairs]
        whole = np.array([measure[-1] for measure in measures])
        if whole.sum() > MAX_LINE_NODES:
            raise MeshError(
                f"[cell] the lines of the cell need about {whole.sum():.2g} nodes; expected at most "
                f"{MAX_LINE_NODES}: make mesh_size and interface_size larger, or fibre_fraction or fibres smaller"
            )
        counts = np.maximum(np.ceil(whole - 1e-6).astype(int), least)
        parts = zip(measures, counts, self.shares, strict=True)
        return [np.interp(np.linspace(0, own[-1], count + 1), own, share) for own, count, share in parts]
