"""The certificate's own laws of phases and of bonds are those of the solver: they stand on both floors."""

import numpy as np
import pytest
from support.cases import make_case
from support.verified_results import CARBON as WARM_CARBON
from support.verified_results import FIBRE, MATRIX, TURNED, TURNED_IN_SPACE, WARM

from feti_homog.case.bond_laws import LAWS
from feti_homog.errors import CaseError
from feti_homog.interface.contact.states import BondState
from feti_homog.interface.laws.bond_law import law_class
from feti_homog.materials.laws import expansion, isotropic_ratio, out_of_plane, plane_stiffness, spatial_stiffness
from feti_homog.materials.material_forms import Orthotropic
from feti_homog.verify import constitutive_law
from feti_homog.verify.bonds import law_of
from feti_homog.verify.constitutive_law import laws

GENERAL = {"stiffness": [[10.0, 2.0, 0.5], [2.0, 8.0, 0.1], [0.5, 0.1, 3.0]]}
IN_PLANE = {"E1": 15.0, "E2": 230.0, "nu12": 0.013, "G12": 25.0, "angle": 30.0}
CARBON = {"E_axial": 235.0, "E_transverse": 14.0, "nu_axial": 0.2, "nu_transverse": 0.25}
SHEET = {"E_transverse": 14.0, "nu_transverse": -0.25}
BY_SHEAR = {"E_axial": 235.0, "E_transverse": 14.0, "nu_axial": 0.2, "G_transverse": 5.0}
STIFF = {"E1": 2.0, "E2": 9.0, "E3": 4.0, "nu12": -0.2, "nu13": 0.4, "nu23": 0.3, "G12": 1.0, "angle": -73.0}


IN_SPACE = {
    "stiffness": spatial_stiffness(Orthotropic(**STIFF, G13=2.0, G23=1.5)).tolist()  # turned: 12 is coupled to all
}


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("fibre", [FIBRE, TURNED, STIFF, GENERAL, IN_SPACE, CARBON, BY_SHEAR, IN_PLANE, SHEET])
def test_both_ways_to_the_law_of_a_plane_state_agree(fibre, plane):
    if plane == "strain" and fibre in (IN_PLANE, SHEET):
        pytest.skip("plane strain needs constants out of the plane")
    case = make_case(matrix=MATRIX, fibre=fibre, plane=plane)
    phases = ["matrix", "fibre", "fibre:2"]
    own, _ = laws(case.resolved(), phases)
    rules = constitutive_law.out_of_plane(case.resolved(), phases)
    for stiffness, rule, phase in zip(own, rules, ("matrix", "fibre", "fibre"), strict=True):
        expected = plane_stiffness(case.material_of(phase), plane)
        assert np.abs(stiffness - expected).max() < 1e-13 * np.abs(expected).max()
        np.testing.assert_allclose(rule, out_of_plane(case.material_of(phase), plane), rtol=1e-12, atol=1e-14)


WARM_BY_SHEAR = BY_SHEAR | {"G_axial": 28.0, "expansion": 1e-6}


@pytest.mark.parametrize(
    "fibre", [WARM, TURNED_IN_SPACE, WARM_CARBON, WARM_BY_SHEAR, IN_SPACE | {"expansion": [1e-6, 2e-6, 3e-6]}]
)
def test_both_ways_to_the_law_in_space_agree(fibre):
    case = make_case(matrix=WARM, fibre=fibre, plane="generalized")
    own, free = laws(case.resolved(), ["matrix", "fibre"])
    for stiffness, strain, phase in zip(own, free, ("matrix", "fibre"), strict=True):
        expected = spatial_stiffness(case.material_of(phase))
        assert np.abs(stiffness - expected).max() < 1e-13 * np.abs(expected).max()
        np.testing.assert_allclose(strain, expansion(case.material_of(phase)), rtol=1e-12, atol=1e-20)


def test_phases_without_material_are_reported_and_without_expansion_leave_all_unknown():
    case = {"material": {"matrix": MATRIX, "fibre": WARM_CARBON}, "analysis": {"plane": "generalized"}}
    assert not laws(case, ["matrix", "fibre"])[1].any()
    case = {"material": {"matrix": MATRIX}, "analysis": {"plane": "strain"}}
    with pytest.raises(CaseError, match="no material for the phase fibre"):
        laws(case, ["matrix", "fibre"])


ALIKE = {"E_axial": 3.0, "E_transverse": 3.0, "nu_axial": 0.4999, "nu_transverse": 0.4999}
ALIKE_BY_SHEAR = {name: value for name, value in ALIKE.items() if name != "nu_transverse"}
ORTHOTROPIC = {f"E{k}": 3.0 for k in (1, 2, 3)} | {"nu12": 0.2, "nu13": 0.2, "nu23": 0.2, "G12": 1.25}


@pytest.mark.parametrize(
    ("constants", "ratio"),
    [
        ({"young": 3.0, "poisson": 0.3}, 0.3),
        (ALIKE, 0.4999),
        (ALIKE | {"G_axial": 3.0 / 2 / 1.4999}, 0.4999),
        (ALIKE | {"G_axial": 1.01}, None),
        (ALIKE_BY_SHEAR | {"G_transverse": 3.0 / 2 / 1.4999}, 0.4999),
        (ALIKE_BY_SHEAR | {"G_transverse": 1.01}, None),
        (ALIKE | {"E_axial": 3.0 * (1 + 1e-7)}, None),
        (ALIKE | {"nu_axial": 0.4998}, None),
        (GENERAL, None),
        (ORTHOTROPIC, None),
    ],
)
def test_both_find_who_is_isotropic(constants, ratio):
    case = make_case(matrix=constants, fibre=FIBRE)
    assert isotropic_ratio(case.material_of("matrix")) == (None if ratio is None else pytest.approx(ratio, rel=1e-9))
    own = {"cell": {}, "analysis": {"plane": "strain"}, "material": {"matrix": constants}}
    assert constitutive_law.mixed_phases(own, ["matrix"]).tolist() == [ratio is not None]


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
