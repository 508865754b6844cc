"""A cell on its way to a mesh: sketched, with bare lines; drawn, with nodes on them and cut into tiles; filled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from feti_homog.case.phase_names import VOID
from feti_homog.fibres.arrangement import Arrangement
from feti_homog.mesh.coarse_mesh import CoarseMesh, representatives
from feti_homog.mesh.fill.void_holes import without_voids
from feti_homog.mesh.outline.bare_outline import BareOutline, LineStations
from feti_homog.mesh.outline.outline import Outline
from feti_homog.mesh.sizes.graded_size import MeshSizes
from feti_homog.mesh.tiles.filling import Filling, Tile, arc_edges, fill
from feti_homog.mesh.tiles.tile_torus import Regions
from feti_homog.mesh.tiles.tiles import Tiling, cut
from feti_homog.typing import Float, Int, Int32


@dataclass(frozen=True)
class Sketch:
    """What is known of a mesh before its lines have nodes.

    Attributes:
        arrangement: of the discs.
        bare: its lines.
        sizes: of elements.
        tiles: those that it will be cut into; None if it is filled at once.
        scale: as in `Drawing`.
    """

    arrangement: Arrangement
    bare: BareOutline
    sizes: MeshSizes
    tiles: Tiling | None
    scale: float

    @property
    def phases(self) -> tuple[str, ...]:
        """Those of the mesh."""
        return self.arrangement.phases

    def drawn(self, stations: LineStations) -> Drawing:
        """With these nodes.

        Raises:
            MeshError: the sides would have too many.
        """
        return drawing(self.arrangement, self.bare.outline(stations), self.sizes, self.tiles, self.scale)


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
        phase, precedence = self._within
        void = len(self.phases)
        arcs, arc_circle = arc_edges(lines.curves)
        known = arrangement.frames is not None
        filled = CoarseMesh(
            width=scale * arrangement.width,
            height=scale * arrangement.height,
            points=scale * points,
            triangles=triangles,
            phase=phase[circle],
            phases=arrangement.phases,
            precedence=precedence[circle],
            representative=representatives(points, arrangement.width, arrangement.height),
            ellipses=lines.ellipses.scaled(scale),
            arc_edges=arcs,
            arc_circle=arc_circle,
            debonded_edges=np.zeros((0, 2), np.int32),
            centres=scale * arrangement.centres[: arrangement.fibres] if known else None,
        )
        return without_voids(filled, void) if np.any(phase == void) else filled

    @cached_property
    def _within(self) -> tuple[Int32, Int32]:
        """(k + 1,) the phase next within each circle, a number behind all for a void, and the precedence, as in
        `CoarseMesh`; last those of the matrix."""
        arrangement, lines = self.arrangement, self.lines
        in_disc, in_ring = arrangement.within
        within = [(in_ring if ring else in_disc)[disc] for disc, ring in zip(lines.disc, lines.is_coating, strict=True)]
        place = {name: number for number, name in enumerate((*arrangement.phases, VOID))}
        phase = np.array([place[name] for name in (*within, arrangement.phases[0])], np.int32)
        is_coating = lines.is_coating & ~arrangement.is_hollow[lines.disc]
        precedence = lines.disc + 1 + np.where(is_coating, arrangement.fibres, 0)
        return phase, np.append(precedence, 0).astype(np.int32)

    @cached_property
    def regions(self) -> Regions:
        """What is where.  The matrix of round fibres is one constituent: the plane without discs that do not touch."""
        phase, precedence = self._within
        solid = phase < len(self.phases)
        _, first, constituent = np.unique(precedence[solid], return_index=True, return_inverse=True)
        of_circle = np.full(len(phase), -1)
        of_circle[solid] = constituent
        return Regions(
            width=self.scale * self.arrangement.width,
            height=self.scale * self.arrangement.height,
            scale=self.scale,
            phases=self.phases,
            ellipses=self.lines.ellipses.scaled(self.scale),
            constituent=of_circle,
            phase=phase[solid][first].astype(np.int64),
            nodes=len(self.lines.points),
        )

    def _joined(self, fillings: Sequence[Filling]) -> tuple[Float, Int32, Int]:
        """Nodes, those of the outline first, triangles and the circle around each."""
        count, triangles = len(self.lines.points), []
        for (nodes, _), filling in zip(self.parts, fillings, strict=True):
            inner = np.arange(count, count + len(filling.inner))
            triangles.append(np.concatenate([nodes, inner]).astype(np.int32)[filling.triangles])
            count += len(filling.inner)
        points = np.concatenate([self.lines.points, *(filling.inner for filling in fillings)])
        return points, np.concatenate(triangles), np.concatenate([filling.circle for filling in fillings])


def drawing(arrangement: Arrangement, lines: Outline, sizes: MeshSizes, tiles: Tiling | None, scale: float) -> Drawing:
    """That of an arrangement with this outline, cut into tiles."""
    whole = Tile(lines.points, lines.curves, sizes.largest, sizes.are_graded(arrangement))
    return Drawing(arrangement, lines, tuple(cut(lines, whole, tiles)), scale)
