"""Later legs of a path are drawn as a bar whose stiffness falls in breaks, and the stack of energies along a path."""

from typing import Any

import numpy as np
import pytest

from feti_homog.report.plots import path_picture
from feti_homog.results import path_curves

ZERO = {"stored_in_springs": 0.0, "dissipated_strain_controlled": 0.0, "bonded": 1, "open": 0, "closed": 0}


def bar(legs: list[dict[str, float]], rows: list[tuple[float, float, float, bool]], expansion: float = 0.0) -> Any:
    """Return a path of bars along x1 with rows of load factor, stiffness, strain or stress, and whether a bond breaks.

    The energies are integrals of the law S = K (E - a T), on the way to each row with its stiffness.
    """
    points, temperature, lost, last = list[dict[str, Any]](), 0.0, 0.0, (rows[0][1], 0.0, 0.0)
    for load, stiffness, value, breaks in rows:
        target = legs[int(np.ceil(load * len(legs) - 1e-9)) - 1]
        by_stress, heats = "S11" in target, "temperature" in target
        heat = value if heats else temperature
        strain = value / stiffness + expansion * heat if by_stress else last[1] if heats else value
        stress, free = stiffness * (strain - expansion * heat), last[1] - expansion * temperature
        behind = last[2] / stiffness if by_stress else free  # elastic strain after the break
        lost += 0.5 * last[0] * free**2 - 0.5 * stiffness * behind**2 + (behind - free) * last[2] * by_stress
        stored = 0.5 * stress * (strain - expansion * heat)
        points.append({"load_factor": load, "strain": [strain, 0.0, 0.0, 0.0, 0.0, 0.0], "temperature": heat} | ZERO)
        points[-1] |= {"stress": [stress, *[0.0] * 5], "stored": stored, "work": stored + lost, "dissipated": lost}
        points[-1]["broke"] = int(breaks)
        last, temperature = (stiffness, strain, stress), heat
    case = {"analysis": {"type": "path", "plane": "generalized"}, "path": {"method": "events", "waypoints": legs}}
    return {"case": case | {"output": {}, "interface": {"contact": True}}, "path": points}


def drawn(document: dict[str, Any]) -> tuple[Any, Any]:
    """Return the corners of the later legs in path.png, and the work curve in energy.png."""
    upper, energy = path_picture.figure(document).axes[0], path_picture.energies(document)
    assert energy is not None
    later = next(line for line in upper.lines if line.get_linewidth() == 2.0 and len(line.get_xdata()))
    return later.get_xydata(), energy.axes[0].lines[0].get_xydata()


def test_a_brittle_bond_drops_the_stress_at_its_strain() -> None:
    """As the strain rises on: no stress, no more work, and all energy lost in the break at 3/5 of the path."""
    document = bar(
        [{"E11": 5.0}, {"E11": 30.0}], [(0.5, 1.0, 5.0, False), (0.6, 1.0, 10.0, True), (1.0, 0.0, 30.0, False)]
    )
    curve, work = drawn(document)
    np.testing.assert_allclose(curve, [[5, 5], [10, 10], [10, 0], [30, 0]], atol=1e-12)
    for place, value in ((0.5, 3.125), (1.0, 12.5), (1.1, 28.125), (1.2, 50.0), (1.21, 50.0), (1.6, 50.0), (2.0, 50.0)):
        assert np.interp(place, *work.T) == pytest.approx(value)
    nodes = [line for line in path_picture.figure(document).axes[-1].lines if len(line.get_xdata()) == 3]
    assert {line.get_drawstyle() for line in nodes} == {"steps-pre"}


def test_a_stiffness_left_and_unloading_are_straight_from_the_state_behind_the_break() -> None:
    rows = [
        (0.25, 4.0, 0.5, False),
        (0.4, 4.0, 2.0, True),
        (0.5, 1.0, 3.0, True),
        (0.75, 0.5, 1.0, False),
        (1.0, 0.5, 6.0, False),
    ]
    curve, work = drawn(bar([{"E11": 0.5}, {"E11": 3.0}, {"E11": 1.0}, {"E11": 6.0}], rows))
    np.testing.assert_allclose(curve, [[0.5, 2], [2, 8], [2, 2], [3, 3], [3, 1.5], [1, 0.5], [6, 3]])
    # The integral of the drawn stress is the drawn work.
    area = np.sum(np.diff(curve[:, 0]) * (curve[1:, 1] + curve[:-1, 1]) / 2)
    assert work[-1, 1] == pytest.approx(0.5 + area)
    assert np.interp(2.5, *work.T) == pytest.approx(work[-1, 1] - (0.5 * 6**2 - 0.5 * 2.0**2) / 2)


def test_under_a_given_stress_the_strain_jumps() -> None:
    rows = [(0.5, 2.0, 4.0, False), (0.75, 2.0, 8.0, True), (1.0, 1.0, 12.0, False)]
    curve, work = drawn(bar([{"S11": 4.0}, {"S11": 12.0}], rows))
    np.testing.assert_allclose(curve, [[2, 4], [4, 8], [8, 8], [12, 12]])
    before, behind = 16.0, 16.0 + 8.0 * 4.0
    assert {before, behind} <= {*np.round(work[np.isclose(work[:, 0], 1.5), 1], 9)}
    assert np.interp(1.75, *work.T) == pytest.approx(behind + (10.0**2 - 8.0**2) / 2)


def test_energies_of_temperature_legs_are_parabolas() -> None:
    """Held, a bar stores K (a T)^2 / 2."""
    legs = [{"temperature": 1.0, "E11": 0.0}, {"temperature": 3.0}, {"temperature": 0.0}]
    rows = [(1 / 3, 2.0, 1.0, False), (2 / 3, 2.0, 3.0, False), (1.0, 2.0, 0.0, False)]
    document = bar(legs, rows, expansion=1.0)
    _, work = drawn(document)
    for place, temperature in ((0.5, 0.5), (1.5, 2.0), (2.5, 1.5), (2.75, 0.75)):
        assert np.interp(place, *work.T) == pytest.approx(temperature**2)


def test_lines_end_where_the_state_behind_a_break_is_unknown() -> None:
    """Two strains change: the work gives one number for two stresses; one is left alone."""
    rows = [(0.5, 1.0, 5.0, False), (0.6, 1.0, 10.0, True), (1.0, 0.5, 30.0, False)]
    document = bar([{"E11": 5.0}, {"E11": 30.0, "gamma12": 0.001}], rows)
    corner = path_curves.later_corners(document)[1]
    assert np.isnan(corner["stress"][0]) and corner["strain"][0] == 10.0 and corner["stress"][1] == 0.0
    curve, _ = drawn(document)
    assert np.isnan(curve[2, 1]) and curve[3].tolist() == [30.0, 15.0]


ENERGIES = {
    "work": [4.0, 9.0, 8.0],
    "stored": [4.0, 6.0, 3.5],
    "stored_in_springs": [1.0, 2.0, 1.5],
    "dissipated": [0.0, 2.0, 2.0],
    "friction_heat": [0.0, 1.0, 2.5],
}
PARTS = {"stored in the bodies": [3.0, 4.0, 2.0], "stored in springs": [1.0, 2.0, 1.5]}
HEAT = {"heat of friction": [0.0, 1.0, 2.5]}
LOST = {"lost in breaks": [0.0, 2.0, 2.0]}
SPLIT = {"fracture energy": [0.0, 1.5, 2.0], "other losses in breaks": [0.0, 0.5, 0.0]}


def path_of_points(loads: list[float], **energies: list[float]) -> dict[str, Any]:
    """Return the document of a path of two legs with three points."""
    whole = {"strain": [[0.01, 0, 0]] * 3, "stress": [[1, 0, 0]] * 3, "broke": [0] * 3}
    whole |= {"bonded": [0] * 3, "open": [0] * 3, "closed": [0] * 3, "load_factor": loads} | energies
    points = [{name: values[k] for name, values in whole.items()} for k in range(3)]
    section = {"waypoints": [[0.01, 0, 0], [0, 0, 0]], "method": "events"}
    case = {"analysis": {"type": "path", "plane": "strain"}, "path": section, "output": {"stress_unit": "MPa"}}
    return {"case": case, "path": points}


@pytest.mark.parametrize(
    ("fracture", "parts"),
    [({}, PARTS | LOST | HEAT), ({"fracture_energy": [0.0, 1.5, 2.5]}, PARTS | SPLIT | HEAT)],
    ids=["strength", "toughness"],
)
def test_parts_are_stacked_to_the_work(fracture: dict[str, list[float]], parts: dict[str, list[float]]) -> None:
    document = path_of_points([0.25, 0.5, 1.0], **ENERGIES, **fracture)
    figure = path_picture.energies(document)
    assert figure is not None
    (axes,) = figure.axes
    top = np.zeros(3)
    for area, (name, values) in zip(axes.collections, parts.items(), strict=True):
        corners, top = area.get_paths()[0].vertices, top + values
        assert area.get_label() == name
        assert all(
            any(np.allclose(corner, own) for corner in corners) for own in zip([0.5, 1.0, 2.0], top, strict=True)
        )
    work = axes.lines[0]
    np.testing.assert_allclose(top, ENERGIES["work"])
    np.testing.assert_allclose(np.interp([0.25, 0.5, 1.0, 2.0], *work.get_data()), [1.0, *top])
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("leg of the path", "energy per area (MPa)")


def test_elastic_stretches_of_later_legs_are_parabolas() -> None:
    """Unloading stores a quarter of the energy at half of the strain, in the bodies and in the springs."""
    document = path_of_points(
        [0.25, 0.5, 1.0], work=[1.0, 4.0, 0.0], stored=[1.0, 4.0, 0.0], stored_in_springs=[0.25, 1.0, 0.0]
    )
    for point, share in zip(document["path"], (1.0, 2.0, 0.0), strict=True):
        point |= {"strain": [2.0 * share, 0.0, 0.0], "stress": [share, 0.0, 0.0]}
    figure = path_picture.energies(document)
    assert figure is not None
    (axes,) = figure.axes
    for place, share in ((0.25, 0.25), (0.75, 2.25), (1.5, 1.0), (1.75, 0.25)):
        assert np.interp(place, *axes.lines[0].get_data()) == pytest.approx(share)
        bodies = axes.collections[0].get_paths()[0].vertices
        assert any(np.allclose(corner, [place, 0.75 * share]) for corner in bodies)


def test_energies_at_rising_loads_and_results_without_energies() -> None:
    figure = path_picture.energies(path_of_points([0.5, 0.25, 1.0], **ENERGIES))
    assert figure is not None
    place = figure.axes[0].lines[0].get_xdata()
    assert {1.0, 2.0} <= {*place} and (np.diff(place) >= 0.0).all()
    # One leg: the load 0.5 is reached on a branch that stores 2 at the load 1, a quarter of it at 0.5; 3.5 are lost,
    # and 2.5 are heat.
    document = path_of_points(
        [0.5, 0.25, 1.0], **ENERGIES | {"stored": [4.0, 1.0, 2.0], "stored_in_springs": [0.0] * 3}
    )
    document["case"]["path"]["waypoints"].pop()
    for point, lost in zip(document["path"], (0.0, 3.0, 3.5), strict=True):
        point |= {"dissipated_strain_controlled": lost, "strain": [0.02 * point["load_factor"], 0, 0]}
    figure = path_picture.energies(document)
    assert figure is not None
    strains, work = figure.axes[0].lines[0].get_data()
    np.testing.assert_allclose(work[strains == 0.01], [4.0, 2.0 / 4.0 + 3.5 + 2.5])
    assert figure.axes[0].get_xlabel() == "macroscopic strain $E_{11}$" and strains[-1] == 0.02
    top = figure.axes[0].collections[-1].get_paths()[0].vertices
    assert work[-1] == 8.0 and any(np.allclose(corner, [0.02, 8.0]) for corner in top)
    assert path_picture.energies(path_of_points([0.5, 0.6, 1.0])) is None


def test_statuses_of_the_unloaded_cell_are_the_statuses_before() -> None:
    """Nodes that compression closes are drawn closed until the load is zero, where the solver finds none closed."""
    legs, rows = [{"E11": -0.02}, {"E11": 0.0}, {"E11": 0.01}], [(-0.02, 2, 0), (0.0, 0, 2), (0.01, 0, 2)]
    document = bar(legs, [((k + 1) / 3, 100.0, strain, False) for k, (strain, _, _) in enumerate(rows)])
    for point, (_, closed, opened) in zip(document["path"], rows, strict=True):
        point |= {"bonded": 5, "closed": closed, "open": opened}
    lower = path_picture.figure(document).axes[-1]
    drawn_counts = {line.get_label(): [*line.get_ydata()] for line in lower.lines}
    assert drawn_counts["in contact"] == [2, 2, 0] and drawn_counts["open"] == [0, 0, 2]


@pytest.mark.parametrize(("shears", "names"), [(False, ["E11"]), (True, ["E11", "gamma12"])])
def test_each_strain_that_leads_a_leg_has_its_panels(shears, names):
    document = bar([{"E11": 5.0}, {"E11": 4.0, "gamma12": 3.0}], [(0.5, 1.0, 5.0, False), (1.0, 1.0, 4.0, False)])
    if shears:
        document["path"][1]["strain"][5], document["path"][1]["stress"][5] = 3.0, 2.0
    picture = path_picture.figure(document)
    axes, below = picture.axes, [text.get_text() for text in picture.legends[0].get_texts()]
    assert ("bonded" in below) == shears == (axes[-1].get_legend() is None) and len(below) == len({*below})
    labels = {"E11": "macroscopic strain $E_{11}$", "gamma12": r"macroscopic strain $\gamma_{12}$"}
    assert [panel.get_xlabel() for panel in axes if panel.get_xlabel()] == [labels[name] for name in names]
    assert len(axes) == 2 * len(names)
    curves = [line.get_xydata() for line in axes[len(names) - 1].lines if line.get_linewidth() == 2.0]
    ends = [curve[-1].tolist() for curve in curves if len(curve)]
    assert ([3.0, 2.0] in ends) == shears and ([3.0 if shears else 4.0, 4.0] in ends)
