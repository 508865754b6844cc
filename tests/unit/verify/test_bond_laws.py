"""Laws of bonds stand on both floors: in runs, and by formulas of their own in the checks of results."""

import numpy as np
import pytest

from feti_homog.case.bond_laws import LAWS
from feti_homog.interface.contact.states import BondState
from feti_homog.interface.laws.bond_law import law_class
from feti_homog.verify.bonds import law_of

SECTION = {
    "normal_stiffness": 5.0,
    "tangential_stiffness": 2.0,
    "axial_stiffness": 1.0,
    "normal_strength": 2.0,
    "tangential_strength": 1.5,
    "axial_strength": 3.0,
    "toughness": 0.4,
    "mode_sensitivity": 0.25,
    "normal_toughness": 0.9,
    "tangential_toughness": 1.3,
    "mixing_exponent": 1.7,
    "teeth": None,
    "softening_tolerance": 0.1,
    "openings": [0.4, 0.5, 0.8],
    "tractions": [2.0, 0.7, 0.0],
}


class Values:
    """The keys of one section."""

    def __call__(self, key, *others):
        return SECTION[key]

    def everywhere(self, key, *others):
        return np.array([SECTION[key]])

    def common(self, key):
        return SECTION[key]


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("components", [2, 3])
def test_both_agree(name, components):
    traction = np.random.default_rng(5).normal(size=(200, components))
    run, check = law_class(name).of_keys(Values()), law_of({"criterion": name, **SECTION})
    np.testing.assert_allclose(run.share(traction), check.utilisation(traction), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(run.mode_angle(traction), check.mode(traction), rtol=1e-13, atol=1e-15)
    assert run.has_toughness == check.has_toughness
    onset = run.onset()
    np.testing.assert_allclose(onset.share(traction), check.onset(traction), rtol=1e-12, atol=1e-15)
    breaks = dict(zip(onset.break_names, onset.breaks(traction)[0], strict=False))
    assert breaks == pytest.approx(check.breaks(traction[:1]), rel=1e-13)


@pytest.mark.parametrize("name", [name for name, law in LAWS.items() if law.softens])
@pytest.mark.parametrize("components", [2, 3])
def test_both_agree_on_damaged_bonds(name, components):
    run, check = law_class(name).of_keys(Values()), law_of({"criterion": name, **SECTION})
    np.testing.assert_allclose(run.levels, check.levels, rtol=1e-13)
    rng, k = np.random.default_rng(5), 200
    traction, teeth = rng.normal(size=(k, components)), len(run.levels) - 1
    bonds = BondState(np.zeros(k, np.int8), rng.integers(0, teeth, (k, 1)).astype(float), np.zeros(k, bool))
    damage = run.damage(bonds)
    check = law_of({"criterion": name, **SECTION, "damage": damage})
    np.testing.assert_allclose(run.in_state(None, bonds).share(traction), check.utilisation(traction), rtol=1e-10)
    stiffness = np.array([SECTION[f"{each}_stiffness"] for each in ("normal", "tangential", "axial")])[:components]
    jumps = run.softening(bonds, traction[:, 0] > 0)[:, :components] * traction / stiffness
    np.testing.assert_allclose(jumps, check.jumps(traction), rtol=1e-12)
    every = np.ones(k, bool)
    history, _ = run.after(bonds, every, traction)
    after = run.damage(BondState(bonds.status, history, bonds.pressed))
    taken = check.absorbed(check.mode(traction), damage, after)
    np.testing.assert_allclose(run.fracture(bonds, every, traction), taken, rtol=1e-10)
    low, high = check.absorbed_range(damage, after)
    assert ((low <= taken) & (taken <= high)).all()


@pytest.mark.parametrize("name", LAWS)
def test_shares_are_homogeneous_and_convex(name):
    law = law_class(name).of_keys(Values())
    a, b = np.random.default_rng(1).normal(size=(2, 2000, 3))
    np.testing.assert_allclose(law.share(3.0 * a), 3.0 * law.share(a), rtol=1e-13)
    middle = law.share((a + b) / 2)
    if not law.is_convex:
        return
    assert (middle <= (law.share(a) + law.share(b)) / 2 * (1 + 1e-12)).all()
