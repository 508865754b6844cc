"""Legs of a path beyond the first: no change of contact is passed over, fibres that nothing holds included."""

from itertools import pairwise

import numpy as np
import pytest
from support import torn_cells
from support.load_paths import followed
from support.ranks import PIECES

from feti_homog.interface.laws.strength import MaxStrength
from feti_homog.interface.loads import Load

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

STRAIGHT = 1e-7
FREE = {
    "square": {"geometry": "square", "mesh_size": 0.2, "decomposition": PIECES},
    "quadratic": {"geometry": "square", "mesh_size": 0.3, "order": 2, "plane": "stress", "decomposition": PIECES},
    "hexagonal": {"geometry": "hexagonal", "mesh_size": 0.3, "decomposition": {"subdomains": 9}},
    "plane": {"geometry": "hexagonal", "mesh_size": 0.3, "bodies": "plane", "petsc": {"feti_pc_type": "influence"}}
    | {"decomposition": PIECES},
}
THREE = {"geometry": "random", "fibres": 3, "min_gap": 0.1, "seed": 4, "mesh_size": 0.2, "decomposition": PIECES}
# Through zero, beside it, and from squeezed fibres to others with room.
WAYPOINTS = {
    "through zero": [[0.05, 0.05, 0.0], [-0.05, -0.05, 0.0]],
    "beside zero": [[0.05, 0.05, 0.0], [-0.05, 0.02, 0.03], [0.02, -0.06, 0.01], [0.05, 0.05, -0.1]],
    "squeezed first": [[-0.05, -0.04, 0.0], [0.05, 0.05, 1e-4], [-0.05, -0.04, 0.0]],
}
NEVER = MaxStrength(np.inf, np.inf)


def largest_bend(interface, points, legs):
    """Largest distance of the stress between points of later legs from the straight line, relative to the largest."""
    stress, bend = interface.stress, 0.0
    scale = max(np.abs(p.scale * stress(p.state.solution)).max() for p in points)
    for before, now in pairwise(points):
        if before.load_factor * legs < 1 - 1e-12 or before.scale != 1.0:
            continue
        bonds, last = now.state.bonds, now.state.solution
        first = interface.equilibrium(Load.strain(before.state.solution.strain), bonds, before.after.lam[0]).solution
        strain, lam = (0.6 * a + 0.4 * b for a, b in ((first.strain, last.strain), (first.lam, last.lam)))
        # Where the path is straight the guess is the solution: only to confirm it costs little.
        between = stress(interface.equilibrium(Load.strain(strain), bonds, lam).solution)
        bend = max(bend, np.abs(between - 0.6 * stress(first) - 0.4 * stress(last)).max() / scale)
    return bend


@pytest.mark.one_rank
@pytest.mark.parametrize(("case", "legs"), [*zip(list(FREE)[1:], WAYPOINTS, strict=True)])
def test_free_fibres_are_straight_between_points(torn, case, legs):
    cell, waypoints = torn(**FREE[case]), WAYPOINTS[legs]
    interface, solves = torn_cells.interface(cell, True), cell.solver.solves
    points = followed(interface, NEVER, waypoints, True)
    solves = cell.solver.solves - solves
    assert all(p.state.solution.reason > 0 and max(p.state.certificate.values()) < 1e-8 for p in points)
    assert largest_bend(interface, points, len(waypoints)) < STRAIGHT
    # A state at each change, one past it, and one ahead, with a pivot now and then: no halvings, also where faces that
    # touch without a force open on the way to a change.
    assert solves < 4.5 * len(points)


@pytest.mark.one_rank
def test_partly_free_and_breaking_fibres_are_straight_between_points(comm):
    cell = torn_cells.tear(comm, **THREE)
    fibre = cell.solver.jump_operator.nodes.fibre
    interface, debonded = torn_cells.interface(cell, True), fibre != comm.allreduce(fibre.min(initial=1000), min)
    waypoints = [[0.05, 0.05, 0.0], [-0.05, -0.02, 0.03], [0.6, -0.3, 0.1], [-0.8, -0.2, 0.0]]
    points = followed(interface, MaxStrength(20.0, 30.0), waypoints, debonded)
    assert sum(p.broke for p in points[1:]) > 3
    assert largest_bend(interface, points, len(waypoints)) < STRAIGHT


def test_a_fibre_that_breaks_bond_by_bond_takes_few_solves(comm):
    material = {"matrix": {"young": 100.0, "poisson": 0.4}, "fibre": {"young": 500.0, "poisson": 0.2}}
    cell = torn_cells.tear(comm, geometry="square", mesh_size=0.2, plane="stress", decomposition=PIECES, **material)
    waypoints, solves = [[0.02, 0.0, 0.0], [-0.05, 0.02, 0.0], [0.1, 0.0, 0.0]], cell.solver.solves
    points = followed(torn_cells.interface(cell, True), MaxStrength(4.0, 3.0), waypoints)
    assert len(points) > 30 and points[-1].load_factor == 1.0
    # A state at each change or break, one past it, and one ahead, with a pivot now and then: no halvings.
    assert cell.solver.solves - solves < 3.5 * len(points)


def test_a_free_fibre_is_squeezed_where_the_strain_is_zero(torn):
    cell = torn(**FREE["square"])
    interface = torn_cells.interface(cell, True)
    tension, turn, pressed = followed(interface, NEVER, WAYPOINTS["through zero"], True)
    assert [tension.load_factor, pressed.load_factor] == [0.5, 1.0]
    assert abs(turn.load_factor - 0.75) < 1e-9 and np.abs(turn.state.solution.strain).max() < 1e-9
    # On both sides the response is proportional to the strain, with the stiffnesses of a void and of a contact.
    opening, closing = (p.state.solution.strain @ interface.stress(p.state.solution) for p in (tension, pressed))
    assert 1.5 * opening < closing


def test_faces_that_touch_without_force_hold_nothing(torn):
    interface = torn_cells.interface(torn(**FREE["square"]), True)
    points = followed(interface, NEVER, [[-0.05, -0.05, 0.0], [0.0, 0.0, 0.0]], True)
    pressed, unloaded_again = (point for point in points if point.after.position == 0)
    assert [pressed.state.free_motions, unloaded_again.state.free_motions] == [1, 3]


@pytest.mark.one_rank
def test_a_leg_that_ends_without_load_ends_in_one_point(comm):
    """At zero load all contact forces and gaps vanish, up to rounding at the very end of the leg."""
    cell = torn_cells.tear(comm, **THREE)
    interface = torn_cells.interface(cell, True)
    points = followed(interface, NEVER, [[0.0, -0.05, 0.01], [0.0, 0.0, 0.0], [0.05, 0.02, 0.0]], True)
    loads = np.array([point.load_factor for point in points])
    assert (np.abs(loads - 2 / 3) < 1e-9).sum() == 1 and (np.diff(loads) > 1e-9).all()
