"""Loads by name: what they are in full, what is free of stress, and that tables and strains are read alike."""

import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.base_case import fibre
from unit.case.documents import documents, loads
from unit.case.faulty_bonding import of_type
from unit.case.valid_cases import VALID_CASES, in_space

from feti_homog.case.cases import Case
from feti_homog.case.load_sections import MixedLoad, completed
from feti_homog.materials.voigt import STRAINS

PLANE = (("E11", "S11"), ("E22", "S22"), ("gamma12", "S12"))
SPACE = (*PLANE[:2], ("E33", "S33"), ("gamma23", "S23"), ("gamma13", "S13"), PLANE[2])


def parsed(content: str) -> Case:
    return Case.parse(tomllib.loads(content))


def path(waypoints: str, plane: str = "strain") -> Case:
    case = of_type("path", f"[path]\nwaypoints = {waypoints}")
    return parsed(in_space(case) if plane == "generalized" else case.replace('"strain"', f'"{plane}"'))


def last_named(waypoints: list[MixedLoad], names: tuple[str, ...], default: tuple[str, float]) -> tuple[str, float]:
    """Return the name that waypoints give last, and its value: searched from the end."""
    found = [(name, each.named[name]) for each in reversed(waypoints) for name in names if name in each.named]
    return found[0] if found else default


@pytest.mark.parametrize("plane", ["strain", "stress", "generalized"])
@settings(deadline=None, derandomize=True, max_examples=60)
@given(data=st.data())
def test_every_component_is_as_it_was_named_last(plane, data):
    drawn = data.draw(st.lists(loads(plane, expand=True), max_size=5))
    waypoints = [MixedLoad(**each) for each in drawn]
    full = completed(waypoints, plane)
    assert len(full) == len(waypoints)
    for k, found in enumerate(full):
        so_far = waypoints[: k + 1]
        expected = [last_named(so_far, pair, (pair[1], 0.0)) for pair in (SPACE if plane == "generalized" else PLANE)]
        if plane == "generalized":
            expected.append(last_named(so_far, ("temperature",), ("temperature", 0.0)))
        assert list(found.items()) == expected


def test_cooling_comes_first_and_stays():
    cooled, loaded = path("[{temperature = -100}, {gamma13 = 0.1}]", "generalized").targets
    assert list(cooled.items()) == [*((stress, 0.0) for _, stress in SPACE), ("temperature", -100.0)]
    assert loaded == {name: value for name, value in cooled.items() if name != "S13"} | {"gamma13": 0.1}
    assert list(loaded) == ["S11", "S22", "S33", "S23", "gamma13", "S12", "temperature"]


@settings(deadline=None, derandomize=True, max_examples=40)
@given(documents())
def test_targets_name_each_component_once(document):
    case = Case.parse(document)
    spatial = case.analysis.plane == "generalized"
    for full in case.targets:
        names = [*full]
        assert names.pop() == "temperature" if spatial else len(names) == 3
        assert all(name in pair for name, pair in zip(names, SPACE if spatial else PLANE, strict=True))
    assert bool(case.targets) == (case.analysis.type in ("path", "load"))
    assert Case.parse(case.resolved()).targets == case.targets


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_a_strain_is_a_table_of_its_components(plane):
    by_table = path("[{E11 = 0.1, E22 = 0.0, gamma12 = -0.2}, {E11 = 0.0, gamma12 = 0.0}]", plane)
    by_strain = path("[[0.1, 0.0, -0.2], [0.0, 0.0, 0.0]]", plane)
    assert by_table.targets == by_strain.targets == (
        dict(zip(STRAINS, (0.1, 0.0, -0.2), strict=True)),
        dict.fromkeys(STRAINS, 0.0),
    )  # fmt: skip
    assert by_table.remarks() == by_strain.remarks() == ()


def test_what_is_free_of_stress_is_reported():
    assert path("[{S11 = 60}]").remarks() == ("[path] S22, S12: never named: stress-free",)
    assert path("[{S11 = 60}, {gamma12 = 0.1}, {S12 = 0, E11 = 0}, [0, 0, 1]]").remarks() == (
        "[path] S12: stress-free before the leg to waypoints[1]",
        "[path] S22: stress-free before the leg to waypoints[3]",
    )
    assert path("[{temperature = -100}, {S33 = 1}]", "generalized").remarks() == (
        "[path] S33: stress-free before the leg to waypoints[1]",
        "[path] S11, S22, S23, S13, S12: never named: stress-free",
        "[path] S33 is stress along the fibres; across them S11, S22",
    )
    assert parsed(VALID_CASES["load on a sheet"]).remarks() == ("[load] S11, S22: never named: stress-free",)
    assert parsed(VALID_CASES["load"]).remarks() == parsed(VALID_CASES["base"]).remarks() == ()


def test_names_that_a_ply_has_the_other_way_are_reported_in_one_line():
    """S13 and S22 have the same way in both axes; a plane has no axis along the fibres."""
    line = "S12 is shear across the fibres; along them S13, S23"
    loads = "[{E11 = 0.1, S12 = 1, S33 = 0}, {S13 = 1, S22 = 1}]"
    of_strain = "E11 is strain across the fibres; along them E33"
    assert path(loads, "generalized").remarks()[-1] == f"[path] {of_strain}. {line}"
    assert parsed(VALID_CASES["envelope"]).remarks() == ()
    envelope = Case.parse(tomllib.loads(VALID_CASES["envelope"].replace('"strain"', '"generalized"')))
    assert envelope.remarks() == (f"[envelope] {line}",)
    phase = "E1 = 9.0\nE2 = 5.0\nE3 = 5.0\nnu12 = 0.3\nnu13 = 0.3\nnu23 = 0.3\nG12 = 2.0\nG13 = 2.0\nG23 = 2.0\n"
    of_phase = "[material.fibre] E1 and E2 are across the fibres; along them E3"
    assert parsed(fibre(phase, "generalized")).remarks()[1:] == (of_phase,)  # after the moduli, softer than the matrix


def test_round_trip_keeps_tables_and_strains():
    case = path("[{S11 = 60}, [1, 0, 0], {gamma12 = 1}]")
    assert case.resolved()["path"]["waypoints"] == [{"S11": 60.0}, [1.0, 0.0, 0.0], {"gamma12": 1.0}]
    assert Case.parse(case.resolved()) == case
