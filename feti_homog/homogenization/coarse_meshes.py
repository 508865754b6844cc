"""The coarse mesh of a case: begun on rank 0; the tiles of large cells are filled by all ranks."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from operator import itemgetter
from typing import TypeVar

import numpy as np
from mpi4py import MPI

from feti_homog.cell.coarse_mesh import CoarseMesh
from feti_homog.cell.drawing import Drawing
from feti_homog.cell.filling import Filling, Tile, fill
from feti_homog.cell.tiles import TilePolicy
from feti_homog.common.dealing import collect, deal
from feti_homog.common.dividing import balanced
from feti_homog.common.mpi_errors import agree, on_root_only
from feti_homog.config import case as cases
from feti_homog.config.case import Case
from feti_homog.homogenization import tips

T = TypeVar("T")


def begun(case: Case, policy: TilePolicy) -> Drawing | CoarseMesh:
    """A user's mesh, or the cell with its tiles still to be filled.

    Raises:
        CaseError: a phase has no material, or a material no phase.
        MeshError: the cell cannot be drawn, or its mesh file is faulty.
    """
    # gmsh is imported where it is needed.
    found: Drawing | CoarseMesh
    if case.cell.has_own_mesh:
        from feti_homog.cell.msh_reader import read

        assert case.cell.file is not None
        found = read(case.cell.file, case.cell.snap_tolerance if case.cell.repair == "snap" else None)
    else:
        from feti_homog.cell.gmsh_mesher import draw

        found = draw(replace(case.cell, tip_size=tips.size(case)), tips.marks(case), policy)
    cases.check_phases(case, found.phases)
    return found


def finished(found: Drawing | CoarseMesh | None, comm: MPI.Intracomm) -> CoarseMesh | None:
    """The mesh that rank 0 has begun, there; its tiles are filled by all ranks.  Collective.

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
