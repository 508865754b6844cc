"""Tips of debonded chains of interface nodes, and the work of closing a crack, against the field of a crack."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_matrix

from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN
from feti_homog.interface.tips.crack_tips import InterfaceChains, closing_work


def chains(edges, n):
    a, b = np.array(edges).T
    return InterfaceChains(coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(n, n)).tocsr())


def ring(n, order):
    """n nodes around a fibre, numbered in any order."""
    return chains(list(zip(order, np.roll(order, -1), strict=True)), n)


def states(n, **chosen):
    status = np.full(n, BONDED, np.int8)
    for kind, nodes in chosen.items():
        status[nodes] = {"open": OPEN, "closed": CLOSED}[kind]
    return status


def test_a_debonded_arc_has_two_tips():
    order = np.random.default_rng(1).permutation(12)
    tips = ring(12, order).tips(states(12, open=order[[3, 4]], closed=order[5]))
    found = {tuple(map(int, row)) for row in zip(tips.node, tips.behind, tips.ahead, strict=True)}
    assert found == {tuple(map(int, order[[2, 3, 1]])), tuple(map(int, order[[6, 5, 7]]))}


@pytest.mark.parametrize("debonded", [[], range(8), [0, 2, 4, 6], [0, 1, 2, 3, 4, 5, 6]])
def test_nothing_everything_and_single_bonds_have_no_tips(debonded):
    assert len(ring(8, np.arange(8)).tips(states(8, open=list(debonded))).node) == 0


def test_the_ends_of_chains_are_no_tips():
    line = chains([(0, 1), (1, 2), (2, 3), (3, 4)], 6)
    tips = line.tips(states(6, open=[0, 4]))
    assert tips.node.tolist() == [1, 3] and tips.behind.tolist() == [0, 4] and tips.ahead.tolist() == [2, 2]
    onward = line.onward(tips.node, tips.ahead, 4)
    assert onward.tolist() == [[1, 2, 3, 4, -1], [3, 2, 1, 0, -1]]


@pytest.mark.parametrize("growth", [1.0, 1.4])
@pytest.mark.parametrize("length", [1.0, 0.93])
def test_closing_work_is_that_of_the_field_of_a_crack(growth, length):
    """t = K / sqrt(2 pi s) and w = c K sqrt(2 s / pi): 1 / (2 a) int t(s) w(a - s) ds = c K^2 / 4, for any a."""
    nodes = np.concatenate([[0.0], np.cumsum(growth ** np.arange(400 if growth == 1.0 else 16))])
    nodes *= 1.2 / nodes[-1]
    K = np.array([2.0, -3.0])
    w = 0.5 * K * np.sqrt(2 * nodes / np.pi)[:, None]
    # Forces that linear shape functions make of the traction: int N_k s^-1/2 ds, exact.
    a, b = nodes[:-1], nodes[1:]
    whole, first = 2 * (np.sqrt(b) - np.sqrt(a)), 2 / 3 * (b**1.5 - a**1.5)
    lumps = np.zeros(len(nodes))
    lumps[:-1] += (b * whole - first) / (b - a)
    lumps[1:] += (first - a * whole) / (b - a)
    force = K / np.sqrt(2 * np.pi) * lumps[:, None]
    assert closing_work(length, nodes, force, nodes, w) == pytest.approx(0.5 * K**2 / 4, rel=0.02)


def test_closing_work_of_one_element_is_the_virtual_crack_closure():
    force, jump = np.array([[3.0, -1.0], [9.0, 9.0]]), np.array([[0.0, 0.0], [0.5, -0.25]])
    at = np.array([0.0, 0.2])
    assert closing_work(0.2, at, force, at, jump).tolist() == pytest.approx([3.0 * 0.5 / 0.4, 0.25 / 0.4])
    # Quadratic elements: the vertex, and the node within the element.
    at, force = np.array([0.0, 0.1, 0.2]), np.array([[3.0, 0.0], [2.0, 0.0], [9.0, 9.0]])
    jump = np.array([[0.0, 0.0], [0.4, 0.0], [0.5, 0.0]])
    assert closing_work(0.2, at, force, at, jump)[0] == pytest.approx((3.0 * 0.5 + 2.0 * 0.4) / 0.4)


def test_faces_that_overlap_or_touch_take_no_work():
    at = np.array([0.0, 0.2])
    work = closing_work(0.2, at, np.array([[-3.0, 1.0], [0.0, 0.0]]), at, np.array([[0.0, 0.0], [0.0, 0.5]]))
    assert work.tolist() == pytest.approx([0.0, 0.5 / 0.4])
