"""Paths with legs of temperature: the landmarks look at the leg that carries load; noise of the solve is no load."""

from typing import Any

import numpy as np
import pytest

from feti_homog.materials import voigt
from feti_homog.report.text.path_table import path_table
from feti_homog.results import path_curves
from feti_homog.results.landmarks import marks, passed_strengths, peak_of
from feti_homog.studies.outputs import outputs

ENERGIES = {
    "work": 0.1,
    "stored": 0.1,
    "stored_in_springs": 0.0,
    "dissipated": 0.0,
    "dissipated_strain_controlled": 0.0,
}
COUNTS = {"bonded": 1, "open": 0, "closed": 0, "debonded_share": 0.0}
NOISE = 3e-14


def path(waypoints: list[dict[str, float]], rows: list[tuple[Any, ...]], unit: float = 1.0) -> dict[str, Any]:
    """Return a path in generalized plane strain.

    `rows` have load factor, temperature, strains and stresses by name, and the number of bonds that break; stresses
    and moduli have the factor `unit`, and all other stresses are noise.
    """
    points = []
    for load, temperature, values, broke in rows:
        strain, stress = np.zeros(6), NOISE * np.array([1.0, -1.0, 2.0, 0.5, -3.0, 1.0])
        for name, value in values.items():
            for names, components in ((voigt.SPATIAL_STRAINS, strain), (voigt.SPATIAL_STRESSES, stress)):
                if name in names:
                    components[names.index(name)] = value
        point = {"load_factor": load, "strain": strain.tolist(), "stress": (unit * stress).tolist(), "broke": broke}
        points.append(point | {"temperature": temperature} | ENERGIES | COUNTS)
    section = {"method": "events"} | ({"waypoints": waypoints} if len(waypoints) > 1 else {"to": waypoints[0]})
    material = {"matrix": {"young": 3000.0 * unit, "poisson": 0.3}, "fibre": {"E_axial": 70000.0 * unit}}
    case = {"analysis": {"plane": "generalized"}, "path": section, "material": material}
    return {"case": case, "path": points}


def text(document: dict[str, Any]) -> str:
    return " ".join(" ".join(path_table(document).lines).split())


HEATED = [(0.25, 40.0, {"E11": 0.002, "E33": 0.001}, 1), (0.2, 32.0, {"E11": 0.0025, "E33": 0.0008}, 1)]
TENSION = [(0.5, 80.0, {"E11": 0.004, "E33": 0.002}, 0), (0.6, 80.0, {"E11": 0.005, "S11": 0.4}, 1),
           (0.7, 80.0, {"E11": 0.006, "S11": 0.1}, 1), (1.0, 80.0, {"E11": 0.02, "S11": 16.0}, 0)]  # fmt: skip


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e9])
def test_without_stress_there_is_no_peak_but_a_temperature_of_the_first_break(unit: float) -> None:
    rows = [(2 * load, *rest) for load, *rest in HEATED] + [(1.0, 80.0, {"E11": 0.005, "E33": 0.003}, 0)]
    document = path([{"temperature": 80.0}], rows, unit)
    assert not path_curves.stresses(document).any() and path_curves.shown_components(document) == ["E11", "E33"]
    peak = peak_of(document)
    assert not {"event", "stress", "so_far"} & peak.keys() and peak["first_break_event"] == 0
    assert marks(document) == {0: "first break", 2: "end"}
    words = text(document)
    assert "No stress acts on the path, and there is no peak; first break at temperature = 40 (event 0)" in words
    assert "event temperature E11 E33 load" in words and "S11" not in words
    phase = {"phase": "epoxy", "utilisation": [0.5, 0.8, 1.3]}
    (line,) = passed_strengths(document | {"phase_stresses": [phase]}, peak, range(3))
    assert line.endswith("reaches 1 at about temperature = 51.2; the path takes the phase as elastic beyond")


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e9])
def test_the_leg_that_carries_load_has_the_peak(unit: float) -> None:
    """Bonds broke before it, so that its early fall is no peak."""
    document = path([{"temperature": 80.0}, {"E11": 0.02}], HEATED + TENSION, unit)
    peak = peak_of(document)
    assert (peak["stress_name"], peak["event"], peak["first_break_event"]) == ("S11", 5, 0)
    assert peak["stress"] == pytest.approx(16.0 * unit) and peak["first_break_stress"] == 0.0
    words = text(document)
    assert "S11 at the end of leg 2, no peak yet: " in words
    assert "first break at temperature = 40 (event 0)" in words and "falls" not in words


def test_a_temperature_leg_under_stress_names_its_largest_stress() -> None:
    """Strains are held; the shear strain alone is free, and has no stress."""
    held = {"temperature": 80.0, "E11": 0.0, "E22": 0.0, "E33": 0.0}
    rows = [(0.5, 40.0, {"S11": -20.0, "S22": -20.0, "S33": -21.0, "gamma12": 7e-6}, 1),
            (1.0, 80.0, {"S11": -40.0, "S22": -40.0, "S33": -42.0, "gamma12": 1.4e-5}, 0)]  # fmt: skip
    words = text(path([held], rows))
    assert "S33 at the end of the path, no peak yet: -42 at temperature = 80 (event 1)" in words
    assert "; first break -21 at temperature = 40 (event 0)" in words and "event temperature S11 S22 S33" in words
    # A later leg with a strain leaves the axis, which the strain held at zero cannot be.
    document = path([held, {"E11": 0.001}], [(0.25, *rows[0][1:]), (0.5, *rows[1][1:]), (1.0, 80.0, {"E11": 1e-3}, 0)])
    assert path_curves.abscissa(document)[0] == "temperature"


def test_the_component_of_the_leg_where_damage_begins_leads() -> None:
    """An earlier leg has a larger strain, and compression before counts for no peak."""
    legs = [{"E11": -0.02}, {"E11": 0.0}, {"gamma12": 0.03}, {"E11": 0.02}]
    rows = [(0.25, 0.0, {"E11": -0.02, "S11": -90.0}, 0), (0.5, 0.0, {}, 0),
            (0.75, 0.0, {"gamma12": 0.03, "S12": 60.0}, 0),
            (0.85, 0.0, {"E11": 0.005, "S11": 30.0, "gamma12": 0.03, "S12": 60.0}, 1),
            (0.9, 0.0, {"E11": 0.006, "S11": 20.0, "gamma12": 0.03, "S12": 50.0}, 1),
            (1.0, 0.0, {"E11": 0.02, "S11": 28.0, "gamma12": 0.03, "S12": 40.0}, 0)]  # fmt: skip
    document = path(legs, rows)
    # The stress drops to 20 just after each break: the work up to the next point is that of the mean stress.
    document["path"][4]["work"], document["path"][5]["work"] = 0.1 + 20.0 * 0.001, 0.12 + 24.0 * 0.014
    words = text(document)
    assert "Peak S11: 30 at E11 = 0.005 (event 3); first break 30 at 0.005 (event 3); then falls by 33.3%" in words
    assert "Largest S12 of leg 3: 60 at gamma12 = 0.03 (point 2)" in words


def test_the_peak_under_a_prescribed_stress_is_one_of_all_equilibria() -> None:
    """A prescribed strain drops to the next branch, whose stress rises."""
    rows = [(0.2, 0.0, {"E11": 0.004, "S11": 18.0}, 1), (0.1, 0.0, {"E11": 0.003, "S11": 9.0}, 1),
            (1.0, 0.0, {"E11": 0.07, "S11": 90.0}, 1)]  # fmt: skip
    words = text(path([{"S11": 90.0}], rows))
    assert "Peak S11: 18 at E11 = 0.004 (event 0)" in words
    assert "; then falls by 50.0% to 9 along all equilibria (event 1); later 90 (event 2)" in words
    rows[1] = (0.1, 0.0, {"E11": 0.002, "S11": 9.0}, 1)
    assert "no peak yet: 90 at E11 = 0.07 (event 2)" in text(path([{"E11": 0.07}], rows))


def test_paths_scale_with_the_toughness_if_all_loads_grow_together() -> None:
    document = path([{"temperature": 80.0}, {"E11": 0.02}], HEATED + TENSION)
    document["case"]["interface"] = {"criterion": "energy", "toughness": 0.01}
    assert path_curves.scales_with_toughness(document) and "Scaling" not in text(document)
    document["case"]["path"] = {"method": "events", "to": {"temperature": 80.0, "E11": 0.02}}
    assert "Scaling: strains and stresses of the path grow with the root of the toughness" in text(document)


def test_tables_of_studies_have_the_temperature_at_onset_and_the_peak_of_the_loaded_leg() -> None:
    document = path([{"temperature": 80.0}, {"E11": 0.02}], HEATED + TENSION)
    solver = dict.fromkeys(("ranks", "subdomains", "dofs", "multipliers"), 1) | {"iterations": [0]}
    cell = {"fibre_fraction": 0.4, "elements": 1, "nodes": 1}
    document |= {"solver": solver, "cell": cell, "checks": {}, "timings": {}, "memory": 1}
    values = outputs(document)
    assert (values["onset_temperature"], values["peak_S11"], values["peak_E11"]) == (40.0, 16.0, 0.02)
    assert values["onset_S11"] == values["peak_S22"] == 0.0
    for point in document["path"]:
        point["stress"] = [NOISE] * 6
    assert not {name for name in outputs(document) if name.startswith("peak_")}


def test_compression_and_prescribed_stresses_are_no_landmarks_of_later_legs():
    """Tension breaks a bond, a leg without breaks compresses more, and a leg ends at a prescribed S22."""
    rows = [(0.2, 0.0, {"E11": 0.01, "S11": 30.0}, 1), (1 / 3, 0.0, {"E11": 0.02, "S11": 20.0}, 0),
            (2 / 3, 0.0, {"E11": -0.02, "S11": -90.0}, 0),
            (1.0, 0.0, {"E11": -0.02, "S11": -90.0, "E22": -0.05, "S22": -50.0}, 0)]  # fmt: skip
    words = text(path([{"E11": 0.02}, {"E11": -0.02}, {"E11": -0.02, "S22": -50.0}], rows))
    assert "Peak S11: 30 at E11 = 0.01" in words and "later" not in words and "of leg 3" not in words


def test_a_waypoint_on_a_straight_leg_changes_no_peak():
    """A bar with the stiffness 1000, which breaks at 30 to 600, at 24 to 500; the state behind a break is no point."""
    states = [(0.03, 1000.0, 1), (0.04, 600.0, 1), (0.06, 500.0, 0)]
    found = []
    for corners in ([0.06], [0.01, 0.06]):
        rows, work, last = [], 0.0, (0.0, 1000.0)
        for strain, stiffness, broke in [(0.01, 1000.0, 0)] * (len(corners) - 1) + states:
            work += 0.5 * stiffness * (strain**2 - last[0] ** 2)
            leg = next(k for k, corner in enumerate(corners) if strain <= corner)
            start = corners[leg - 1] if leg else 0.0
            load = (leg + (strain - start) / (corners[leg] - start)) / len(corners)
            rows.append((load, 0.0, {"E11": strain, "S11": stiffness * strain}, broke, work))
            last = strain, stiffness
        document = path([{"E11": corner} for corner in corners], [row[:4] for row in rows])
        for point, row in zip(document["path"], rows, strict=True):
            point["work"] = row[4]
        peak = peak_of(document)
        found.append((peak["stress"], peak["stress_left"], peak["event_left"] - len(corners)))
    assert found[0] == pytest.approx((30.0, 18.0, 0)) and found[1] == pytest.approx(found[0])


def test_the_first_point_of_a_plateau_has_its_largest_stress():
    """Rounding decides which of two equal stresses is larger."""
    for more in (-1e-15, 0.0, 1e-15):
        rows = [(0.5, 0.0, {"E11": 0.01, "S11": 30.0}, 1), (1.0, 0.0, {"E11": 0.02, "S11": 30.0 * (1.0 + more)}, 0)]
        document = path([{"E11": 0.02}], rows)
        document["path"][1]["work"] = 0.4
        assert peak_of(document)["event"] == 0
