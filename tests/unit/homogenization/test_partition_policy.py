"""Cells that are cut across materials, and their numbers of pieces."""

import pytest
from mpi4py import MPI
from support.cases import make_case
from support.whole_meshes import coarse_mesh

from feti_homog.homogenization.domain_partition import distribute
from feti_homog.homogenization.partition_policy import BY_COST, DEFAULT_POLICY, can_be_cut_across
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.system.petsc.options_database import case_options


@pytest.mark.parametrize(
    ("change", "may"),
    [
        ({}, True),
        ({"output": {"fields": True, "sensitivities": True}}, True),
        ({"decomposition": {"cut": "bodies"}}, False),
        ({"decomposition": {"subdomains": 9}}, False),
        ({"decomposition": {"max_dofs": 900}}, False),
        ({"bodies": "plane"}, False),
        ({"petsc": {"feti_ksp_rtol": 1e-9}}, True),
        ({"petsc": {"feti_pc_type": "lumped"}}, False),
        ({"fibre": {"young": 2e3, "poisson": 0.3}, "matrix": {"young": 1.0, "poisson": 0.3}}, False),
        ({"fibre": {"young": 9e2, "poisson": 0.3}, "matrix": {"young": 1.0, "poisson": 0.3}}, True),
        ({"order": 2, "matrix": {"young": 1.0, "poisson": 0.49}}, False),
    ],
)
def test_only_cells_in_which_nothing_is_asked_of_bodies_are_cut_across_materials(change, may):
    assert can_be_cut_across(make_case(**change)) == may


def test_options_of_the_command_line_count_like_those_of_the_case():
    with case_options({"feti_ksp_type": "fcg"}):
        assert not can_be_cut_across(make_case())
    assert can_be_cut_across(make_case())


def test_cells_of_fewer_pieces_than_ranks_are_cut_by_bodies():
    case = make_case(geometry="square", mesh_size=0.5)
    mesh = coarse_mesh(case, MPI.COMM_SELF)
    ranks = len(mesh.triangles) + 9
    share, *_ = distribute(case, mesh, ReferenceLattice.of(0, 1), ranks, BY_COST)
    # METIS leaves some pieces empty, and nearly all if more are asked for than there are triangles.
    assert not share.summary.across and share.summary.subdomains > len(mesh.triangles) // 5


@pytest.mark.parametrize(
    ("dofs", "ranks", "pieces"),
    [(60_000, 4, 8), (12_000, 2, 2), (12_000, 4, 4), (210_000, 1, 1), (210_000, 2, 2), (500_000, 1, 0)],
)
def test_pieces_are_of_the_fastest_size(dofs, ranks, pieces):
    assert BY_COST.across_pieces(dofs, ranks) == pieces
    assert DEFAULT_POLICY.across_pieces(dofs, ranks) == DEFAULT_POLICY.across_pieces(dofs, ranks, True) == 0


def test_label_images_of_any_size_are_cut_across_materials():
    assert BY_COST.across_pieces(7_000_000, 2, True) == 1000
    assert BY_COST.across_pieces(300_000, 2, True) == BY_COST.across_pieces(300_000, 2) == 2
