"""Loads of strains and stresses, and the energies between two states under one load."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from feti_homog.interface.loads import Load, Macroscopic

COMPONENTS = 4
BY_STRESS = st.lists(st.booleans(), min_size=COMPONENTS, max_size=COMPONENTS).map(np.array)
SEEDS = st.integers(0, 2**32 - 1)


def stiffness(rng):
    """Return a symmetric positive definite matrix."""
    root = rng.normal(size=(COMPONENTS, COMPONENTS))
    return root @ root.T + np.eye(COMPONENTS)


def state(L, load):
    """Return the response of a material of this stiffness to a load."""
    f, strain = load.by_stress, np.where(load.by_stress, 0.0, load.values)
    strain[f] = np.linalg.solve(L[np.ix_(f, f)], load.values[f] - (L @ strain)[f])
    return Macroscopic(strain, L @ strain)


def energy(found):
    return found.strain @ found.stress / 2


@given(seed=SEEDS, by_stress=BY_STRESS)
def test_a_loss_of_stiffness_at_constant_load_loses_work_less_what_is_stored(seed, by_stress):
    rng = np.random.default_rng(seed)
    L, loss = stiffness(rng), rng.uniform(0.1, 0.9)
    load = Load(rng.normal(size=COMPONENTS), by_stress)
    before, after = state(L, load), state(loss * L, load)
    released = before.released_to(after)
    scale = energy(before) + energy(after)
    assert released >= -1e-12 * scale
    # The work of the loads, of which one of strain and stress is constant.
    work = (before.stress + after.stress) @ (after.strain - before.strain) / 2
    assert work == pytest.approx(after.stored - before.stored + released, abs=1e-10 * scale)
    # Of one material the potential is 1/2 e.Sigma - Sigma_f.e_f, and so much of it is lost.
    potential = [energy(each) - each.stress[by_stress] @ each.strain[by_stress] for each in (before, after)]
    assert released == pytest.approx(potential[0] - potential[1], abs=1e-10 * scale)


@given(seed=SEEDS, by_stress=BY_STRESS, share=st.floats(0.0, 1.0))
def test_between_states_of_one_stiffness_nothing_is_lost(seed, by_stress, share):
    rng = np.random.default_rng(seed)
    L = stiffness(rng)
    start, end = (Load(rng.normal(size=COMPONENTS), by_stress) for _ in range(2))
    here, there = state(L, start), state(L, start.after(share, end))
    scale = energy(here) + energy(there)
    assert here.released_to(there) == pytest.approx(0.0, abs=1e-10 * scale)
    np.testing.assert_allclose(there.load(by_stress).values, start.after(share, end).values, atol=1e-10)


def test_rounding_of_a_load_that_returns_to_zero_is_none_of_either_kind():
    by_stress = np.array([True, False])
    start, end = Load(np.array([0.3, 3e-4]), by_stress), Load(np.array([-0.6, -6e-4]), by_stress)
    assert not start.after(1 / 3, end).values.any()
    assert start.after(0.0, end).values.tolist() == [0.3, 3e-4]
    assert start.after(1.0, end).values.tolist() == [-0.6, -6e-4]


def test_a_component_far_smaller_than_another_is_no_rounding():
    start, end = Load(np.array([1e6, 0.0]), np.ones(2, bool)), Load(np.array([0.0, 1e-8]), np.ones(2, bool))
    assert start.after(1.0, end).values.tolist() == [0.0, 1e-8]


def test_a_load_of_two_problems_is_parted():
    load = Load(np.arange(5.0), np.array([True, False, False, True, False]))
    first, second = load.parts([3, len(load.values) - 3])
    assert first.values.tolist() == [0, 1, 2] and second.values.tolist() == [3, 4]
    assert second.by_stress.tolist() == [True, False]
