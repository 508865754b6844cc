"""The factor at which tractions t0 + f t1 break a bond: the utilisation is 1 there, and less before."""

import math

import numpy as np
import pytest

from feti_homog.interface.laws.energy import SpringEnergy
from feti_homog.interface.laws.strength import MaxStrength, QuadraticStrength, Strength
from feti_homog.interface.path.onsets import Onset

CRITERIA = {
    "max": MaxStrength(2.0, 1.5, 3.0),
    "quadratic": QuadraticStrength(2.0, 1.5, 3.0),
    "quadratic, only shear": QuadraticStrength(math.inf, 1.5),
    "max, only tension": MaxStrength(2.0, math.inf),
    "energy": SpringEnergy(5.0, 2.0, 0.4, 0.25, 1.0),
    "energy of shear like that of tension": SpringEnergy(5.0, 2.0, 0.4, 1.0),
    "energy without shear": SpringEnergy(5.0, 2.0, 0.4, 0.0, 1.0),
}
NODES, RAYS = 40, 25


def tractions(components, law):
    """Random ones; before, none breaks a bond, and many are pressed hard."""
    random = np.random.default_rng(3)
    before, ahead = random.normal(size=(NODES, components)), random.normal(size=(RAYS, NODES, components))
    before[::3, 0] = -50.0
    before[1::3] *= 0.1
    used = law.share(before)
    return before * np.where(used >= 1.0, 0.9 / np.maximum(used, 1e-300), 1.0)[:, None], ahead


def used_at(law, factor, before, ahead):
    return law.share(before + factor[:, None] * ahead)


@pytest.mark.parametrize("components", [2, 3])
@pytest.mark.parametrize("name", CRITERIA)
def test_the_first_bond_of_each_ray(name, components):
    law = CRITERIA[name]
    before, ahead = tractions(components, law)
    onset = Onset(law, np.ones(NODES, bool))
    found = onset.factors(ahead, np.zeros(RAYS), before).min(axis=1)
    assert np.isfinite(found).sum() > RAYS / 2
    for factor, ray in zip(found, ahead, strict=True):
        if np.isfinite(factor):
            largest = used_at(law, np.full(NODES, factor), before, ray).max()
            earlier = [
                used_at(law, np.full(NODES, share * factor), before, ray).max() for share in (0.0, 0.5, 0.999999)
            ]
            assert abs(largest - 1) < 1e-12 and max(earlier) < 1.0
        else:
            assert used_at(law, np.full(NODES, 1e9), before, ray).max() < 1.0


@pytest.mark.parametrize("name", ["max", "quadratic"])
def test_strengths_have_the_factor_of_every_bond(name):
    law = CRITERIA[name]
    before, ahead = tractions(3, law)
    ahead = ahead[0]
    factor = law.first_factor(before, ahead)
    broken = np.isfinite(factor)
    assert np.abs(used_at(law, factor[broken], before[broken], ahead[broken]) - 1).max() < 1e-10
    assert (used_at(law, 0.999999 * factor[broken], before[broken], ahead[broken]) < 1.0).all()


def from_zero(law, traction):
    """(n, k) factors at which tractions (n, k, 3) alone break bonds, by the laws' formulas."""
    pull, shear, along = np.maximum(traction[..., 0], 0.0), *np.abs(np.moveaxis(traction[..., 1:], -1, 0))
    if isinstance(law, Strength):
        shares = pull / law.normal, shear / law.tangential, along / law.axial
        together = {MaxStrength: np.max, QuadraticStrength: lambda parts, axis: np.sqrt(np.square(parts).sum(axis))}
        return 1 / together[type(law)](shares, axis=0)
    opening = pull**2 / (2 * law.normal_stiffness)
    sliding = shear**2 / (2 * law.tangential_stiffness) + along**2 / (2 * law.axial_stiffness)
    psi = np.arctan2(np.sqrt(sliding), np.sqrt(opening))
    return np.sqrt(law.toughness * (1 + np.tan((1 - law.mode_sensitivity) * psi) ** 2) / (opening + sliding))


@pytest.mark.parametrize("name", CRITERIA)
def test_from_zero_the_factors_are_those_of_the_formulas(name):
    law = CRITERIA[name]
    _, ahead = tractions(3, law)
    onset = Onset(law, np.arange(NODES) != 7)
    factors = onset.factors(ahead, np.zeros(RAYS))
    with np.errstate(divide="ignore"):
        expected = np.where(np.arange(NODES) == 7, np.inf, from_zero(law, ahead))
    np.testing.assert_allclose(factors, expected, rtol=1e-13)
    again = onset.factors(ahead, np.zeros(RAYS), np.zeros((NODES, 3)))
    np.testing.assert_allclose(again.min(axis=1), factors.min(axis=1), rtol=1e-14)


def test_what_is_as_little_as_the_error_breaks_nothing():
    onset = Onset(CRITERIA["max"], np.ones(2, bool))
    ahead = np.array([[[1e-9, 0.0], [0.0, 2e-9]]])
    assert np.isinf(onset.factors(ahead, np.array([1e-8]))).all()
    assert np.isfinite(onset.factors(ahead, np.array([1e-10]))).all()
