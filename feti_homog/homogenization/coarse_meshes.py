"""The coarse mesh of a case.

Rank 0 begins it; all ranks make nodes on lines, and the tiles of large cells.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from operator import itemgetter
from typing import TypeVar

import numpy as np
from mpi4py import MPI

from feti_homog.case import case as cases
from feti_homog.case.case import Case
from feti_homog.homogenization import arc_selection
from feti_homog.mesh.arrange import listed_arrangement
from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.fill.gmsh_mesher import NodedCell, UnmeshedCell, begin
from feti_homog.mesh.sizes.element_estimate import ElementEstimate
from feti_homog.mesh.sizes.graded_size import SizeField
from feti_homog.mesh.tiles.filling import Filling, Tile, fill
from feti_homog.mesh.tiles.tiles import TilePolicy
from feti_homog.system.parallel.distributed_arrays import gather, scatter
from feti_homog.system.parallel.dividing import balanced
from feti_homog.system.parallel.mpi_errors import agree, on_root_only

T = TypeVar("T")


def place_nodes(case: Case, comm: MPI.Intracomm, policy: TilePolicy) -> NodedCell | CoarseMesh | None:
    """Return a user's mesh, or the cell with nodes on lines, placed by all ranks, and empty tiles.  Collective.

    None but on rank 0.

    Raises:
        CaseError, MeshError: on every rank, as `begin_mesh`.
    """
    cell = on_root_only(comm, begin_mesh, case, policy)
    unmeshed = cell if isinstance(cell, UnmeshedCell) else None
    if not comm.bcast(unmeshed is not None):
        assert not isinstance(cell, UnmeshedCell)
        return cell
    field: SizeField = comm.bcast(None if unmeshed is None else unmeshed.bare.field)
    lines = scatter(comm, [] if unmeshed is None else unmeshed.bare.lines.parts(comm.size))
    stations = gather(comm, agree(comm, lines.stations, field))

    def with_nodes(unmeshed: UnmeshedCell) -> NodedCell:
        return unmeshed.with_nodes(unmeshed.bare.lines.joined(stations))

    return on_root_only(comm, with_nodes, unmeshed)


def begin_mesh(case: Case, policy: TilePolicy) -> UnmeshedCell | NodedCell | CoarseMesh:
    """Return a user's mesh, or the cell as far as rank 0 makes it alone.

    Raises:
        CaseError: a phase has no material, or a material no phase.
        MeshError: the cell cannot be meshed, or its mesh file is faulty.
    """
    cell: UnmeshedCell | NodedCell | CoarseMesh
    if case.cell.has_own_mesh:
        from feti_homog.mesh.readers.msh_reader import read_cell  # with the readers of all formats

        cell = read_cell(case.cell)
    else:
        listed = listed_arrangement(case.cell)
        estimate = ElementEstimate.of(case.cell, listed)
        section = replace(case.cell, tip_size=arc_selection.size(case, estimate))
        cell = begin(section, listed, arc_selection.marks(case, estimate.fibres), policy)
    cases.check_phases(case, cell.phases)
    return cell


def fill_tiles(cell: NodedCell | CoarseMesh | None, comm: MPI.Intracomm) -> CoarseMesh | None:
    """Return the mesh on rank 0, whose tiles from `place_nodes` all ranks fill.  Collective.

    Raises:
        MeshError: on every rank, if one cannot fill a tile.
    """
    tiles = [] if cell is None or isinstance(cell, CoarseMesh) else [tile for _, tile in cell.parts]
    gathered = gather(comm, agree(comm, fill_own, deal_tiles(tiles, [len(tile.points) for tile in tiles], comm)))
    fillings = [filling for _, filling in sorted(chain.from_iterable(gathered), key=itemgetter(0))]

    def joined(cell: NodedCell | CoarseMesh) -> CoarseMesh:
        return cell if isinstance(cell, CoarseMesh) else cell.mesh(fillings)

    return on_root_only(comm, joined, cell)


def deal_tiles(tiles: list[T], loads: list[int], comm: MPI.Intracomm) -> list[tuple[int, T]]:
    """Deal tiles from rank 0 to all ranks.  Collective.

    The tiles have sizes `loads`; returns the numbers and tiles that this rank fills.
    """
    parts: list[list[tuple[int, T]]] = [[] for _ in range(comm.size)]
    for k, rank in enumerate(balanced(np.array(loads, np.int64), comm.size).tolist()):
        parts[rank].append((k, tiles[k]))
    return scatter(comm, parts)


def fill_own(tiles: list[tuple[int, Tile]]) -> list[tuple[int, Filling]]:
    """Fill numbered tiles.

    Raises:
        MeshError: gmsh cannot fill one.
    """
    return [(k, fill(tile)) for k, tile in tiles]
