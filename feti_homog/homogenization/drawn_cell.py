"""What rank 0 knows of a cell of round fibres from its drawing alone, before it has triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.case.case import Case
from feti_homog.errors import CaseError
from feti_homog.homogenization import interface_pairs
from feti_homog.homogenization.cell_remarks import subdomain_remarks, table_remarks
from feti_homog.homogenization.domain_partition import CellSummary, in_cell, match_distance
from feti_homog.mesh.coarse_mesh import representatives
from feti_homog.mesh.fill.drawing import Drawing
from feti_homog.mesh.outline.curves import MATRIX
from feti_homog.mesh.periodic_topology import places_by_depth
from feti_homog.mesh.tiles.filling import arc_edges
from feti_homog.mesh.tiles.tile_torus import NumberedTile
from feti_homog.typing import Int


@dataclass(frozen=True)
class DrawnCell:
    """Facts for all ranks.

    Attributes:
        pairs: (phases, phases) as in `interface_pairs.pairs_of`.
        nesting: (constituents,) as in `Torus.nesting`.
        edges: (constituents,) coarse edges that each shares with others.
    """

    pairs: Int
    nesting: Int
    edges: Int


def drawn_cell(case: Case, drawing: Drawing) -> DrawnCell:
    """That of a cell without debonded arcs.

    Raises:
        CaseError: an interface of the case is between phases that do not touch.
    """
    regions, around, curves = drawing.regions, drawing.lines.around, drawing.lines.curves
    # The last of `constituent` is the matrix, which is around where `around` is MATRIX, -1.
    inside, outside = regions.constituent[:-1], regions.constituent[around]
    solid = (inside >= 0) & (outside >= 0)
    faults = interface_pairs.faults(case, regions.phases, regions.phase[inside[solid]], regions.phase[outside[solid]])
    if faults:
        raise CaseError(*faults)
    n = len(regions.phase)
    depth = np.zeros(n, np.int64)
    depth[inside[inside >= 0]] = np.where(around == MATRIX, 1, 2)[inside >= 0]
    nesting = places_by_depth(depth, regions.phase, regions.phases)
    arcs = np.flatnonzero(curves.circle != MATRIX)
    beside = np.stack([regions.constituent[side[arcs]] for side in (curves.inside, curves.outside)])
    shared = (beside >= 0).all(axis=0)
    count = np.diff(curves.first)[arcs] - 1
    edges = np.bincount(beside[:, shared].ravel(), np.tile(count[shared], 2), n).astype(np.int64)
    return DrawnCell(interface_pairs.pairs_of(case, regions.phases), nesting, edges)


def tiles_to_fill(drawing: Drawing) -> list[NumberedTile]:
    """The tiles of a drawing."""
    lines, arrangement = drawing.lines, drawing.arrangement
    stands_for = representatives(lines.points, arrangement.width, arrangement.height).astype(np.int64)
    return [NumberedTile(nodes, stands_for[nodes], tile) for nodes, tile in drawing.parts]


def summary_of(case: Case, drawing: Drawing, subdomains: int, triangles: int) -> CellSummary:
    """That of the cell, cut into so many subdomains of so many coarse triangles."""
    regions, lines, arrangement = drawing.regions, drawing.lines, drawing.arrangement
    own = regions.constituent[:-1]
    solid = np.flatnonzero(own >= 0)
    circle = solid[np.unique(own[solid], return_index=True)[1]]
    disc, hollow = lines.disc[circle], arrangement.is_hollow
    is_fibre = ~lines.is_coating[circle] | hollow[disc]
    centres = in_cell(drawing.scale * arrangement.centres[disc], np.array([regions.width, regions.height]))
    radii = regions.ellipses.circles[circle, 2]
    ends = drawing.scale * lines.points[arc_edges(lines.curves)[0]]
    nothing = np.full((1, 2), np.nan)
    return CellSummary(
        width=regions.width,
        height=regions.height,
        phases=regions.phases,
        bodies=len(regions.phase),
        subdomains=subdomains,
        coarse_triangles=triangles,
        interface_edge=float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max(initial=0.0)),
        numbers=np.append(0, disc + 1),
        is_fibre=np.append(False, is_fibre),
        constituent_phase=regions.phase,
        centres=np.concatenate([nothing, centres]),
        radii=np.append(np.nan, radii),
        frames=np.concatenate([np.full((1, 2, 2), np.nan), regions.ellipses.frames[circle]]),
        moved_tips=({},) * len(case.interfaces),
        snapped=0.0,
        voids=int(arrangement.is_void.sum() + hollow.sum()),
        match_distance=match_distance(case, regions.width, regions.height, centres[is_fibre], radii[is_fibre]),
        remarks=(*table_remarks(case), *subdomain_remarks(case, len(regions.phase), subdomains, triangles)),
    )
