"""Load-induced debonding against brute force, reference numbers and laws, at any number of ranks."""

from itertools import pairwise

import numpy as np
import pytest
from reference.load_path import SlowLoadPath
from reference.references import LARGEST_TRACTIONS, ONSET
from support import torn_cells
from support.cases import relative_error
from support.loads import strains
from support.ranks import PIECES, parallel_assert

from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, OPEN
from feti_homog.interface.laws.strength import MaxStrength, QuadraticStrength
from feti_homog.interface.path.path_following import events, increments
from feti_homog.interface.path.path_points import unloaded
from feti_homog.system.parallel.mpi_errors import on_root

pytestmark = [pytest.mark.parallel, pytest.mark.usefixtures("shared_interfaces")]

SQUARE = {"geometry": "square", "mesh_size": 0.2, "decomposition": PIECES}
HEXAGONAL = {"geometry": "hexagonal", "mesh_size": 0.4, "order": 2, "plane": "stress"}
THREE = {
    "geometry": "random", "fibres": 3, "min_gap": 0.1, "seed": 4, "mesh_size": 0.2, "radius_spread": 0.3,
    "decomposition": PIECES,
}  # fmt: skip
PHASES = {"matrix": {"young": 1.0, "poisson": 0.35}, "fibre": {"young": 5.0, "poisson": 0.2}}
INFLUENCE = {"petsc": {"feti_pc_type": "influence"}}
CELLS = [
    SQUARE,
    SQUARE | {"order": 2, "mesh_size": 0.3, "plane": "stress"} | INFLUENCE,
    HEXAGONAL | {"bodies": "plane", "decomposition": {"subdomains": 7}} | INFLUENCE,
    THREE,
]
TENSION, MIXED, SHEAR = [1.0, 0.1, 0.2], [0.6, -0.8, 0.3], [0.2, -0.1, 1.0]


def intact(cell):
    return torn_cells.bonds(np.full(len(cell.solver.jump_operator.nodes.row), BONDED, np.int8))


def follow(cell, contact, law, waypoints, begin=None):
    """All points of an events path from the wholly bonded cell."""
    loaded = CoupledInterfaces(torn_cells.interface(cell, contact))
    return list(events(loaded, law, strains(np.array(waypoints)), begin or unloaded(loaded, intact(cell))))


def curve(cell, points):
    """(points, 4) load factor and Sigma."""
    return np.array([[p.load_factor, *(p.scale * torn_cells.stress(cell, p.state.solution))] for p in points])


def broken(case, points):
    """For each point, which of the reference's nodes are broken after it."""
    return np.array([case.in_reference_order(p.after.bonds.status) != BONDED for p in points])


def is_certified(points):
    return all(p.state.solution.reason > 0 and max(p.state.certificate.values()) < 1e-8 for p in points)


# Each criterion with and without contact.
ASKED = [("max", True, MIXED), ("quadratic", True, SHEAR), ("max", False, TENSION), ("quadratic", False, MIXED)]


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("cell", "criterion", "contact", "strain"),
    [(cell, *asked) for cell, asked in zip(CELLS, ASKED, strict=True)],
    ids=["square", "stress", "hexagonal", "three"],
)
def test_events_are_those_of_the_quadratic_programme(comm, built, cell, criterion, contact, strain):
    case = built(**PHASES, **cell)
    strengths = (0.15, 0.3) if criterion == "max" else (0.25, 0.2)
    expected = on_root(
        comm, lambda: SlowLoadPath(case.reference, contact, *strengths, criterion).proportional(np.array(strain))
    )
    points = follow(
        case.cell, contact, (MaxStrength if criterion == "max" else QuadraticStrength)(*strengths), [strain]
    )
    assert len(points) == len(expected) > 3
    assert is_certified(points)
    np.testing.assert_array_equal(broken(case, points), np.cumsum([e.broke for e in expected], axis=0) > 0)
    wanted = np.array([[e.load_factor, *e.stress] for e in expected])
    assert relative_error(curve(case.cell, points)[:, 0], wanted[:, 0]) < 1e-7
    assert relative_error(curve(case.cell, points)[:, 1:], wanted[:, 1:]) < 1e-7
    assert points[-1].load_factor == 1.0
    assert [p.broke for p in points] == [e.broke.sum() for e in expected]


@pytest.mark.few_ranks
def test_events_of_later_legs_are_those_of_small_steps_and_bisection(comm, built):
    """Unloaded, reversed and loaded again."""
    case = built(**PHASES, **SQUARE)
    legs = np.array([[0.3, -0.4, 0.15], [0.0, 0.0, 0.0], [-0.6, 0.8, -0.3], [0.9, -0.9, 0.7]])
    expected = on_root(comm, lambda: SlowLoadPath(case.reference, True, 0.15, 0.3, "max").legs(legs, 12))
    points = follow(case.cell, True, MaxStrength(0.15, 0.3), legs)
    assert is_certified(points)
    turns = [p for p in points if not p.broke and p.after.position > 0]
    assert turns
    points = [p for p in points if p.broke or p.after.position == 0]
    assert len(points) == len(expected) > 8
    np.testing.assert_array_equal(broken(case, points), np.cumsum([e.broke for _, e in expected], axis=0) > 0)
    wanted = np.array([[load, *e.stress] for load, e in expected])
    assert np.abs(curve(case.cell, points) - wanted).max() < 1e-5 * np.abs(wanted[:, 1:]).max()
    (at_zero,) = (p for p in points if p.load_factor == 1 / 2 and p.broke == 0)
    assert (torn_cells.stress(case.cell, at_zero.state.solution) == 0).all()


def test_debonding_begins_at_the_load_of_the_series_solution(comm):
    cell = torn_cells.tear(comm, geometry="square", order=2, mesh_size=0.07, refine=1, decomposition=PIECES)
    interface = torn_cells.interface(cell, True)
    loaded = CoupledInterfaces(interface)
    first = next(events(loaded, MaxStrength(0.1, 0.1), strains(np.eye(3)[:1]), unloaded(loaded, intact(cell))))
    stress = first.scale * torn_cells.stress(cell, first.state.solution)
    assert np.abs(np.r_[first.load_factor, stress[:2]] / ONSET.value - 1).max() < 1e-3
    normal, shear = interface.traction(first.state.solution).T
    largest_normal, largest_shear = LARGEST_TRACTIONS.value
    assert abs(comm.allreduce(normal.max(initial=0), max) / largest_normal - 1) < 1e-3
    assert abs(comm.allreduce(np.abs(shear).max(initial=0), max) / largest_shear - 1) < 1e-3
    away = np.degrees(np.arctan2(*interface.nodes.normal.T[::-1]))
    largest = normal == comm.allreduce(normal.max(initial=0), max)
    parallel_assert(comm, bool((np.minimum(np.abs(away), 180 - np.abs(away))[largest] < 5).all()))


@pytest.mark.one_rank
def test_increments_meet_events_and_the_curve_between_them_converges_with_first_order(torn):
    """Releasing the worst bonds one after the other, an increment ends where events end that break no later."""
    cell = torn(**SQUARE)
    law, strain = MaxStrength(0.05, 0.05), np.array([[1e-3, 0.0, 0.0]])
    exact = curve(cell, follow(cell, True, law, strain))[:, :2]
    loaded, loads, errors = CoupledInterfaces(torn_cells.interface(cell, True)), np.linspace(0, 1, 20001), []
    for steps in (10, 40):
        begin = unloaded(loaded, intact(cell))
        found = curve(cell, list(increments(loaded, law, strains(strain), steps, True, begin)))[:, :2]
        assert relative_error(found[:, 1], rising(exact, found[:, 0])) < 1e-7
        errors.append(np.abs(np.interp(loads, *np.vstack([[0, 0], found]).T) - rising(exact, loads)).mean())
    # A drop within a step h is smeared over it: an error of between a quarter and a half of the drop times h.
    constants = np.array(errors) * [10, 40]
    assert constants.max() < 2.1 * constants.min()


def rising(exact, loads):
    """Sigma11 under rising strain: on the ray to the first point that no later break at this load or less follows."""
    first = [np.flatnonzero(exact[:, 0] > load * (1 - 1e-12))[0] for load in np.minimum(loads, 1 - 1e-9)]
    return loads * (exact[:, 1] / exact[:, 0])[first]


@pytest.mark.one_rank
def test_a_path_goes_on_from_any_of_its_points_with_the_same_events(comm):
    case = torn_cells.build(comm, **SQUARE)
    law, waypoints = MaxStrength(20.0, 30.0), [[0.7, -0.8, 0.5], [0.0, 0.0, 0.0], [-1.0, 1.0, 1.5]]
    points = follow(case.cell, True, law, waypoints)
    whole, sets = curve(case.cell, points), broken(case, points)
    for k in range(0, len(points) - 1, max(1, len(points) // 3)):
        rest = follow(case.cell, True, law, waypoints, points[k].after)
        assert relative_error(curve(case.cell, rest), whole[k + 1 :]) < 1e-7
        np.testing.assert_array_equal(broken(case, rest), sets[k + 1 :])
    assert follow(case.cell, True, law, waypoints, points[-1].after) == []


@pytest.mark.parametrize("worst_only", [True, False])
def test_increments_stop_at_a_solve_that_does_not_converge(comm, worst_only):
    loose = {"petsc": {"feti_ksp_max_it": 1, "feti_pc_type": "none"}}
    cell = torn_cells.tear(comm, **SQUARE, **loose)
    loaded, law = CoupledInterfaces(torn_cells.interface(cell, True)), MaxStrength(1e-3, 1e-3)
    begin = unloaded(loaded, intact(cell))
    (point,) = increments(loaded, law, strains(np.array([MIXED])), 4, worst_only, begin)
    assert point.state.solution.reason < 0 and point.broke == 0


def test_infinite_strengths_never_break(torn):
    cell = torn(**SQUARE)
    points = follow(cell, True, QuadraticStrength(np.inf, np.inf), [TENSION, SHEAR])
    assert [(p.load_factor, p.broke) for p in points] == [(0.5, 0), (1.0, 0)]
    status = np.full(len(intact(cell).status), OPEN, np.int8)
    begin = unloaded(CoupledInterfaces(torn_cells.interface(cell, True)), torn_cells.bonds(status))
    points = [p for p in follow(cell, True, MaxStrength(1.0, 1.0), [SHEAR, MIXED], begin) if p.after.position == 0]
    assert [(p.load_factor, p.broke) for p in points] == [(0.5, 0), (1.0, 0)]
    assert is_certified(points)


@pytest.mark.few_ranks
def test_twenty_fibres_debond_to_the_end_certified_and_dissipating(comm):
    many = {"geometry": "random", "fibres": 20, "fibre_fraction": 0.4, "min_gap": 0.1, "seed": 2, "mesh_size": 0.08}
    many |= {"decomposition": {"subdomains": 22}}
    cell = torn_cells.tear(comm, **many, **INFLUENCE)
    points = follow(cell, True, MaxStrength(30.0, 15.0), [[1.0, -0.3, 0.4]])
    assert is_certified(points)
    assert points[-1].load_factor == 1.0
    left = comm.allreduce(int((points[-1].state.status == BONDED).sum()))
    assert left < comm.allreduce(len(intact(cell).status))
    for before, now in pairwise(points):
        parallel_assert(comm, bool(((before.after.bonds.status != BONDED) <= (now.after.bonds.status != BONDED)).all()))
        drop = torn_cells.stress(cell, before.state.solution) - torn_cells.stress(cell, now.state.solution)
        assert drop @ [1.0, -0.3, 0.4] > -1e-9 * np.abs(drop).max()
