"""Errors of the KKT conditions: each relative to its own interface."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from feti_homog.interface.contact.states import kkt_errors

# Two nodes of a stiff interface and two of a soft one, all debonded.
TRACTION = np.array([[-2e6, 5e5], [-1e6, 0.0], [-3e-6, 0.0], [0.0, 0.0]])
LENGTH = np.array([0.1, 0.2, 0.1, 0.2])


def errors(traction, gap, closed=(True, True, True, False), length=LENGTH):
    def over_interface(values):
        return np.repeat(values.reshape(2, 2).max(axis=1), 2)

    debonded, stress = np.ones(4, bool), np.array([1e5, 1e5, 1e-7, 1e-7])
    nodes = SimpleNamespace(nodes=SimpleNamespace(length=length))
    scales = SimpleNamespace(
        solver=SimpleNamespace(comm=MPI.COMM_SELF, jump_operator=nodes),
        imposed=lambda acting: 0.5,
        bond_stress=lambda acting: stress,
        over_interface=over_interface,
        longest=over_interface(length),
    )
    return kkt_errors(scales, traction, np.array(gap), debonded, np.array(closed), np.zeros(3))


def test_errors_are_relative_to_what_is_imposed():
    assert set(errors(TRACTION, [0.0, 0.0, 0.0, 0.3]).values()) == {0.0}
    nothing = np.zeros((4, 2))
    nothing[3, 0] = 1e-10
    assert errors(nothing, [0.0, 0.0, 0.0, 0.0], (True,) * 4)["kkt_tension"] == pytest.approx(1e-3)
    assert errors(TRACTION, [0.0, 0.0, 0.0, -0.1])["kkt_penetration"] == pytest.approx(0.2)


def test_tension_on_a_soft_interface_is_seen_beside_a_stiff_one():
    pulled = TRACTION + np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [1.5e-6, 0.0]])
    assert errors(pulled, [0.0] * 4, (True,) * 4)["kkt_tension"] == pytest.approx(0.5)
    # The force counts, not the traction, on the short elements at a tip.
    short = np.array([0.1, 0.2, 0.1, 1e-5])
    assert errors(pulled, [0.0] * 4, (True,) * 4, short)["kkt_tension"] == pytest.approx(0.5e-4)
    # A force at an open gap, relative to the largest force there.
    found = errors(pulled, [0.0, 0.0, 0.0, 0.25])
    assert found["kkt_tension"] == 0.0 and found["kkt_complementarity"] == pytest.approx(3e-7 * 0.25 / (3e-7 * 0.5))
