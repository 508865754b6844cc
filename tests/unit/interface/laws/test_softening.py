"""Cohesive laws bond by bond: published numbers, exact energies of teeth, closed forms of the branches."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

from feti_homog.case.interface_section import InterfaceSection
from feti_homog.errors import CaseError
from feti_homog.interface.contact.states import BondState
from feti_homog.interface.laws import law_of_sections
from feti_homog.interface.laws.energy import SpringEnergy
from feti_homog.interface.laws.softening import BilinearLaw, ExponentialLaw, TableLaw

# MOOSE's tests of the law of Camanho and Davila: REFERENCES 4.
MOOSE = {
    "normal_stiffness": 100.0,
    "tangential_stiffness": 100.0,
    "normal_strength": 1.0,
    "tangential_strength": 1.0,
    "normal_toughness": 1.0,
    "tangential_toughness": 2.0,
    "mixing_exponent": 2.0,
}
STEEP = MOOSE | {
    "normal_stiffness": 1000.0,
    "tangential_stiffness": 1000.0,
    "normal_strength": 50.0,
    "tangential_strength": 50.0,
    "normal_toughness": 5.0,
}
BRANCH = {"openings": (0.01, 0.5, 2.0), "tractions": (1.0, 0.4, 0.0)}
LAWS = {"bilinear": BilinearLaw, "exponential": ExponentialLaw, "table": TableLaw}


def made(name, teeth, keys=MOOSE, tolerance=0.02):
    """Return a law of one bond."""
    keys = keys | (BRANCH if name == "table" else {}) | {"teeth": teeth, "softening_tolerance": tolerance}

    def value(key, *others):
        return next(keys[each] for each in (key, *others) if each in keys)

    def everywhere(*names):
        return np.array([value(*names)])

    call = type("Values", (SimpleNamespace,), {"__call__": lambda self, *names: value(*names)})
    return LAWS[name].of_keys(call(everywhere=everywhere, common=keys.get))


def teeth(law, direction):
    """Yield damage, effective opening, traction and energy of each tooth of a bond under a rising traction."""
    stiffness = law.normal_stiffness
    bonds = BondState(np.zeros(1, np.int8), law.begin(1), np.zeros(1, bool))
    parts = np.array([False])
    while not parts[0]:
        traction = np.array([direction], float)
        traction /= law.in_state(None, bonds).share(traction)[0]
        d, which = law.damage(bonds)[0], np.array([True])
        pulled = np.array([max(traction[0, 0], 0.0), *traction[0, 1:]])
        yield d, np.linalg.norm(pulled) / (1 - d) / stiffness, traction[0], law.fracture(bonds, which, traction)[0]
        history, parts = law.after(bonds, which, traction)
        bonds = BondState(bonds.status, history, bonds.pressed)


@pytest.mark.parametrize("count", [1, 2, 7, 61])
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize(("direction", "energy"), [((1, 1), 1.25), ((0, 1), 2.0), ((-3, 1), 2.0), ((1, 0), 1.0)])
def test_teeth_take_the_energy_of_the_law(name, count, direction, energy):
    of_mode = {"table": {(1, 1): 0.986, (1, 0): 0.648}}.get(name, {})
    keys = MOOSE | ({"normal_toughness": 0.648} if name == "table" else {})
    taken = [own for *_, own in teeth(made(name, count, keys), direction)]
    assert len(taken) == count
    assert sum(taken) == pytest.approx(of_mode.get(direction, energy), rel=1e-12)


@pytest.mark.parametrize(
    ("keys", "direction", "peak", "end"),
    [(MOOSE, (1, 1), 1.0, 2.5), (MOOSE, (0, 1), 1.0, 4.0), (STEEP, (1, 1), 50.0, 0.1202082 * np.sqrt(2))],
)
def test_the_numbers_of_moose(keys, direction, peak, end):
    """The law lies between the first and the last tooth by half a tooth."""
    law = made("bilinear", 500, keys)
    first, *_, last = teeth(law, direction)
    start = peak / keys["normal_stiffness"]
    assert np.linalg.norm(first[2]) == pytest.approx(peak, rel=0.01)
    assert last[1] == pytest.approx(end * (end / start) ** (-0.5 / 500), rel=0.01)


@pytest.mark.parametrize("name", LAWS)
def test_teeth_lie_about_the_law(name):
    """In opening: the traction at a tooth is above the branch, and after it below; the first is within tolerance."""
    keys = MOOSE | ({"normal_toughness": 0.648} if name == "table" else {})
    law = made(name, None, keys)
    found = list(teeth(law, (1, 0)))
    assert found[0][2][0] == pytest.approx(1.0, abs=0.02) and found[0][2][0] > 1.0
    # The default looks at the mode with the longest branch.
    assert next(teeth(law, (0, 1)))[2][1] < 1.02 < next(teeth(made(name, len(found) - 1, keys), (0, 1)))[2][1]
    branches = {
        "bilinear": lambda x: np.interp(x, [0.01, 2.0], [1.0, 0.0]),
        "exponential": lambda x: np.exp(-(x - 0.01) / 0.995),
        "table": lambda x: np.interp(x, BRANCH["openings"], BRANCH["tractions"]),
    }
    branch = branches[name]
    area, _ = quad(branch, 0.01, 40.0, limit=200)
    assert area + 0.005 == pytest.approx(keys["normal_toughness"], rel=1e-6)
    damages = [d for d, *_ in found] + [1.0]
    for (_, opening, traction, _), after in zip(found[:-1], damages[1:], strict=False):
        assert (1 - after) * 100.0 * opening < branch(opening) < traction[0]


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, 1.0), (-1.0, 1.0)])
def test_one_tooth_is_the_energy_criterion_in_pure_modes(direction):
    traction = np.array([direction])
    shear = 1.0 - np.arctan(1.0) / (np.pi / 2)  # tan^2((1 - lambda) pi/2) = 1: twice the toughness in shear
    assert made("bilinear", 1).share(traction) == pytest.approx(
        SpringEnergy(100.0, 100.0, 1.0, shear).share(traction), rel=1e-12
    )


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, 1.0)])
def test_the_least_toughness_is_a_brittle_bond(direction):
    least = {"normal_toughness": 1.0 / 200.0, "tangential_toughness": 1.0 / 200.0}
    found = list(teeth(made("bilinear", 3, MOOSE | least), direction))
    # All teeth break at the opening at which the first does.
    assert [opening for _, opening, *_ in found] == pytest.approx(3 * [0.01], rel=1e-12)
    assert np.abs(found[0][2]).max() == pytest.approx(1.0, rel=1e-12)


def test_the_onset_of_damage_is_the_quadratic_criterion():
    law = made("bilinear", 100_000, MOOSE | {"tangential_strength": 1.7, "tangential_stiffness": 60.0})
    traction = np.random.default_rng(3).normal(size=(40, 2))
    np.testing.assert_allclose(law.share(traction), law.onset().share(traction), rtol=1e-4)


def test_levels_of_damage_are_those_of_all_pairs_whatever_the_nodes():
    """As on ranks that own nodes of one pair, or none: the teeth of the pair with the longest branch."""
    given = {key: value for key, value in MOOSE.items() if "toughness" not in key}
    sections = [
        InterfaceSection(criterion="bilinear", normal_toughness=G, tangential_toughness=2 * G, **given)
        for G in (0.01, 1.0)
    ]
    short, long = (law_of_sections([section], np.zeros(1, np.int64)) for section in sections)
    assert len(short.levels) < len(long.levels) and long.levels == made("bilinear", None).levels
    for pair in ([0, 0], [1], [0, 1], []):
        law = law_of_sections(sections, np.array(pair, np.int64))
        assert law.levels == long.levels
        np.testing.assert_array_equal(law.normal_toughness, np.array([0.01, 1.0])[np.array(pair, int)])
    shear = np.array([[0.0, 1.0]])
    assert long.overshoot == pytest.approx(1.0 / long.share(shear)[0] - 1.0) and 0.0 < long.overshoot <= 0.02


@pytest.mark.slow
def test_a_tolerance_that_takes_too_many_teeth_is_refused():
    with pytest.raises(CaseError, match="softening_tolerance = 1e-09: even with 10000 teeth, the first tooth exceeds"):
        made("bilinear", None, tolerance=1e-9)
