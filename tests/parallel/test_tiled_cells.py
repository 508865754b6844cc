"""Cells that all ranks mesh together: the same mesh on any number of ranks, results, faults of one rank."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from support.cases import FIBRE, MATRIX, monolithic_stiffness, relative_error, solve

from feti_homog.cell.tiles import TilePolicy
from feti_homog.config import case as cases
from feti_homog.errors import MeshError
from feti_homog.homogenization import coarse_meshes
from feti_homog.homogenization.coarse_meshes import coarse_mesh, dealt
from feti_homog.homogenization.domain_partition import PartitionPolicy

pytestmark = pytest.mark.parallel


SMALL = TilePolicy(least_discs=16, discs=4)
TILED = PartitionPolicy(tiles=SMALL)


def case_of(**keys):
    document = {
        "cell": {"geometry": "random", "fibres": 16, "fibre_fraction": 0.5, "mesh_size": 0.08, **keys},
        "material": {"matrix": MATRIX, "fibre": FIBRE},
        "analysis": {"type": "stiffness", "plane": "strain"},
        "petsc": {"feti_ksp_rtol": 1e-11},
        "output": {"pictures": False},
    }
    return cases.parse(document, Path())


@pytest.mark.quick
def test_the_mesh_is_that_of_one_rank(comm):
    mesh = coarse_mesh(case_of(), comm, SMALL)
    assert (mesh is None) == (comm.rank > 0)
    if mesh is not None:
        alone = coarse_mesh(case_of(), MPI.COMM_SELF, SMALL)
        for name in ("points", "triangles", "phase", "representative", "arc_edges"):
            assert np.array_equal(getattr(mesh, name), getattr(alone, name))


@pytest.mark.quick
def test_the_stiffness_is_that_of_a_direct_solve_on_the_mesh(comm):
    cell, L, _ = solve(case_of(refine=1), comm, policy=TILED)
    assert relative_error(L, monolithic_stiffness(cell)) < 1e-9


def test_the_stiffness_is_that_of_the_cell_meshed_at_once(comm):
    """To the difference between two refinements of it."""
    _, tiled, _ = solve(case_of(refine=1), comm, policy=TILED)
    coarse, fine = (solve(case_of(refine=k), comm)[1] for k in (1, 2))
    assert 0 < relative_error(tiled, coarse) < relative_error(coarse, fine)


def test_a_tile_that_one_rank_cannot_fill_ends_the_job_on_all(comm, monkeypatch):
    def broken(tile):
        raise MeshError("[cell] gmsh cannot fill it")

    if comm.rank == comm.size - 1:
        monkeypatch.setattr(coarse_meshes, "fill", broken)
    with pytest.raises(MeshError, match="gmsh cannot fill it"):
        coarse_mesh(case_of(), comm, SMALL)


def test_tiles_are_dealt_evenly():
    loads = np.random.default_rng(0).integers(50, 100, 40).tolist()
    ranks = dealt(loads, 3)
    assert sorted(k for own in ranks for k in own) == list(range(40))
    sums = [sum(loads[k] for k in own) for own in ranks]
    assert max(sums) - min(sums) <= max(loads)
    assert dealt([], 2) == [[], []]
