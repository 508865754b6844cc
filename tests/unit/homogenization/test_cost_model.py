"""The estimates of `check` grow with what a case has to do, and name ranks that it can use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.cases import FIBRE, MATRIX, make_case

from feti_homog.case.case import Case
from feti_homog.case.interface_section import Arc, InterfaceSection
from feti_homog.case.loads import Angle, LoadPath
from feti_homog.homogenization import cost_model
from feti_homog.homogenization.bonds import teeth_of
from feti_homog.homogenization.phase_laws import problems
from feti_homog.results.checkpoint import bytes_at_most
from feti_homog.results.field_layout import SpatialStatePart, StatePart, rows_of, tables


def estimate(dofs=(100_000,), subdomains=(9,), bodies=9, applications=36, columns=0):
    return cost_model.estimate([n // 2 for n in dofs], subdomains, 10_000, bodies, {2: applications}, columns)


def solves(case, problem):
    return cost_model.applications(case, problem) / cost_model.ITERATIONS_OF_A_SOLVE


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
    assert touching == [2 * 5 * cost_model.SOLVES_OF_A_CONTACT, 2]


def test_a_problem_more_takes_more():
    one, both = (cost_model.estimate([50_000], [9], 10_000, 99, counts, 0) for counts in ({2: 60}, {2: 60, 1: 40}))
    assert one.seconds < both.seconds < 2 * one.seconds and one.memory < both.memory and one.ranks < both.ranks


def test_estimates_of_the_mesh_error_are_counted_where_they_are_made():
    counts = [50_000], [9], 10_000, 99, {2: 60, 1: 40}, 0
    without, with_errors = (cost_model.estimate(*counts, asked) for asked in (False, True))
    assert with_errors.seconds - without.seconds == pytest.approx(3 * 50_000 * cost_model.ERROR_SECONDS)
    case = make_case()
    path = replace(case, analysis=replace(case.analysis, type="path"), path=LoadPath(to={"E11": 1.0}))
    for each, fields, asked in ((case, False, True), (path, True, True), (path, False, False)):
        assert cost_model.has_errors(replace(each, output=replace(each.output, fields=fields))) is asked
    assert not cost_model.has_errors(replace(case, output=replace(case.output, mesh_error=False)))


def test_more_work_takes_more_time_and_memory():
    base = estimate()
    assert estimate(applications=72).seconds > base.seconds and estimate(dofs=(200_000,)).memory > base.memory
    assert estimate(columns=10_000).memory - base.memory == pytest.approx(10_000 * cost_model.COLUMN_BYTES)
    factor = estimate(subdomains=(1,)).memory - base.memory
    assert factor == pytest.approx(100_000 * cost_model.FACTOR_BYTES)
    halves = estimate(dofs=(50_000, 50_000), subdomains=(5, 4))
    assert halves.seconds < base.seconds and halves.memory < base.memory and halves.ranks == base.ranks


@pytest.mark.parametrize(("dofs", "bodies", "ranks"), [(1000, 9, 1), (400_000, 31, 8), (10_000_000, 31, 31)])
def test_suggested_ranks_grow_with_the_size_up_to_the_bodies(dofs, bodies, ranks):
    assert estimate(dofs=(dofs,), bodies=bodies).ranks == ranks


def test_words_tell_time_memory_and_better_ranks():
    first, second = cost_model.estimate_lines(cost_model.Estimate(400.0, 3e9, 8), 2)
    assert "on 2 ranks about 7 min, 2.8 GiB" in first and "recommended: 8 (" in second
    *_, across = cost_model.estimate_lines(cost_model.Estimate(400.0, 3e9, 8), 2, across=True)
    assert "one per body" in second and "body" not in across


@pytest.mark.parametrize("plane", ["strain", "generalized"])
def test_the_size_of_result_h5_is_that_of_its_tables(plane):
    kind = SpatialStatePart if plane == "generalized" else StatePart
    per_row = dict.fromkeys("nmk", 0)
    for table in tables(kind).values():
        columns = int(table.shape.strip("()").split(",")[1] or 1)
        per_row[rows_of(table)] += columns * np.dtype(table.dtype).itemsize
    own = cost_model.STATE_BYTES + (plane == "generalized") * cost_model.AXIAL_BYTES
    assert own.tolist() == list(per_row.values())


def test_kept_states_are_reported():
    case = make_case(plane="generalized")
    assert "6 states of 6.1 MiB, 41 MiB in" in cost_model.fields_line(case, 50_000, 100_000, 0, 1)
    mesh = replace(case, cell=replace(case.cell, geometry="mesh", file="m.msh"), interfaces=(InterfaceSection(),))
    assert "at most 12 states of" in cost_model.fields_line(mesh, 50_000, 100_000, 3000, 1)
    path = replace(case, analysis=replace(case.analysis, type="path"), path=LoadPath(to={"E11": 1.0}))
    assert "at most 20 states of 6.5 MiB, 136 MiB in" in cost_model.fields_line(path, 50_000, 100_000, 3000, 1)
    every = replace(path, output=replace(path.output, states="all"))
    assert "for each state" in cost_model.fields_line(every, 50_000, 100_000, 3000, 1)


def test_paths_name_their_bonds_and_teeth():
    """A bond parts in as many events as its law has teeth; other analyses have none."""
    law = {"law": "bilinear", "normal_stiffness": 1e3, "tangential_stiffness": 1e3, "normal_strength": 1.0,
           "tangential_strength": 1.0, "normal_toughness": 1.0, "tangential_toughness": 1.0, "teeth": 7}  # fmt: skip
    material = {"matrix": MATRIX, "fibre": FIBRE}
    document = {"cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.1}, "material": material,
                "analysis": {"type": "path", "plane": "strain"}, "path": {"strain": [0.01, 0, 0]}}  # fmt: skip
    toothed, brittle = (Case.parse(document | {"interface": own}) for own in (law, {"normal_strength": 1.0}))
    lines = [cost_model.events_lines(own, 48, 1, teeth_of(own), (1000, 1000), 2.0, 2e9) for own in (toothed, brittle)]
    assert (
        "up to about 24 bonds break in 7 teeth each, 3.6 ms or more for each: from 2 s for few to 2.6 s" in lines[0][0]
    )
    assert "up to about 24 bonds break, 3.6 ms or more for each: from 2 s for few to 2.1 s or more" in lines[1][0]
    assert "to 110 s or more" in cost_model.events_lines(toothed, 48, 1, 640, (1000, 1000), 55.0, 2e9)[0]
    assert all(own[0].endswith(" and 1.9 GiB on the largest rank for all") for own in lines)
    for without in (make_case(), Case.parse(document)):
        assert cost_model.events_lines(without, 48, 1, 1, (1000,), 2.0, 2e9) == []
    rubbing = Case.parse(document | {"interface": {"normal_strength": 1.0, "friction": 0.3}})
    assert cost_model.events_lines(rubbing, 10_000, 1, 1, (1000,), 2.0, 2e9)[1:] == [
        "friction   up to 4.5 GiB more on the first rank if all bonds break"
    ]
    for keys, left in (({"normal_strength": 1.0}, "up to about 12 bonds break"), ({}, "no bond is left to break")):
        parted = keys | {"debonded": [{"fibre": 1, "angle": 180.0}]}
        assert (
            left
            in cost_model.events_lines(Case.parse(document | {"interface": parted}), 48, 1, 1, (1000,), 2.0, 2e9)[0]
        )


# One fibre, 10 fibres of teeth, 20 with released energy, 30 with strengths, 50 with energy, each to complete debonding.
@pytest.mark.parametrize(
    ("multipliers", "few", "measured"),
    [(120, 176, 173e6), (872, 200, 334e6), (1676, 224, 454e6), (2172, 237, 670e6), (4110, 290, 685e6)],
)
def test_memory_of_paths_to_the_end(multipliers, few, measured):
    """Within a third of what five paths took; `few` is the estimate for few events in MiB."""
    found = cost_model.memory_to_the_end(cost_model.Estimate(1.0, few * 2**20, 1), multipliers, 1)
    assert 0.75 < found / measured < 4 / 3


# Two fibres in plane stress and in generalized plane strain, and one with friction.
@pytest.mark.parametrize(
    ("plane", "friction", "multipliers", "measured"),
    [("stress", 0.0, 222, 4_028), ("generalized", 0.0, 114, 3_115), ("strain", 0.3, 164, 3_515)],
)
def test_size_of_an_event(plane, friction, multipliers, measured):
    """The estimate is at most a tenth above the bytes of the largest event of three paths."""
    bonds = InterfaceSection(normal_strength=4.0, friction=friction)
    case = replace(make_case(plane=plane), interfaces=(bonds,))
    assert case.has_friction == (friction > 0.0)
    assert 1.0 <= bytes_at_most(case, multipliers, 1) / measured < 1.1


def test_coatings_with_influence_columns_take_columns_in_place_of_iterations():
    """Measured: 1.95 and 3.94 s, where 400 iterations of a solve would take 3.4 and 11 s."""
    case = make_case()
    coated = replace(case, materials=case.materials | {"coating": case.materials["matrix"]})
    (problem,) = problems(coated)
    hard, easy = (cost_model.applications(coated, problem, each) for each in (False, True))
    assert hard == 20 * easy == 20 * cost_model.applications(case, problem)
    taken = [
        cost_model.estimate([dofs // 2], [subdomains], 1900, 5, {2: easy}, columns, True).seconds
        for dofs, subdomains, columns in ((30_400, 15, 2474), (121_600, 58, 8804))
    ]
    np.testing.assert_allclose(taken, [1.95, 3.94], rtol=0.2)


def test_points_of_a_path_take_longer_than_unit_strains():
    case = make_case(plane="generalized")
    path = replace(case, analysis=replace(case.analysis, type="path"), path=LoadPath(to={"E11": 1.0}))
    assert cost_model.fields_line(path, 50_000, 60_000, 3000, 1).endswith(" 3.7 s")
    assert cost_model.fields_line(path, 50_000, 60_000, 3000, 2).endswith(" 2.2 s")
