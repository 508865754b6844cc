"""Energy: breaks dissipate the work done on the cell less the energy stored in it, whichever way it was loaded."""

from functools import cache

import numpy as np
import pytest
from support import torn_cells
from support.load_paths import beginning, followed
from support.loads import strains
from support.ranks import PIECES

from feti_homog.analysis.path_events import Work
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.laws.strength import MaxStrength
from feti_homog.interface.loads import Load
from feti_homog.interface.path.path_following import increments

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

EXACT = 1e-9
TIGHT = {"petsc": {"feti_pc_type": "influence", "feti_ksp_rtol": 1e-11}, "decomposition": PIECES}
SQUARE = {"geometry": "square", "mesh_size": 0.2} | TIGHT
THREE = {"geometry": "random", "fibres": 3, "min_gap": 0.1, "seed": 4, "mesh_size": 0.25, "radius_spread": 0.3} | TIGHT
CASES = {"square": SQUARE, "three": THREE}
STRAIGHT = np.array([1.0, 0.1, 0.2])
CRITERION = MaxStrength(20.0, 30.0)


def follow(cell, waypoints, contact=True):
    return followed(torn_cells.interface(cell, contact), CRITERION, waypoints)


@pytest.fixture(scope="module")
def straight(torn):
    """straight(case, contact): the cell and the points of the path to STRAIGHT, followed at the first call."""

    @cache
    def made(case, contact):
        cell = torn(**CASES[case])
        return cell, follow(cell, [STRAIGHT], contact)

    return made


def dissipated(points):
    """(points, 2) along the snap-back, and at rising strain."""
    energies, rows = Work(), []
    for point in points:
        energies.arrive(point)
        rows.append((energies.all_equilibria.released, energies.load_controlled))
    return np.array(rows)


def strain(point):
    return point.scale * point.state.solution.strain


def stress(cell, point):
    return point.scale * torn_cells.stress(cell, point.state.solution)


def stored(cell, point):
    """Strain energy per area, from the displacements."""
    return point.scale**2 * torn_cells.energy(cell, point.state.solution) / cell.summary.area


def stress_under(interface, cell, strain, point):
    """Sigma under a strain with the bonds that a point leaves."""
    return torn_cells.stress(
        cell, interface.equilibrium(Load.strain(strain), point.after.bonds, point.after.lam[0]).solution
    )


@pytest.mark.parametrize(
    ("case", "contact", "waypoints"),
    [
        ("three", True, None),
        ("three", True, [0.6 * STRAIGHT, [0.0, 0.0, 0.0], [-0.4, 0.8, 1.5]]),
        ("square", False, [[-0.2, -0.2, 0.7], 0.8 * STRAIGHT]),
    ],
    ids=["straight", "through zero", "turning"],
)
def test_events_dissipate_the_work_that_is_not_stored(straight, case, contact, waypoints):
    cell, points = straight(case, contact)
    interface = torn_cells.interface(cell, contact)
    if waypoints is not None:
        points = follow(cell, waypoints, contact)
    found, work, worst = dissipated(points), 0.5 * strain(points[0]) @ stress(cell, points[0]), 0.0
    assert sum(p.broke > 0 for p in points) > 8
    for before, now, lost in zip(points, points[1:], found[1:, 0], strict=False):
        # The response between points is straight, so the trapezoid's rule is exact.
        after = stress_under(interface, cell, strain(before), before)
        work += 0.5 * (after + stress(cell, now)) @ (strain(now) - strain(before))
        worst = max(worst, abs(work - stored(cell, now) - lost))
    assert worst < EXACT * found[-1, 0]
    assert (np.diff(found, axis=0) >= 0).all() and (found[:, 1] >= found[:, 0]).all()


@pytest.mark.parametrize(("case", "contact"), [("three", True), ("square", False)])
def test_rising_strain_dissipates_the_area_under_its_curve(straight, case, contact):
    """At a load t the branch is that of the first point at t or more: the area under it, less what is stored."""
    cell, points = straight(case, contact)
    loads = np.array([p.load_factor for p in points])
    records = np.flatnonzero(loads >= np.maximum.accumulate(loads))
    slopes = np.array([STRAIGHT @ torn_cells.stress(cell, points[k].state.solution) for k in records])
    area = 0.5 * slopes @ np.diff(loads[records] ** 2, prepend=0.0)
    released, controlled = dissipated(points)[-1]
    assert abs(area - stored(cell, points[-1]) - controlled) < EXACT * controlled
    # The curve has a snap-back, whose energy a test at rising strain loses too.
    assert controlled > 1.01 * released


@pytest.mark.one_rank
@pytest.mark.parametrize("worst_only", [True, False])
def test_increments_dissipate_the_work_that_is_not_stored(torn, worst_only):
    cell = torn(**THREE)
    interface = torn_cells.interface(cell, True)
    loads, begin = strains(STRAIGHT[None]), beginning(interface)
    points = list(increments(CoupledInterfaces(interface), CRITERION, loads, 12, worst_only, begin))
    found = dissipated(points)
    work = 0.5 * strain(points[0]) @ stress(cell, points[0])
    for before, now, lost in zip(points, points[1:], found[1:, 0], strict=False):
        held = stress_under(interface, cell, strain(now), before)
        work += 0.5 * (held + stress(cell, before)) @ (strain(now) - strain(before))
        assert abs(work - stored(cell, now) - lost) < EXACT * found[-1, 0]
    assert (found[:, 0] == found[:, 1]).all() and found[-1, 0] > 0


def breaks(cell, points):
    """Return (breaks, 3): share of the strain STRAIGHT, broken bonds, and energy dissipated along the snap-back.

    And the last at rising strain.
    """
    energies = dissipated(points)
    rows = [
        (strain(p) @ STRAIGHT / (STRAIGHT @ STRAIGHT), p.broke, *e)
        for p, e in zip(points, energies, strict=True)
        if p.broke
    ]
    return np.array(rows).reshape(-1, 4)


def test_beyond_a_waypoint_a_straight_path_is_controlled_by_strain(straight):
    """The bonds of a snap-back break at the largest load so far, with the energies of rising strain."""
    cell, points = straight("square", False)
    whole = breaks(cell, points)
    turn = 0.6 * whole[:, 0].max()
    split = breaks(cell, follow(cell, [turn * STRAIGHT, STRAIGHT], False))
    np.testing.assert_array_equal(split[:, 1], whole[:, 1])
    beyond = np.maximum.accumulate(whole[:, 0]) > turn
    np.testing.assert_allclose(split[beyond, 0], np.maximum.accumulate(whole[:, 0])[beyond], rtol=1e-8)
    np.testing.assert_allclose(split[:, 3], whole[:, 3], rtol=1e-8, atol=1e-8 * whole[-1, 3])
