"""The coarse mesh of a case, on rank 0; of large cells all ranks make a part of the triangles."""

from __future__ import annotations

import heapq
from dataclasses import replace
from itertools import chain
from operator import itemgetter

from mpi4py import MPI

from feti_homog.cell.coarse_mesh import CoarseMesh
from feti_homog.cell.drawing import Drawing
from feti_homog.cell.filling import Filling, Tile, fill
from feti_homog.cell.tiles import DEFAULT_TILES, TilePolicy
from feti_homog.common.dealing import collect, deal
from feti_homog.common.mpi_errors import agree, on_root_only
from feti_homog.config import case as cases
from feti_homog.config.case import Case
from feti_homog.homogenization import tips


def coarse_mesh(case: Case, comm: MPI.Intracomm, policy: TilePolicy = DEFAULT_TILES) -> CoarseMesh | None:
    """The coarse mesh of the case, its phases checked against the materials; None but on rank 0.  Collective.

    The ranks fill its tiles together; who fills one does not change the mesh.

    Raises:
        CaseError: on every rank, if a phase has no material, or a material no phase.
        MeshError: on every rank, if the cell cannot be meshed, or its mesh file is faulty.
    """
    begun = on_root_only(comm, _begun, case, policy)
    tiles = [] if begun is None or isinstance(begun, CoarseMesh) else [tile for _, tile in begun.parts]
    return on_root_only(comm, _finished, begun, fill_together(tiles, comm))


def fill_together(tiles: list[Tile], comm: MPI.Intracomm) -> list[Filling]:
    """The filled tiles of rank 0, in their order, there; an empty list on others.  Collective.

    Raises:
        MeshError: on every rank, if one cannot fill a tile of its.
    """
    ranks = dealt([len(tile.points) for tile in tiles], comm.size)
    own = deal(comm, [[(k, tiles[k]) for k in mine] for mine in ranks])
    gathered = collect(comm, agree(comm, _fill, own))
    return [filling for _, filling in sorted(chain.from_iterable(gathered), key=itemgetter(0))]


def _begun(case: Case, policy: TilePolicy) -> Drawing | CoarseMesh:
    """A user's mesh, or the cell with its tiles still to be filled."""
    # gmsh is imported where it is needed.
    begun: Drawing | CoarseMesh
    if case.cell.has_own_mesh:
        from feti_homog.cell.msh_reader import read

        assert case.cell.file is not None
        begun = read(case.cell.file, case.cell.snap_tolerance if case.cell.repair == "snap" else None)
    else:
        from feti_homog.cell.gmsh_mesher import draw

        begun = draw(replace(case.cell, tip_size=tips.size(case)), tips.marks(case), policy)
    cases.check_phases(case, begun.phases)
    return begun


def _finished(begun: Drawing | CoarseMesh, fillings: list[Filling]) -> CoarseMesh:
    """The mesh of these filled tiles, if it is not there already."""
    return begun if isinstance(begun, CoarseMesh) else begun.mesh(fillings)


def dealt(loads: list[int], n_ranks: int) -> list[list[int]]:
    """The numbers of the tiles of each rank: the largest goes first, each to the least loaded rank."""
    ranks: list[list[int]] = [[] for _ in range(n_ranks)]
    heap = [(0, rank) for rank in range(n_ranks)]
    for tile in sorted(range(len(loads)), key=lambda k: -loads[k]):
        total, rank = heap[0]
        ranks[rank].append(tile)
        heapq.heapreplace(heap, (total + loads[tile], rank))
    return ranks


def _fill(tiles: list[tuple[int, Tile]]) -> list[tuple[int, Filling]]:
    """These numbered tiles, filled."""
    return [(number, fill(tile)) for number, tile in tiles]
