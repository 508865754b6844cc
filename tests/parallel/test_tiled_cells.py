"""Cells that all ranks mesh together: the same mesh on any number of ranks, results, faults of one rank."""

from dataclasses import fields
from itertools import islice

import numpy as np
import pytest
from mpi4py import MPI
from support import cases, torn_cells
from support.cases import FIBRE, MATRIX, monolithic_stiffness, relative_error, solve
from support.loads import strains
from support.whole_meshes import coarse_mesh

from feti_homog.errors import MeshError
from feti_homog.homogenization import tile_tearing
from feti_homog.homogenization.domain_partition import distribute
from feti_homog.homogenization.partition_policy import PartitionPolicy
from feti_homog.homogenization.tile_tearing import can_be_torn_by_tiles, tear_by_tiles
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED
from feti_homog.interface.laws.strength import QuadraticStrength
from feti_homog.interface.path.path_following import events
from feti_homog.interface.path.path_points import unloaded
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.mesh.tiles import tile_filling
from feti_homog.mesh.tiles.tiling import TilePolicy

pytestmark = pytest.mark.parallel


SMALL = TilePolicy(least_discs=16, discs=4)
TILED = PartitionPolicy(tiles=SMALL)
ACROSS = PartitionPolicy(tiles=SMALL, across_dofs=10**6, across_piece_dofs=2000, whole_dofs=0)
LATTICE = ReferenceLattice.of(1, 1)
KINDS = {
    "plain": {},
    "coated, voids": {"fibre_fraction": 0.3, "min_gap": 0.15, "coating": 0.1, "voids": 0.04, "void_radius": 0.6},
}


def case_of(cell=(), **sections):
    cell = {"geometry": "random", "fibres": 16, "fibre_fraction": 0.5, "mesh_size": 0.08} | dict(cell)
    coating = {"coating": FIBRE} if "coating" in cell else {}
    return cases.case_of(cell, material={"matrix": MATRIX, "fibre": FIBRE} | coating, **sections)


@pytest.mark.quick
@pytest.mark.parametrize("keys", [{}, {"interface_size": 0.01}], ids=["uniform", "fine interfaces"])
def test_the_mesh_is_that_of_one_rank(comm, keys):
    mesh = coarse_mesh(case_of(keys), comm, SMALL)
    assert (mesh is None) == (comm.rank > 0)
    if mesh is not None:
        alone = coarse_mesh(case_of(keys), MPI.COMM_SELF, SMALL)
        for name in ("points", "triangles", "phase", "representative", "arc_edges"):
            assert np.array_equal(getattr(mesh, name), getattr(alone, name))


def share_of(case, comm):
    """Tear this rank's share of the cell by tiles."""
    noded = tile_tearing.place_nodes(case, comm, SMALL)
    assert noded is None or can_be_torn_by_tiles(case, noded, LATTICE, TILED)
    return tear_by_tiles(case, noded, LATTICE, comm, TILED)


TABLE = {"geometry": "table", "width": 4.0, "height": 4.0, "order": 1, "refine": 0, "fibre_list": [
    {"x": i % 4 + 0.5, "y": i // 4 + 0.5, "radius": 0.25 + 0.1 * (i % 2)} for i in range(16)]}  # fmt: skip


@pytest.mark.few_ranks
@pytest.mark.parametrize("keys", [*KINDS.values(), TABLE], ids=[*KINDS, "linear, table"])
def test_the_summary_is_that_of_the_whole_mesh(comm, keys):
    """But for the number of subdomains: here they end with the tiles.  The table has a remark on lost area."""
    case = cases.case_of({"mesh_size": 0.08} | keys) if keys is TABLE else case_of(keys)
    found = share_of(case, comm)
    assert any("less area" in line for line in found.summary.remarks) == (keys is TABLE)
    (whole,) = distribute(case, coarse_mesh(case, MPI.COMM_SELF, SMALL), LATTICE, 1, TILED)
    for field in fields(found.summary):
        mine, other = (getattr(share.summary, field.name) for share in (found, whole))
        if isinstance(mine, np.ndarray):
            np.testing.assert_allclose(mine, other, rtol=1e-12, atol=1e-12)
        elif isinstance(mine, float):
            assert mine == pytest.approx(other, rel=1e-14), field.name
        elif field.name != "subdomains":
            assert mine == other, field.name
    for name in ("nesting", "phase"):
        assert np.array_equal(getattr(found.table, name), getattr(whole.table, name))
    assert comm.allreduce(len(found.submeshes.member)) == found.summary.coarse_triangles


@pytest.mark.quick
def test_subdomains_are_those_of_one_rank(comm):
    """Each has the same triangles, whoever filled its tile; an entity has the same sharers."""
    case = case_of(KINDS["coated, voids"], decomposition={"max_dofs": 500})
    own, alone = share_of(case, comm), share_of(case, MPI.COMM_SELF)
    assert np.array_equal(own.table.body, alone.table.body) and own.table.rank.max() == comm.size - 1
    expected = {submesh.index: submesh for submesh in alone.submeshes.cut()}
    for submesh in own.submeshes.cut():
        other = expected[submesh.index]
        assert np.array_equal(submesh.points[submesh.triangles], other.points[other.triangles])
        assert np.array_equal(submesh.class_keys, other.class_keys)
        assert len(submesh.pinned) == len(other.pinned)


@pytest.mark.quick
@pytest.mark.parametrize(("keys", "policy"), [(KINDS["plain"], ACROSS), (KINDS["coated, voids"], TILED)], ids=KINDS)
def test_the_stiffness_is_that_of_a_direct_solve_on_the_mesh(comm, keys, policy):
    cell, L, _ = solve(case_of(keys | {"refine": 1}), comm, policy=policy)
    assert cell.summary.across == (policy is ACROSS)
    assert relative_error(L, monolithic_stiffness(cell)) < 1e-9


@pytest.mark.few_ranks
def test_a_path_is_that_of_the_cell_torn_on_rank_0(comm):
    """With the matrix whole, on the same mesh: loads and stresses of the first bonds that break, without contact."""
    found = []
    for pieces in ({}, {"subdomains": 17}):
        cell = {"geometry": "random", "fibres": 16, "fibre_fraction": 0.5, "mesh_size": 0.1, "decomposition": pieces}
        torn = torn_cells.tear(comm, springs=(500.0, 300.0), policy=TILED, **cell)
        assert (torn.summary.subdomains > 17) == (not pieces)
        loaded = CoupledInterfaces(torn_cells.interface(torn, contact=True))
        bonded = np.full(len(torn.solver.jump_operator.nodes.row), BONDED, np.int8)
        law = QuadraticStrength(20.0, 30.0)
        path = events(loaded, law, strains(np.array([[1.0, -0.2, 0.4]])), unloaded(loaded, torn_cells.bonds(bonded)))
        points = list(islice(path, 8))
        found.append([[p.load_factor, *(p.scale * torn_cells.stress(torn, p.state.solution))] for p in points])
    assert len(found[0]) == 8 and np.ptp([load for load, *_ in found[0]]) > 0
    assert relative_error(np.array(found[0]), np.array(found[1])) < 1e-7


def test_what_needs_the_whole_mesh_is_torn_on_rank_0(comm):
    contact = {"debonded": [{"fibre": 1, "centre": 0.0, "angle": 90.0}], "contact": True}
    for more in ({"interface": contact}, {"decomposition": {"subdomains": 17}}, {"cell": {"bodies": "plane"}}):
        case = case_of(**more)
        noded = tile_tearing.place_nodes(case, comm, SMALL)
        assert noded is None or not can_be_torn_by_tiles(case, noded, LATTICE, TILED)
    cell, *_ = solve(case_of(decomposition={"subdomains": 17}), comm, policy=TILED)
    assert cell.summary.subdomains == 17


def test_a_tile_that_one_rank_cannot_fill_ends_the_job_on_all(comm, monkeypatch):
    def broken(tile):
        raise MeshError("[cell] gmsh cannot fill it")

    if comm.rank == comm.size - 1:
        monkeypatch.setattr(tile_filling, "fill", broken)
    for mesh in (share_of, lambda case, comm: coarse_mesh(case, comm, SMALL)):
        with pytest.raises(MeshError, match="gmsh cannot fill it"):
            mesh(case_of(), comm)
