"""Kinds of boundary operators from sizes alone."""

import pytest

from feti_homog.feti.operators.interface_operators import KINDS, SubdomainSize, choose
from feti_homog.feti.thresholds import Thresholds

LIMITS = Thresholds(dense_boundary_dofs=600, whole_boundary_dofs=200)
MANY = 10**6


def choice(boundary_dofs, kind="auto", applications=0, soft_modes=False, is_whole_body=False, can_condense=True):
    size = SubdomainSize(10 * boundary_dofs, boundary_dofs, is_whole_body)
    (explicit,), (facewise,) = choose([size], kind, applications, soft_modes, can_condense, LIMITS)
    return explicit, facewise


@pytest.mark.parametrize("applications", [0, MANY])
@pytest.mark.parametrize("soft_modes", [False, True])
def test_the_user_decides(applications, soft_modes):
    for n in (100, 10_000):
        assert choice(n, "explicit", applications, soft_modes)[0]
        assert not choice(n, "implicit", applications, soft_modes)[0]


def test_dense_matrices_are_made_where_they_pay_and_fit():
    assert not choice(500, applications=0)[0]
    assert choice(500, applications=MANY)[0]
    assert choice(500, soft_modes=True)[0]
    assert choice(100, soft_modes=True, is_whole_body=True) == (True, False)
    assert choice(500, soft_modes=True, is_whole_body=True) == (False, True)
    assert not choice(601, applications=MANY, soft_modes=True)[0]
    assert not choice(500, applications=MANY, soft_modes=True, can_condense=False)[0]
    sizes = [SubdomainSize(5000, n, False) for n in (100, 700, 300)]
    assert choose(sizes, "auto", 0, True, True, LIMITS)[0] == [True, False, True]


@pytest.mark.parametrize("kind", KINDS)
def test_a_subdomain_without_boundary_has_no_dense_matrix(kind):
    assert choice(0, kind, MANY, soft_modes=True) == (False, False)
