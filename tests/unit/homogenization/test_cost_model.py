"""Estimated memory grows with the size of a case, and ranks are recommended that it can use."""

from dataclasses import replace

import pytest
from support.cases import FIBRE, MATRIX, make_case

from feti_homog.case.interface_section import Arc, InterfaceSection
from feti_homog.case.load_sections import Angle
from feti_homog.homogenization import partition_policy
from feti_homog.homogenization.phase_laws import problems


def memory(case=None, dofs=(100_000,), subdomains=(9,), components=(2,), columns=0):
    return partition_policy.memory(case or make_case(), [n // 2 for n in dofs], subdomains, components, columns)


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
    """Within a third of what five paths took; `few` is the estimate for few events in MiB."""
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
