"""Mesh a cell on all ranks, and cut it on rank 0 or by tiles.

Rank 0 begins the coarse mesh; all ranks place nodes on lines, and fill the tiles of large cells.  Each rank cuts its
tiles, and no rank has all tiles.  A piece of the matrix, or a fibre, lies in one tile: subdomains depend on the case
and the rank count, not on the rank that filled a tile.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from mpi4py import MPI

from feti_homog.case import Case, cases
from feti_homog.errors import CaseError
from feti_homog.feti.decomposition import partition
from feti_homog.homogenization import cell_remarks
from feti_homog.homogenization.domain_partition import RankShare, distribute, summary_of
from feti_homog.homogenization.partition_policy import PartitionPolicy, can_be_cut_across, wanted_pieces
from feti_homog.mesh import CoarseMesh, ReferenceLattice, Torus, arrange, periodic_topology, submeshes
from feti_homog.mesh.fill import element_estimate, gmsh_mesher
from feti_homog.mesh.outline import graded_size, lines
from feti_homog.mesh.tiles import tile_filling, tiling
from feti_homog.system.parallel import distributed_arrays, mpi_errors
from feti_homog.typing import Float, Int, Intracomm


def cut(case: Case, lattice: ReferenceLattice, comm: Intracomm, policy: PartitionPolicy) -> RankShare:
    """Mesh and cut the cell, and return this rank's part.  Collective; raises CaseError, MeshError on every rank."""
    noded = place_nodes(case, comm, policy.tiles)
    if mpi_errors.on_root(comm, can_be_torn_by_tiles, case, noded, lattice, policy):
        assert not isinstance(noded, CoarseMesh)
        return tear_by_tiles(case, noded, lattice, comm, policy)
    mesh = fill_tiles(noded, comm)
    shares = mpi_errors.on_root_only(comm, distribute, case, mesh, lattice, comm.size, policy)
    return distributed_arrays.scatter(comm, shares or [])


def place_nodes(case: Case, comm: Intracomm, policy: tiling.TilePolicy) -> gmsh_mesher.NodedCell | CoarseMesh | None:
    """Place nodes on the lines of the cell.  Collective.

    Return the cell with nodes, or a user's mesh, on rank 0; None on others.  Raises like `begin_mesh` on every rank.
    """
    cell = mpi_errors.on_root_only(comm, begin_mesh, case, policy)
    unmeshed = cell if isinstance(cell, gmsh_mesher.UnmeshedCell) else None
    if not comm.bcast(unmeshed is not None):
        assert not isinstance(cell, gmsh_mesher.UnmeshedCell)
        return cell
    field: graded_size.SizeField = comm.bcast(None if unmeshed is None else unmeshed.bare.field)
    lines = distributed_arrays.scatter(comm, [] if unmeshed is None else unmeshed.bare.lines.parts(comm.size))
    stations = distributed_arrays.gather(comm, mpi_errors.agree(comm, lines.stations, field))
    return mpi_errors.on_root_only(comm, lambda cell: cell.with_nodes(cell.bare.lines.joined(stations)), unmeshed)


def begin_mesh(case: Case, policy: tiling.TilePolicy) -> gmsh_mesher.UnmeshedCell | CoarseMesh:
    """Read a user's mesh, or begin the mesh of the cell.

    Raises:
        CaseError: a phase has no material, or a material has no phase.
        MeshError: the cell cannot be meshed, or its mesh file is faulty.
    """
    cell: gmsh_mesher.UnmeshedCell | CoarseMesh
    if case.cell.has_own_mesh:
        from feti_homog.mesh.fill import pixel_mesher  # imports the readers of all formats

        cell = pixel_mesher.read_cell(case.cell, tuple(case.materials))
    else:
        listed = None if case.cell.table is None else arrange.arrange(case.cell)
        estimate = element_estimate.ElementEstimate.of(case.cell, listed)
        section, marks = case.cell, dict[int, list[float]]()
        if case.arcs:
            from feti_homog.homogenization import arc_selection  # other cells have no tips

            section = replace(section, tip_size=arc_selection.size(case, estimate))
            marks = arc_selection.marks(case, estimate.fibres)
        cell = gmsh_mesher.begin(section, listed, marks, policy)
    cases.check_phases(case, cell.phases)
    return cell


def fill_tiles(cell: gmsh_mesher.NodedCell | CoarseMesh | None, comm: Intracomm) -> CoarseMesh | None:
    """Fill the tiles on all ranks, and return the joined mesh on rank 0, None on other ranks.  Collective.

    Raises MeshError on every rank if a rank cannot fill a tile.
    """
    filled = filled_tiles(cell.parts if isinstance(cell, gmsh_mesher.NodedCell) else (), comm)
    gathered = distributed_arrays.gather(comm, [(k, filling) for k, _, filling in filled])
    fillings = [filling for _, filling in sorted(chain.from_iterable(gathered), key=lambda part: part[0])]
    return mpi_errors.on_root_only(
        comm, lambda: cell.mesh(fillings) if isinstance(cell, gmsh_mesher.NodedCell) else cell
    )


def filled_tiles(
    tiles: Sequence[tile_filling.Tile], comm: Intracomm
) -> list[tuple[int, tile_filling.Tile, tile_filling.Filling]]:
    """Deal the `tiles` of rank 0 to all ranks, and fill them.  Collective.

    Return (number, tile, filling) of this rank's tiles.  Raises MeshError on every rank if gmsh cannot fill a tile.
    """
    parts: list[list[tuple[int, tile_filling.Tile]]] = [[] for _ in range(comm.size)]
    loads = np.array([len(tile.points) for tile in tiles], np.int64)
    for k, rank in enumerate(distributed_arrays.balanced(loads, comm.size).tolist()):
        parts[rank].append((k, tiles[k]))
    dealt = distributed_arrays.scatter(comm, parts)
    return mpi_errors.agree(comm, lambda: [(k, tile, tile_filling.fill(tile)) for k, tile in dealt])


def can_be_torn_by_tiles(
    case: Case, noded: gmsh_mesher.NodedCell | CoarseMesh | None, lattice: ReferenceLattice, policy: PartitionPolicy
) -> bool:
    """Return whether the ranks can cut the cell without the whole mesh.

    The whole mesh on one rank is needed for arc tips, bodies cut by the sides, a given subdomain count (it may be below
    the tile count), cells probably small enough for cuts across materials, user's meshes and single tiles.
    """
    on_one_rank = case.arcs or case.cell.bodies == "plane" or case.decomposition.subdomains is not None
    if not isinstance(noded, gmsh_mesher.NodedCell) or len(noded.parts) < 2 or on_one_rank:
        return False
    dofs = round(element_estimate.ElementEstimate.of(case.cell, noded.arrangement).triangles * lattice.intervals**2)
    return not (policy.across_pieces(dofs, len(noded.regions.phase), 1) and can_be_cut_across(case))


def tear_by_tiles(
    case: Case, noded: gmsh_mesher.NodedCell | None, lattice: ReferenceLattice, comm: Intracomm, policy: PartitionPolicy
) -> RankShare:
    """Tear a tiled cell, each rank its own tiles, and return this rank's part.  Collective.

    Raises CaseError and MeshError on every rank, as in `tiled_cell` and `tile_filling.fill`.
    """
    nesting, edges = mpi_errors.on_root(comm, tiled_cell, case, noded)
    regions: tiling.Regions = comm.bcast(None if noded is None else noded.regions)
    of_rank = filled_tiles(() if noded is None else noded.parts, comm)
    inner = dict(chain.from_iterable(comm.allgather([(k, len(filling.inner)) for k, _, filling in of_rank])))
    ends = regions.nodes + np.cumsum([0, *(inner[k] for k in range(len(inner)))])
    filled = [tiling.FilledTile(k, tile, filling, int(ends[k])) for k, tile, filling in of_rank]
    torus, tile = mpi_errors.agree(comm, tiling.tile_torus, regions, filled, int(ends[-1]))
    load = np.bincount(torus.constituent, minlength=len(regions.phase))
    comm.Allreduce(MPI.IN_PLACE, load)
    pieces = wanted_pieces(case, load, edges, lattice, comm.size, policy)
    longest = comm.allreduce(float(torus.edge_lengths.max(initial=0.0)), MPI.MAX)
    local = mpi_errors.agree(comm, _cut, torus, tile, pieces / load, longest)
    # Subdomains are numbered by body, then by tile, over all ranks.
    first = np.unique(local, return_index=True)[1]
    parts = comm.allgather((torus.constituent[first], tile[first], np.bincount(local)))
    body, tiles, loads = (np.concatenate(rows) for rows in zip(*parts, strict=True))
    order = np.lexsort((np.arange(len(body)), tiles, body))
    before = sum(len(bodies) for bodies, *_ in parts[: comm.rank])
    subdomain = np.argsort(order)[before + local]
    body, loads = body[order], loads[order]
    neighbours = comm.gather(mpi_errors.agree(comm, _neighbours, torus, subdomain))
    rank = mpi_errors.on_root(comm, _assigned, loads, neighbours or [], comm.size)
    table = submeshes.SubdomainTable(body, rank, nesting, regions.phase)
    # All ranks together pin one class, see `submeshes.pinned_classes`.
    at_interface, in_matrix = np.zeros((2, len(torus.class_keys)), bool)
    at_interface[torus.node_class[torus.mesh.arc_edges]] = True
    in_matrix[torus.node_class[torus.mesh.triangles[torus.constituent == 0]]] = True
    candidates = comm.allgather(submeshes.pinning(torus, np.select([at_interface, in_matrix], [2, 0], 1)))
    _, _, key = min(chain.from_iterable(candidates))
    pinned = np.array([key])
    shares = mpi_errors.agree(comm, lambda: list(submeshes.cut_for_ranks(torus, subdomain, table, comm.size, pinned)))
    summary = mpi_errors.on_root(comm, summary_of, case, noded, len(body), int(load.sum()))
    return RankShare(summary, table, submeshes.joined(distributed_arrays.alltoall(comm, shares)))


def _cut(torus: Torus, tile: Int, pieces_per_triangle: Float, longest: float) -> Int:
    """Cut this rank's triangles (m,) into subdomains (m,), numbered by constituent, then by tile.

    `tile` is (m,), `pieces_per_triangle` (constituents,); `longest` is the longest edge in the cell.
    """
    a, b, _ = torus.sides
    within = (tile[a] == tile[b]) & (torus.constituent[a] == torus.constituent[b])
    label = periodic_topology.components(len(tile), a[within], b[within])
    first = np.unique(label, return_index=True)[1]
    order = np.lexsort((first, tile[first], torus.constituent[first]))
    parts = np.argsort(order)[label]
    size = np.bincount(parts)
    pieces = np.round(pieces_per_triangle[torus.constituent[first[order]]] * size).astype(np.int64)
    return partition.cut_into_pieces(torus, parts, np.clip(pieces, 1, size), longest)


def _neighbours(torus: Torus, subdomain: Int) -> tuple[Int, Int, Int, Int]:
    """Find the subdomain neighbours at this rank's edges.

    Return both subdomains (n,) and (n,) at each edge between subdomains of this rank, the keys (k,) of edges with a
    single triangle on this rank, except at voids, and the subdomain (k,) of this triangle.
    """
    a, b, _ = torus.sides
    differs = subdomain[a] != subdomain[b]
    edges = torus.triangle_torus_edges
    alone = (np.bincount(edges.ravel(), minlength=len(torus.edge_keys)) == 1) & ~torus.at_void
    triangle, k = np.nonzero(alone[edges])
    return subdomain[a[differs]], subdomain[b[differs]], torus.edge_keys[edges[triangle, k]], subdomain[triangle]


def _assigned(load: Int, neighbours: list[tuple[Int, Int, Int, Int]], n_ranks: int) -> Int:
    """Return a rank for each subdomain (s,), from the `load` (s,) and the result of `_neighbours` on all ranks."""
    a, b, edge, side = (np.concatenate(rows) for rows in zip(*neighbours, strict=True))
    side = side[np.argsort(edge, kind="stable")]
    return partition.assign_ranks(load, np.append(a, side[::2]), np.append(b, side[1::2]), n_ranks)


def tiled_cell(case: Case, noded: gmsh_mesher.NodedCell) -> tuple[Int, Int]:
    """Return the nesting and edge counts of a tiled cell.

    Returns:
        Nesting (constituents,) as `Torus.nesting`, and the number (constituents,) of coarse edges between each
        constituent and others.

    Raises:
        CaseError: an interface is between phases that do not touch, or that the cell lacks.
    """
    regions, around, curves = noded.regions, noded.lines.around, noded.lines.curves
    # The last entry of `constituent` is the matrix, to which MATRIX = -1 in `around` leads.
    inside, outside = regions.constituent[:-1], regions.constituent[around]
    solid = (inside >= 0) & (outside >= 0)
    faults = cell_remarks.faults(case, regions.phases, regions.phase[inside[solid]], regions.phase[outside[solid]])
    if faults:
        raise CaseError(*faults)
    n = len(regions.phase)
    depth = np.zeros(n, np.int64)
    depth[inside[inside >= 0]] = np.where(around == lines.MATRIX, 1, 2)[inside >= 0]
    nesting = periodic_topology.places_by_depth(depth, regions.phase, regions.phases)
    arcs = np.flatnonzero(curves.circle != lines.MATRIX)
    sides = np.stack([regions.constituent[side[arcs]] for side in (curves.inside, curves.outside)])
    shared = (sides >= 0).all(axis=0)
    count = np.diff(curves.first)[arcs] - 1
    return nesting, np.bincount(sides[:, shared].ravel(), np.tile(count[shared], 2), n).astype(np.int64)
