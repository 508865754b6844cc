"""The coarse mesh of a case: begun on rank 0; nodes on lines, and the tiles of large cells, are made by all ranks."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from operator import itemgetter
from typing import TypeVar

import numpy as np
from mpi4py import MPI

from feti_homog.case import case as cases
from feti_homog.case.case import Case
from feti_homog.homogenization import tips
from feti_homog.mesh.coarse_mesh import CoarseMesh
from feti_homog.mesh.fill.drawing import Drawing, Sketch
from feti_homog.mesh.outline.bare_outline import LineStations
from feti_homog.mesh.sizes.graded_size import SizeField
from feti_homog.mesh.tiles.filling import Filling, Tile, fill
from feti_homog.mesh.tiles.tiles import TilePolicy
from feti_homog.parallel.dealing import collect, deal
from feti_homog.parallel.dividing import balanced
from feti_homog.parallel.mpi_errors import agree, on_root_only

T = TypeVar("T")


def drawn(case: Case, comm: MPI.Intracomm, policy: TilePolicy) -> Drawing | CoarseMesh | None:
    """On rank 0 a user's mesh, or the cell with its tiles still to be filled; the nodes on its lines are placed by all
    ranks.  Collective.

    Raises:
        CaseError, MeshError: on every rank, as `begun`.
    """
    found = on_root_only(comm, begun, case, policy)
    sketch = found if isinstance(found, Sketch) else None
    if not comm.bcast(sketch is not None):
        assert not isinstance(found, Sketch)
        return found
    field: SizeField = comm.bcast(None if sketch is None else sketch.bare.field)
    own = deal(comm, [] if sketch is None else sketch.bare.lines.parts(comm.size))
    stations = collect(comm, agree(comm, own.stations, field))
    return on_root_only(comm, _with_nodes, sketch, stations)


def _with_nodes(sketch: Sketch, stations: list[LineStations]) -> Drawing:
    """With the nodes that ranks have placed."""
    return sketch.drawn(LineStations.joined(stations, sketch.bare.lines.sampling))


def begun(case: Case, policy: TilePolicy) -> Sketch | Drawing | CoarseMesh:
    """A user's mesh, or the cell as far as rank 0 draws it alone.

    Raises:
        CaseError: a phase has no material, or a material no phase.
        MeshError: the cell cannot be drawn, or its mesh file is faulty.
    """
    # gmsh is imported where it is needed.
    found: Sketch | Drawing | CoarseMesh
    if case.cell.has_own_mesh:
        from feti_homog.mesh.readers.msh_reader import read

        assert case.cell.file is not None
        found = read(case.cell.file, case.cell.snap_tolerance if case.cell.repair == "snap" else None)
    else:
        from feti_homog.mesh.fill.gmsh_mesher import begin

        found = begin(replace(case.cell, tip_size=tips.size(case)), tips.marks(case), policy)
    cases.check_phases(case, found.phases)
    return found


def finished(found: Drawing | CoarseMesh | None, comm: MPI.Intracomm) -> CoarseMesh | None:
    """The mesh that rank 0 has `drawn`, there; its tiles are filled by all ranks.  Collective.

    Raises:
        MeshError: on every rank, if one cannot fill a tile of its.
    """
    tiles = [] if found is None or isinstance(found, CoarseMesh) else [tile for _, tile in found.parts]
    gathered = collect(comm, agree(comm, fill_own, deal_tiles(tiles, [len(tile.points) for tile in tiles], comm)))
    fillings = [filling for _, filling in sorted(chain.from_iterable(gathered), key=itemgetter(0))]
    return on_root_only(comm, _joined, found, fillings)


def deal_tiles(tiles: list[T], loads: list[int], comm: MPI.Intracomm) -> list[tuple[int, T]]:
    """Those of the tiles of rank 0 that this rank fills, with their numbers; `loads` says how large they are.
    Collective."""
    parts: list[list[tuple[int, T]]] = [[] for _ in range(comm.size)]
    for k, rank in enumerate(balanced(np.array(loads, np.int64), comm.size).tolist()):
        parts[rank].append((k, tiles[k]))
    return deal(comm, parts)


def fill_own(tiles: list[tuple[int, Tile]]) -> list[tuple[int, Filling]]:
    """Fill them; each keeps its number.

    Raises:
        MeshError: gmsh cannot fill one.
    """
    return [(k, fill(tile)) for k, tile in tiles]


def _joined(found: Drawing | CoarseMesh, fillings: list[Filling]) -> CoarseMesh:
    """The mesh of these filled tiles, if it is not there already."""
    return found if isinstance(found, CoarseMesh) else found.mesh(fillings)
