"""A cell that is drawn but not yet filled: its outline, its tiles, and the mesh that these become."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.cell.arrangement import Arrangement
from feti_homog.cell.coarse_mesh import CoarseMesh, representatives
from feti_homog.cell.filling import Filling, Tile, arc_edges, fill
from feti_homog.cell.outline import Outline
from feti_homog.cell.void_holes import without_voids
from feti_homog.config.phase_names import VOID
from feti_homog.typing import Float, Int, Int32


@dataclass(frozen=True)
class Drawing:
    """What is known of a mesh before triangles are made.

    Attributes:
        arrangement: of the discs.
        lines: its outline.
        parts: tiles to fill, each with the numbers (n,) of its nodes in the outline.
        scale: lengths of the mesh / those of the arrangement.
    """

    arrangement: Arrangement
    lines: Outline
    parts: tuple[tuple[Int, Tile], ...]
    scale: float

    @property
    def phases(self) -> tuple[str, ...]:
        """Those of the mesh."""
        return self.arrangement.phases

    def filled(self) -> CoarseMesh:
        """The mesh, all tiles filled here."""
        return self.mesh([fill(tile) for _, tile in self.parts])

    def mesh(self, fillings: Sequence[Filling]) -> CoarseMesh:
        """The mesh of which these are the filled tiles, in their order."""
        arrangement, lines, scale = self.arrangement, self.lines, self.scale
        points, triangles, circle = self._joined(fillings)
        in_disc, in_ring = arrangement.within
        within = [(in_ring if ring else in_disc)[disc] for disc, ring in zip(lines.disc, lines.is_coating, strict=True)]
        place = {name: number for number, name in enumerate((*arrangement.phases, VOID))}
        phase = np.array([place[name] for name in (*within, arrangement.phases[0])], np.int32)[circle]
        is_coating = lines.is_coating & ~arrangement.is_hollow[lines.disc]
        number = lines.disc + 1 + np.where(is_coating, arrangement.fibres, 0)
        arcs, arc_circle = arc_edges(lines.curves)
        known = arrangement.frames is not None
        filled = CoarseMesh(
            width=scale * arrangement.width,
            height=scale * arrangement.height,
            points=scale * points,
            triangles=triangles,
            phase=phase,
            phases=arrangement.phases,
            precedence=np.append(number, 0)[circle].astype(np.int32),
            representative=representatives(points, arrangement.width, arrangement.height),
            ellipses=lines.ellipses.scaled(scale),
            arc_edges=arcs,
            arc_circle=arc_circle,
            debonded_edges=np.zeros((0, 2), np.int32),
            centres=scale * arrangement.centres[: arrangement.fibres] if known else None,
        )
        return without_voids(filled, place[VOID]) if VOID in within else filled

    def _joined(self, fillings: Sequence[Filling]) -> tuple[Float, Int32, Int]:
        """Nodes, those of the outline first, triangles and the circle around each."""
        count, triangles = len(self.lines.points), []
        for (nodes, _), filling in zip(self.parts, fillings, strict=True):
            inner = np.arange(count, count + len(filling.inner))
            triangles.append(np.concatenate([nodes, inner]).astype(np.int32)[filling.triangles])
            count += len(filling.inner)
        points = np.concatenate([self.lines.points, *(filling.inner for filling in fillings)])
        return points, np.concatenate(triangles), np.concatenate([filling.circle for filling in fillings])
