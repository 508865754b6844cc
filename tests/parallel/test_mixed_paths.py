"""Paths of strains and stresses, proportional and of several legs, against brute force on the condensed cell."""

import numpy as np
import pytest
from support.loaded_twins import EPOXY_GLASS, LoadedTwin, compare_paths, relative, solved

from feti_homog.errors import ConvergenceError

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

EXACT = 1e-9
SQUARE, HEXAGONAL, CURVED = {}, {"geometry": "hexagonal"}, {"order": 2, "mesh_size": 0.3}
THREE = {"geometry": "random", "fibres": 3, "min_gap": 0.1, "seed": 4}
STRENGTH = {"normal_strength": 0.03, "tangential_strength": 0.04}
QUADRATIC = STRENGTH | {"criterion": "quadratic"}
SPRINGS = {"normal_stiffness": 100.0, "tangential_stiffness": 30.0}
ENERGY = SPRINGS | {"criterion": "energy", "toughness": 1e-5}
INFLUENCE = {"feti_pc_type": "influence"}

PROPORTIONAL = {
    "uniaxial, strain": ("strain", THREE, STRENGTH, {"E11": 0.02, "S22": 0.0, "S12": 0.0}),
    "uniaxial, stress": ("stress", SQUARE, QUADRATIC, {"S22": 0.07}),
    "stresses": ("stress", CURVED, STRENGTH, {"S11": 0.05, "S22": -0.08, "S12": -0.03}),
    "overlapping": ("strain", SQUARE, QUADRATIC | {"contact": False}, {"E11": 0.02, "S22": -0.05}),
    "strength of springs": ("strain", HEXAGONAL, STRENGTH | SPRINGS, {"gamma12": 0.03, "S11": -0.02}),
    "energy of springs": ("stress", SQUARE, ENERGY | {"growth": "springs"}, {"E11": 0.03, "S22": -0.02}),
    "released": ("strain", SQUARE, ENERGY, {"E22": 0.03, "S11": -0.02}),
}


@pytest.mark.one_rank
@pytest.mark.parametrize("name", PROPORTIONAL)
def test_proportional_paths_are_those_of_brute_force(comm, name):
    plane, cell, interface, to = PROPORTIONAL[name]
    case = {"cell": cell, "phases": EPOXY_GLASS, "plane": plane, "interface": interface, "path": {"to": to}}
    result, events = compare_paths(comm, **case, petsc=INFLUENCE if "toughness" in interface else None)
    assert len(events) > 5 and len(result.path) == len(events)


LEGS = {
    "unloaded and reversed": ("strain", STRENGTH, [{"S11": 0.03}, {"S11": 0.0}, {"S11": -0.04}, {"S11": 0.035}]),
    "control changes": ("strain", STRENGTH, [{"S11": 0.03}, {"S11": -0.02, "S12": 0.01}, {"E22": 0.02}, {"S11": 0.05}]),
    "energy": ("stress", ENERGY, [{"E11": 0.015}, {"S22": -0.1}, {"S11": 0.0}, {"gamma12": 0.06}]),
}


@pytest.mark.one_rank
@pytest.mark.parametrize("name", LEGS)
def test_later_legs_are_those_of_brute_force(comm, name):
    plane, interface, waypoints = LEGS[name]
    case = {"cell": SQUARE, "phases": EPOXY_GLASS, "plane": plane, "interface": interface}
    petsc = INFLUENCE if "toughness" in interface else None
    result, events = compare_paths(comm, **case, petsc=petsc, path={"waypoints": waypoints})
    later = [e for e in events if e.load_factor > 1 / len(waypoints)]
    # Bonds break and faces touch on the way.
    assert sum(e.broke.sum() for e in later) > 1 and len(result.path) > len(events)
    assert any(p.closed for p in result.path)


@pytest.mark.parametrize(("plane", "to"), [("strain", {"E11": 0.02}), ("stress", {"S11": 0.06})])
def test_no_other_stress_acts_in_a_uniaxial_test(comm, plane, to):
    case = {"cell": HEXAGONAL, "phases": EPOXY_GLASS, "plane": plane, "interface": STRENGTH}
    path = solved(comm, **case, path={"to": to}).path
    stress = np.array([p.stress for p in path])
    assert sum(p.broke for p in path) > 8 and max(p.closed for p in path) > 2
    assert np.abs(stress[:, 1:]).max() < EXACT * np.abs(stress[:, 0]).min()


@pytest.mark.parametrize("plane", ["strain", "generalized"])
def test_bonds_break_first_at_the_same_state_however_it_is_controlled(comm, plane):
    case = {"cell": SQUARE, "phases": EPOXY_GLASS, "plane": plane, "interface": STRENGTH}
    first = solved(comm, **case, path={"to": {"S11": 0.1, "E22": 0.001, "S12": 0.03}}).path[0]
    assert first.broke
    names = ("11", "22", "33", "23", "13", "12") if plane == "generalized" else ("11", "22", "12")
    for letter, values in (("S", first.stress), ("E", first.strain)):
        to = {name_of(letter, pair): 2.0 * float(value) for pair, value in zip(names, values, strict=True)}
        other = solved(comm, **case, path={"to": to}).path[0]
        assert (other.broke, other.load_factor) == (first.broke, pytest.approx(0.5, rel=EXACT))
        assert relative(other.strain, first.strain) < EXACT and relative(other.stress, first.stress) < EXACT
        assert relative(other.debonded_length, first.debonded_length) == 0


def name_of(letter, pair):
    """E11, gamma12, S12, ..."""
    return ("gamma" if letter == "E" and pair[0] != pair[1] else letter) + pair


@pytest.mark.parametrize("plane", ["strain", "generalized"])
def test_a_laminate_parts_at_its_strength_and_bears_nothing_then(comm, strip, plane):
    case = {"cell": {"geometry": "mesh", "file": "strip.msh"}, "phases": EPOXY_GLASS, "plane": plane}
    first, last = solved(comm, strip, **case, interface=STRENGTH, path={"to": {"E11": 0.1}}).path
    assert first.stress[0] == pytest.approx(STRENGTH["normal_strength"], rel=EXACT) and first.open == 0
    assert last.load_factor == 1.0 and last.open == first.broke
    assert np.abs(last.stress).max() < EXACT * first.stress[0]
    # All that was stored is lost.
    assert last.dissipated == pytest.approx(first.stored, rel=EXACT)


def test_stresses_that_nothing_carries_any_more_are_reported(comm, strip):
    case = {"cell": {"geometry": "mesh", "file": "strip.msh"}, "phases": EPOXY_GLASS, "plane": "strain"}
    with pytest.raises(ConvergenceError, match="carries"):
        solved(comm, strip, **case, interface=STRENGTH, path={"to": {"S11": 0.1}})


@pytest.mark.one_rank
@pytest.mark.parametrize("worst_only", [True, False])
def test_increments_are_those_of_brute_force(comm, worst_only):
    waypoints = [{"temperature": -60.0}, {"S11": 0.03}, {"gamma13": 0.02, "E11": 0.0}]
    case = {"cell": HEXAGONAL, "phases": EPOXY_GLASS, "plane": "generalized", "interface": QUADRATIC}
    release = "worst" if worst_only else "all"
    way = {"waypoints": waypoints, "method": "increments", "increments": 12, "release": release}
    twin, path = LoadedTwin(comm, **case, path=way), solved(comm, **case, path=way).path
    expected = twin.increments(12, worst_only)
    assert [p.broke for p in path] == [broke for _, broke, _ in expected] and sum(p.broke for p in path) > 4
    for name, values in (
        ("stress", [s.stress[:6] for s, _, _ in expected]),
        ("stored", [s.stored for s, _, _ in expected]),
    ):
        assert relative([getattr(p, name) for p in path], values) < 1e-8
    assert relative([p.dissipated for p in path], [lost for _, _, lost in expected]) < 1e-8
    assert relative([p.work for p in path], [s.stored + lost for s, _, lost in expected]) < 1e-8
