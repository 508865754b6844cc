"""Large cells torn where they are meshed: each rank cuts the tiles that it has filled, and no rank has them all.

Pieces of the matrix are within tiles, and a fibre is in one tile, so subdomains depend on the case and on what it asks
of so many ranks, not on who filled which tile.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import numpy as np
from mpi4py import MPI

from feti_homog.case.case import Case
from feti_homog.errors import CaseError
from feti_homog.feti.decomposition.partition import assign_ranks, cut_into_pieces
from feti_homog.homogenization import cell_remarks
from feti_homog.homogenization.cell_remarks import subdomain_remarks, table_remarks
from feti_homog.homogenization.coarse_meshes import deal_tiles, fill_own, fill_tiles, place_nodes
from feti_homog.homogenization.domain_partition import CellSummary, RankShare, distribute, in_cell, match_distance
from feti_homog.homogenization.partition_policy import PartitionPolicy, can_be_cut_across, wanted_pieces
from feti_homog.mesh.coarse_mesh import CoarseMesh, representatives
from feti_homog.mesh.fill.gmsh_mesher import NodedCell
from feti_homog.mesh.outline.curves import MATRIX
from feti_homog.mesh.periodic_topology import Torus, components, places_by_depth
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.mesh.sizes.element_estimate import ElementEstimate
from feti_homog.mesh.submesh import SubdomainTable, SubmeshesOfRank, cut_for_ranks, joined, pinning
from feti_homog.mesh.tiles.filling import arc_edges
from feti_homog.mesh.tiles.tiles import FilledTile, NumberedTile, Regions, tile_torus
from feti_homog.system.parallel.distributed_arrays import alltoall, scatter
from feti_homog.system.parallel.mpi_errors import agree, on_root, on_root_only
from feti_homog.typing import Float, Int


def cut(case: Case, lattice: ReferenceLattice, comm: MPI.Intracomm, policy: PartitionPolicy) -> RankShare:
    """Mesh and cut the cell; return this rank's share.  Collective."""
    noded = place_nodes(case, comm, policy.tiles)
    if on_root(comm, can_be_torn_by_tiles, case, noded, lattice, policy):
        assert not isinstance(noded, CoarseMesh)
        return tear_by_tiles(case, noded, lattice, comm, policy)
    mesh = fill_tiles(noded, comm)
    return scatter(comm, on_root_only(comm, distribute, case, mesh, lattice, comm.size, policy) or [])


def can_be_torn_by_tiles(
    case: Case, found: NodedCell | CoarseMesh | None, lattice: ReferenceLattice, policy: PartitionPolicy
) -> bool:
    """Return whether nothing needs the whole mesh.

    Such are tips of arcs, bodies cut by the sides, the matrix in fewer pieces than there are tiles, and cuts across
    materials, of cells that are expected to be small enough for these. A user's mesh is whole already.
    """
    whole = case.arcs or case.cell.bodies == "plane" or case.decomposition.subdomains is not None
    if not isinstance(found, NodedCell) or len(found.parts) < 2 or whole:
        return False
    triangles = ElementEstimate.of(case.cell, found.arrangement).triangles
    dofs = round(triangles * lattice.intervals**2)
    return not (policy.across_pieces(dofs, 1) and can_be_cut_across(case))


def tear_by_tiles(
    case: Case, noded: NodedCell | None, lattice: ReferenceLattice, comm: MPI.Intracomm, policy: PartitionPolicy
) -> RankShare:
    """Return this rank's share of the cell whose lines rank 0 holds with nodes.  Collective.

    Raises:
        CaseError, MeshError: on every rank, as `tiled_cell` and `filling.fill`.
    """
    facts = on_root(comm, tiled_cell, case, noded)
    regions: Regions = comm.bcast(None if noded is None else noded.regions)
    torus, tile = _filled(noded, regions, comm)
    load = np.bincount(torus.constituent, minlength=len(regions.phase))
    comm.Allreduce(MPI.IN_PLACE, load)
    wanted = wanted_pieces(case, load, facts.edges, lattice, comm.size, policy)
    longest = comm.allreduce(float(torus.edge_lengths.max(initial=0.0)), MPI.MAX)
    local = agree(comm, _cut, torus, tile, wanted / load, longest)
    subdomain, body, loads = _numbered(torus, tile, local, comm)
    neighbours = comm.gather(agree(comm, _neighbours, torus, subdomain))
    rank = on_root(comm, _assigned, loads, neighbours or [], comm.size)
    table = SubdomainTable(body, rank, facts.nesting, regions.phase)
    shares = agree(comm, _shares, torus, subdomain, table, comm.size, _pinned(torus, comm))
    summary = on_root(comm, summary_of, case, noded, len(body), int(load.sum()))
    return RankShare(summary, table, facts.pairs, joined(alltoall(comm, shares)))


def _filled(noded: NodedCell | None, regions: Regions, comm: MPI.Intracomm) -> tuple[Torus, Int]:
    """Return the torus of the tiles that this rank fills, and the tile (m,) of each triangle. Collective."""
    tiles = on_root_only(comm, tiles_to_fill, noded) or []
    own = deal_tiles(tiles, [len(tile.nodes) for tile in tiles], comm)
    fillings = agree(comm, fill_own, [(k, tile.tile) for k, tile in own])
    inner = dict(chain.from_iterable(comm.allgather([(k, len(filling.inner)) for k, filling in fillings])))
    ends = regions.nodes + np.cumsum([0, *(inner[k] for k in range(len(inner)))])
    filled = [FilledTile(k, tile, filling, int(ends[k])) for (k, tile), (_, filling) in zip(own, fillings, strict=True)]
    return agree(comm, tile_torus, regions, filled, int(ends[-1]))


def _cut(torus: Torus, tile: Int, pieces_per_triangle: Float, longest: float) -> Int:
    """(m,) the subdomain of each triangle of this rank, numbered from 0 tile by tile within a constituent."""
    left, right, _ = torus.sides
    within = (tile[left] == tile[right]) & (torus.constituent[left] == torus.constituent[right])
    label = components(len(tile), left[within], right[within])
    first = np.unique(label, return_index=True)[1]
    order = np.lexsort((first, tile[first], torus.constituent[first]))
    parts = np.argsort(order)[label]
    size = np.bincount(parts)
    pieces = np.round(pieces_per_triangle[torus.constituent[first[order]]] * size).astype(np.int64)
    return cut_into_pieces(torus, parts, np.clip(pieces, 1, size), longest)


def _numbered(torus: Torus, tile: Int, local: Int, comm: MPI.Intracomm) -> tuple[Int, Int, Int]:
    """Return the subdomain (m,) of each triangle of this rank, and body (s,) and triangles (s,) of each. Collective.

    Subdomains are numbered body by body and tile by tile in the whole cell, from those of this rank.
    """
    first = np.unique(local, return_index=True)[1]
    parts = comm.allgather((torus.constituent[first], tile[first], np.bincount(local)))
    body, tiles, load = (np.concatenate(some) for some in zip(*parts, strict=True))
    order = np.lexsort((np.arange(len(body)), tiles, body))
    before = sum(len(own) for own, *_ in parts[: comm.rank])
    return np.argsort(order)[before + local], body[order], load[order]


def _neighbours(torus: Torus, subdomain: Int) -> tuple[Int, Int, Int, Int]:
    """Subdomains (n,) and (n,) that meet here, in a row for each edge.

    And the edges (k,) that have a triangle here and another one elsewhere, with its subdomain (k,).
    """
    left, right, _ = torus.sides
    apart = subdomain[left] != subdomain[right]
    edges = torus.triangle_torus_edges
    alone = (np.bincount(edges.ravel(), minlength=len(torus.edge_keys)) == 1) & ~torus.at_void
    triangle, k = np.nonzero(alone[edges])
    return subdomain[left[apart]], subdomain[right[apart]], torus.edge_keys[edges[triangle, k]], subdomain[triangle]


def _assigned(load: Int, neighbours: list[tuple[Int, Int, Int, Int]], n_ranks: int) -> Int:
    """(s,) rank of each subdomain, for what `_neighbours` found on all ranks."""
    left, right, edge, beside = (np.concatenate(some) for some in zip(*neighbours, strict=True))
    beside = beside[np.argsort(edge, kind="stable")]
    return assign_ranks(load, np.append(left, beside[::2]), np.append(right, beside[1::2]), n_ranks)


def _shares(torus: Torus, subdomain: Int, table: SubdomainTable, n_ranks: int, pinned: int) -> list[SubmeshesOfRank]:
    """Yield the triangles of this rank for each rank."""
    return list(cut_for_ranks(torus, subdomain, table, n_ranks, pinned))


def _pinned(torus: Torus, comm: MPI.Intracomm) -> int:
    """Key of the class of all ranks that is pinned, see `submesh.pinned_class`.  Collective."""
    at_interface, in_matrix = np.zeros((2, len(torus.class_keys)), bool)
    at_interface[torus.node_class[torus.mesh.arc_edges]] = True
    in_matrix[torus.node_class[torus.mesh.triangles[torus.constituent == 0]]] = True
    found = comm.allgather(pinning(torus, np.select([at_interface, in_matrix], [2, 0], 1)))
    best: tuple[int, float, int] = min(chain.from_iterable(found))
    return best[-1]


@dataclass(frozen=True)
class TiledCell:
    """Facts for all ranks.

    Attributes:
        pairs: (phases, phases) as in `cell_remarks.pairs_of`.
        nesting: (constituents,) as in `Torus.nesting`.
        edges: (constituents,) coarse edges that each shares with others.
    """

    pairs: Int
    nesting: Int
    edges: Int


def tiled_cell(case: Case, noded: NodedCell) -> TiledCell:
    """Return the tiled cell without debonded arcs.

    Raises:
        CaseError: an interface of the case is between phases that do not touch.
    """
    regions, around, curves = noded.regions, noded.lines.around, noded.lines.curves
    # The last of `constituent` is the matrix, which is around where `around` is MATRIX, -1.
    inside, outside = regions.constituent[:-1], regions.constituent[around]
    solid = (inside >= 0) & (outside >= 0)
    faults = cell_remarks.faults(case, regions.phases, regions.phase[inside[solid]], regions.phase[outside[solid]])
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
    return TiledCell(cell_remarks.pairs_of(case, regions.phases), nesting, edges)


def tiles_to_fill(noded: NodedCell) -> list[NumberedTile]:
    """Return the tiles of a noded."""
    lines, arrangement = noded.lines, noded.arrangement
    stands_for = representatives(lines.points, arrangement.width, arrangement.height).astype(np.int64)
    return [NumberedTile(nodes, stands_for[nodes], tile) for nodes, tile in noded.parts]


def summary_of(case: Case, noded: NodedCell, subdomains: int, triangles: int) -> CellSummary:
    """Return the summary of the cell, cut into so many subdomains of so many coarse triangles."""
    regions, lines, arrangement = noded.regions, noded.lines, noded.arrangement
    own = regions.constituent[:-1]
    solid = np.flatnonzero(own >= 0)
    circle = solid[np.unique(own[solid], return_index=True)[1]]
    disc = lines.disc[circle]
    is_fibre = arrangement.precedence(disc, lines.is_coating[circle]) == disc + 1
    centres = in_cell(noded.scale * arrangement.centres[disc], np.array([regions.width, regions.height]))
    radii = regions.ellipses.circles[circle, 2]
    ends = noded.scale * lines.points[arc_edges(lines.curves)[0]]
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
        voids=arrangement.voids,
        match_distance=match_distance(case, regions.width, regions.height, centres[is_fibre], radii[is_fibre]),
        remarks=(
            *arrangement.remarks,
            *table_remarks(case),
            *subdomain_remarks(case, len(regions.phase), subdomains, triangles),
        ),
    )
