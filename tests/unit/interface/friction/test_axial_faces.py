"""Faces along the fibres: free jumps are eliminated exactly, and what no face may bear is an error."""

from types import SimpleNamespace

import numpy as np
import pytest
from support import torn_cells

from feti_homog.interface.contact.coupled_interfaces import slipped
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN, BondState, coulomb_errors
from feti_homog.interface.friction.sliding_cell import AxialFaces, SlidingCell
from feti_homog.interface.friction.status_system import FORWARD, STICK


@pytest.mark.parametrize("stiff", [1.0, 1e8, 1e12])
def test_free_faces_are_not_held_by_the_springs_of_others(stiff):
    """Four rows, the first two on springs, and a fifth kept by nothing."""
    A, b = np.random.default_rng(0).normal(size=(6, 4)), np.random.default_rng(1).normal(size=(4, 2))
    H, springs = A.T @ A, stiff * np.array([1.0, 3.0, 0.0, 0.0])
    L = 10.0 * np.eye(2)
    problem = SimpleNamespace(take=lambda rows, own: (H + np.diag(own), b, L))
    found = AxialFaces(problem, np.arange(4), springs).stiffness
    soft = H[2:, 2:] - H[2:, :2] @ np.linalg.solve(H[:2, :2] + np.diag(springs[:2]), H[:2, 2:])
    held = np.linalg.solve(H[:2, :2] + np.diag(springs[:2]), b[:2])
    rest = b[2:] - H[2:, :2] @ held
    np.testing.assert_allclose(found, L - b[:2].T @ held - rest.T @ np.linalg.solve(soft, rest), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("components", "known"), [(2, [0, 0, 0, 7, 0, 0]), (1, [0, 0, 0, 0, 0, 0])])
def test_damaged_bonds_slip_by_their_tangential_rows_alone(components, known):
    """An intact bond, a damaged one and an open face: what others of their rows open is left to the check of jumps."""
    solver = SimpleNamespace(rows=6, intact_compliance=np.ones(6), jump_operator=SimpleNamespace(components=components))
    interface = SimpleNamespace(solver=solver, nodes=SimpleNamespace(row=np.array([0, 2, 4])))
    bonds = torn_cells.bonds(np.array([BONDED, BONDED, OPEN], np.int8))
    bonds = BondState(bonds.status, bonds.history, bonds.pressed, gap_and_slip=np.zeros((3, 2)))
    solution = SimpleNamespace(jump=np.arange(4.0, 10.0), compliance=np.array([1.0, 1.0, 5.0, 5.0, 1.0, 1.0]))
    state = SimpleNamespace(bonds=bonds, status=bonds.status, solution=solution)
    np.testing.assert_array_equal(slipped(interface, state), known)


def test_forces_that_no_face_may_bear_are_errors():
    """Sticking within its limit, beyond it and pulled, sliding off it; along the fibres loose and open."""
    force = np.array(
        [[-1, 0.2, 0], [-1, 0.5, 0], [-2, -0.7, 0], [-1, 0, 0.4], [-1, 0, -0.4], [0, 0, 0.1], [-1, 0.3, 0], [1, 0.2, 0]]
    )
    sliding = np.array([0, 0, -1, 0, 0, 0, 1, 0], np.int8)
    found = coulomb_errors(force, np.full(8, 0.3), sliding)
    np.testing.assert_allclose(found, [0.0, 0.2, 0.1, 0.4, 0.4, 0.1, 0.0, 0.2], atol=1e-15)
    np.testing.assert_allclose(coulomb_errors(force[:3, :2], np.full(3, 0.3), sliding[:3]), found[:3])


def test_faces_without_friction_have_no_sign_of_slip():
    """Put a face without friction beside one that slides and one that sticks."""
    faces = SimpleNamespace(friction=np.array([0.3, 0.0, 0.3]))
    of = {"_position": np.arange(3), "_face_nodes": np.arange(3), "_damaged": np.zeros(3, bool), "faces": faces}
    cell = SimpleNamespace(**of, _jumps_of=lambda x: x)
    bonds = torn_cells.bonds(np.full(3, OPEN, np.int8))
    found = SlidingCell.bonds(cell, bonds, np.array([FORWARD, FORWARD, STICK], np.int8), np.zeros(6))
    np.testing.assert_array_equal(found.sliding, [1, 0, 0])
    np.testing.assert_array_equal(found.status, [CLOSED] * 3)
