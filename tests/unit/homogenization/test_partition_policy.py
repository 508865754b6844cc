"""Cells that are cut across materials, their numbers of pieces, and estimated memory and ranks."""

from dataclasses import replace

import pytest
from mpi4py import MPI
from support.cases import FIBRE, MATRIX, make_case
from support.whole_meshes import coarse_mesh

from feti_homog.case.interface_section import Arc, InterfaceSection
from feti_homog.case.load_sections import Angle
from feti_homog.homogenization import partition_policy
from feti_homog.homogenization.domain_partition import distribute
from feti_homog.homogenization.partition_policy import BY_COST, DEFAULT_POLICY, can_be_cut_across
from feti_homog.homogenization.phase_laws import problems
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
    assert BY_COST.across_pieces(dofs, 9, ranks) == pieces
    assert DEFAULT_POLICY.across_pieces(dofs, 9, ranks) == DEFAULT_POLICY.across_pieces(dofs, 9, ranks, True) == 0


def test_label_images_of_any_size_are_cut_across_materials():
    assert BY_COST.across_pieces(7_000_000, 9, 2, True) == 1000
    assert BY_COST.across_pieces(300_000, 9, 2, True) == BY_COST.across_pieces(300_000, 9, 2) == 2


@pytest.mark.parametrize(("bodies", "pieces"), [(1600, 0), (1700, 86)])
def test_cells_of_small_bodies_are_cut_across_materials_up_to_a_larger_size(bodies, pieces):
    """Up to 400 000 * 550 / 375 and 400 000 * 550 / 353 with 375 and 353 degrees of freedom a body."""
    assert BY_COST.across_pieces(600_000, bodies, 2) == pieces


def memory(case=None, dofs=(100_000,), subdomains=(9,), components=(2,), columns=0, triangles=1000):
    nodes = [n // 2 for n in dofs]
    return partition_policy.memory(case or make_case(), nodes, subdomains, components, columns, triangles)


def solves(case, problem):
    return partition_policy.applications(case, problem) / partition_policy.ITERATIONS_OF_A_SOLVE


def test_all_unit_loads_of_both_problems_are_counted():
    strain, space = make_case(), make_case(plane="generalized")
    expanding = [phase | {"expansion": 1e-5} for phase in (MATRIX, FIBRE)]
    heated = make_case(plane="generalized", matrix=expanding[0], fibre=expanding[1])
    counts = [[solves(case, problem) for problem in problems(case)] for case in (strain, space, heated)]
    assert counts == [[3], [4, 2], [5, 2]]
    angles = replace(heated, analysis=replace(heated.analysis, type="angle"), angle=Angle(values=(0.0, 30.0, 60.0)))
    assert [solves(angles, problem) for problem in problems(angles)] == [15, 6]
    # Under plus and minus each load; along the fibres nothing touches.
    arcs = InterfaceSection(debonded=(Arc(fibre="all", angle=60.0),))
    touching = [solves(replace(heated, interfaces=(arcs,)), problem) for problem in problems(heated)]
    assert touching == [2 * 5 * partition_policy.SOLVES_OF_A_CONTACT, 2]


def test_more_unknowns_problems_and_columns_take_more_memory():
    base = memory()
    assert memory(dofs=(200_000,)) > base > memory(dofs=(50_000, 50_000), subdomains=(5, 4))
    assert base < memory(components=(2, 1)) < 2 * base
    assert memory(columns=10_000) - base == pytest.approx(10_000 * partition_policy.COLUMN_BYTES)
    assert memory(triangles=9000) - base == pytest.approx(8000 * partition_policy.DOF_BYTES)
    assert memory(subdomains=(10,)) - base == pytest.approx(partition_policy.SUBDOMAIN_BYTES)
    springs = replace(make_case(), interfaces=(InterfaceSection(normal_stiffness=10.0, tangential_stiffness=10.0),))
    assert memory(springs) - base == pytest.approx(9 * partition_policy.SPRING_BYTES)
    of_a_factor = 100_000 * partition_policy.FACTOR_BYTES - 8 * partition_policy.SUBDOMAIN_BYTES
    assert memory(subdomains=(1,)) - base == pytest.approx(of_a_factor)
    angles = replace(make_case(), analysis=replace(make_case().analysis, type="angle"))
    assert memory(angles) - base == pytest.approx(100_000 * partition_policy.INTERIOR_BYTES)


@pytest.mark.parametrize(
    ("dofs", "bodies", "ranks"), [(1000, 9, 1), (99_999, 9, 1), (400_000, 31, 8), (10_000_000, 31, 31)]
)
def test_suggested_ranks_grow_with_the_size_up_to_the_bodies(dofs, bodies, ranks):
    assert partition_policy.recommended_ranks(dofs, bodies) == ranks


def test_bytes_in_words():
    assert [partition_policy.in_words(size) for size in (2**19, 222 * 2**20, 3e9)] == ["0.5 MiB", "222 MiB", "2.8 GiB"]


# One fibre, 10 fibres of teeth, 20 with released energy, 30 with strengths, 50 with energy, each to complete debonding.
@pytest.mark.parametrize(
    ("multipliers", "few", "measured"),
    [(120, 176, 173e6), (872, 200, 334e6), (1676, 224, 454e6), (2172, 237, 670e6), (4110, 290, 685e6)],
)
def test_memory_of_paths_to_the_end(multipliers, few, measured):
    """The estimate is within a third of the memory of five paths; `few` is the memory (MiB) after few events."""
    found = partition_policy.memory_to_the_end(make_case(), few * 2**20, multipliers, multipliers, 1)
    assert 0.75 < found / measured < 4 / 3


def test_faces_with_friction_take_dense_matrices():
    case = make_case()
    rubbing = replace(case, interfaces=(InterfaceSection(normal_strength=1.0, friction=0.3),))
    smooth, rough = (partition_policy.memory_to_the_end(each, 2e9, 10_000, 10_000, 1) for each in (case, rubbing))
    assert partition_policy.in_words(rough - smooth) == "4.7 GiB"


def test_coatings_take_more_iterations_but_across_materials():
    case = make_case()
    coated = replace(case, materials=case.materials | {"coating": case.materials["matrix"]})
    (problem,) = problems(coated)
    hard, easy = (partition_policy.applications(coated, problem, each) for each in (False, True))
    assert hard == 20 * easy == 20 * partition_policy.applications(case, problem)
