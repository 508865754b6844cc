"""Cells cut on rank 0, or large ones where they are meshed.

For large cells each rank cuts its tiles, and no rank has all tiles.

Matrix pieces lie within tiles, and a fibre lies in one tile, so subdomains depend on the case and the number of
ranks, not on the rank that filled a tile.
"""

from __future__ import annotations

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
from feti_homog.mesh.outline.lines import MATRIX
from feti_homog.mesh.periodic_topology import Torus, components, places_by_depth
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.mesh.sizes.element_estimate import ElementEstimate
from feti_homog.mesh.submesh import SubdomainTable, cut_for_ranks, joined, pinning
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
    case: Case, noded: NodedCell | CoarseMesh | None, lattice: ReferenceLattice, policy: PartitionPolicy
) -> bool:
    """Return whether nothing needs the mesh on one rank.

    One rank is needed for arc tips, bodies cut by the sides, the matrix in fewer pieces than tiles, and cells that
    are expected to be small enough for cuts across materials.  A user's mesh is on one rank already.
    """
    on_one_rank = case.arcs or case.cell.bodies == "plane" or case.decomposition.subdomains is not None
    if not isinstance(noded, NodedCell) or len(noded.parts) < 2 or on_one_rank:
        return False
    triangles = ElementEstimate.of(case.cell, noded.arrangement).triangles
    dofs = round(triangles * lattice.intervals**2)
    return not (policy.across_pieces(dofs, 1) and can_be_cut_across(case))


def tear_by_tiles(
    case: Case, noded: NodedCell | None, lattice: ReferenceLattice, comm: MPI.Intracomm, policy: PartitionPolicy
) -> RankShare:
    """Return this rank's share in the cell with noded lines on rank 0.  Collective.

    Raises:
        CaseError, MeshError: on every rank, as `tiled_cell` and `filling.fill`.
    """
    phase_pairs, nesting, edges = on_root(comm, tiled_cell, case, noded)
    regions: Regions = comm.bcast(None if noded is None else noded.regions)
    torus, tile = _filled(noded, regions, comm)
    load = np.bincount(torus.constituent, minlength=len(regions.phase))
    comm.Allreduce(MPI.IN_PLACE, load)
    pieces = wanted_pieces(case, load, edges, lattice, comm.size, policy)
    longest = comm.allreduce(float(torus.edge_lengths.max(initial=0.0)), MPI.MAX)
    local = agree(comm, _cut, torus, tile, pieces / load, longest)
    subdomain, body, loads = _numbered(torus, tile, local, comm)
    neighbours = comm.gather(agree(comm, _neighbours, torus, subdomain))
    rank = on_root(comm, _assigned, loads, neighbours or [], comm.size)
    table, pinned = SubdomainTable(body, rank, nesting, regions.phase), _pinned(torus, comm)
    shares = agree(comm, lambda: list(cut_for_ranks(torus, subdomain, table, comm.size, pinned)))
    summary = on_root(comm, summary_of, case, noded, len(body), int(load.sum()))
    return RankShare(summary, table, phase_pairs, joined(alltoall(comm, shares)))


def _filled(noded: NodedCell | None, regions: Regions, comm: MPI.Intracomm) -> tuple[Torus, Int]:
    """Return the torus that this rank's tiles fill, and each triangle's tile (m,).  Collective."""
    tiles = on_root_only(comm, tiles_to_fill, noded) or []
    dealt = deal_tiles(tiles, [len(tile.nodes) for tile in tiles], comm)
    fillings = agree(comm, fill_own, [(k, tile.tile) for k, tile in dealt])
    inner = dict(chain.from_iterable(comm.allgather([(k, len(filling.inner)) for k, filling in fillings])))
    ends = regions.nodes + np.cumsum([0, *(inner[k] for k in range(len(inner)))])
    pairs = zip(dealt, fillings, strict=True)
    filled = [FilledTile(k, tile, filling, int(ends[k])) for (k, tile), (_, filling) in pairs]
    return agree(comm, tile_torus, regions, filled, int(ends[-1]))


def _cut(torus: Torus, tile: Int, pieces_per_triangle: Float, longest: float) -> Int:
    """(m,) the subdomain of each triangle on this rank.

    Subdomains are numbered from 0 tile by tile within a constituent.
    """
    a, b, _ = torus.sides
    within = (tile[a] == tile[b]) & (torus.constituent[a] == torus.constituent[b])
    label = components(len(tile), a[within], b[within])
    first = np.unique(label, return_index=True)[1]
    order = np.lexsort((first, tile[first], torus.constituent[first]))
    parts = np.argsort(order)[label]
    size = np.bincount(parts)
    pieces = np.round(pieces_per_triangle[torus.constituent[first[order]]] * size).astype(np.int64)
    return cut_into_pieces(torus, parts, np.clip(pieces, 1, size), longest)


def _numbered(torus: Torus, tile: Int, local: Int, comm: MPI.Intracomm) -> tuple[Int, Int, Int]:
    """Count subdomains by body and tile over all ranks.  Collective.

    Returns the subdomain (m,) of each triangle on this rank, then each subdomain's body (s,) and triangle count (s,).
    """
    first = np.unique(local, return_index=True)[1]
    parts = comm.allgather((torus.constituent[first], tile[first], np.bincount(local)))
    body, tiles, load = (np.concatenate(rows) for rows in zip(*parts, strict=True))
    order = np.lexsort((np.arange(len(body)), tiles, body))
    before = sum(len(bodies) for bodies, *_ in parts[: comm.rank])
    return np.argsort(order)[before + local], body[order], load[order]


def _neighbours(torus: Torus, subdomain: Int) -> tuple[Int, Int, Int, Int]:
    """Return subdomain pairs (n,) and (n,) that meet at this rank's edges.

    Then edges (k,) with one triangle on this rank and the other one elsewhere, and its subdomain here (k,).
    """
    a, b, _ = torus.sides
    apart = subdomain[a] != subdomain[b]
    edges = torus.triangle_torus_edges
    alone = (np.bincount(edges.ravel(), minlength=len(torus.edge_keys)) == 1) & ~torus.at_void
    triangle, k = np.nonzero(alone[edges])
    return subdomain[a[apart]], subdomain[b[apart]], torus.edge_keys[edges[triangle, k]], subdomain[triangle]


def _assigned(load: Int, neighbours: list[tuple[Int, Int, Int, Int]], n_ranks: int) -> Int:
    """(s,) each subdomain's rank, by all ranks' `neighbours`."""
    a, b, edge, side = (np.concatenate(rows) for rows in zip(*neighbours, strict=True))
    side = side[np.argsort(edge, kind="stable")]
    return assign_ranks(load, np.append(a, side[::2]), np.append(b, side[1::2]), n_ranks)


def _pinned(torus: Torus, comm: MPI.Intracomm) -> int:
    """Find the key of the one class on all ranks that is pinned, see `submesh.pinned_class`.  Collective."""
    at_interface, in_matrix = np.zeros((2, len(torus.class_keys)), bool)
    at_interface[torus.node_class[torus.mesh.arc_edges]] = True
    in_matrix[torus.node_class[torus.mesh.triangles[torus.constituent == 0]]] = True
    candidates = comm.allgather(pinning(torus, np.select([at_interface, in_matrix], [2, 0], 1)))
    best: tuple[int, float, int] = min(chain.from_iterable(candidates))
    return best[-1]


def tiled_cell(case: Case, noded: NodedCell) -> tuple[Int, Int, Int]:
    """Return facts about a tiled cell: `cell_remarks.pairs_of`, `Torus.nesting`, shared coarse edges (constituents,).

    Raises:
        CaseError: an interface is between phases that do not touch.
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
    sides = np.stack([regions.constituent[side[arcs]] for side in (curves.inside, curves.outside)])
    shared = (sides >= 0).all(axis=0)
    count = np.diff(curves.first)[arcs] - 1
    edges = np.bincount(sides[:, shared].ravel(), np.tile(count[shared], 2), n).astype(np.int64)
    return cell_remarks.pairs_of(case, regions.phases), nesting, edges


def tiles_to_fill(noded: NodedCell) -> list[NumberedTile]:
    """Return a noded cell's numbered tiles."""
    lines, arrangement = noded.lines, noded.arrangement
    stands_for = representatives(lines.points, arrangement.width, arrangement.height).astype(np.int64)
    return [NumberedTile(nodes, stands_for[nodes], tile) for nodes, tile in noded.parts]


def summary_of(case: Case, noded: NodedCell, subdomains: int, triangles: int) -> CellSummary:
    """Summarize the cell with so many subdomains and coarse triangles."""
    regions, lines, arrangement = noded.regions, noded.lines, noded.arrangement
    inside = regions.constituent[:-1]
    solid = np.flatnonzero(inside >= 0)
    circle = solid[np.unique(inside[solid], return_index=True)[1]]
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
