"""Laws of bonds stand on both floors: in runs, and by formulas of their own in the checks of results."""

from __future__ import annotations

import numpy as np
import pytest

from feti_homog.case.bond_laws import LAWS
from feti_homog.interface.laws.registry import law_class
from feti_homog.verify.bond_laws.law import law_of

SECTION = {
    "normal_stiffness": 5.0,
    "tangential_stiffness": 2.0,
    "axial_stiffness": 1.0,
    "normal_strength": 2.0,
    "tangential_strength": 1.5,
    "axial_strength": 3.0,
    "toughness": 0.4,
    "mode_sensitivity": 0.25,
}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("components", [2, 3])
def test_both_agree(name, components):
    traction = np.random.default_rng(5).normal(size=(200, components))
    run, check = law_class(name).of_keys(lambda key, *others: SECTION[key]), law_of({"criterion": name, **SECTION})
    np.testing.assert_allclose(run.share(traction), check.utilisation(traction), rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(run.mode_angle(traction), check.mode(traction), rtol=1e-13, atol=1e-15)
    assert run.has_toughness == check.has_toughness
    breaks = dict(zip(run.break_names, run.breaks(traction)[0], strict=False))
    assert breaks == pytest.approx(check.breaks(traction[:1]), rel=1e-13)


@pytest.mark.parametrize("name", LAWS)
def test_shares_are_homogeneous_and_convex(name):
    law = law_class(name).of_keys(lambda key, *others: SECTION[key])
    a, b = np.random.default_rng(1).normal(size=(2, 2000, 3))
    np.testing.assert_allclose(law.share(3.0 * a), 3.0 * law.share(a), rtol=1e-13)
    middle = law.share((a + b) / 2)
    assert (middle <= (law.share(a) + law.share(b)) / 2 * (1 + 1e-12)).all()
