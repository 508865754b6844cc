"""The stack of energies along a path, in energy.png and on the page."""

from typing import Any

import numpy as np
import pytest

from feti_homog.report.plots import path_picture

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


def path(loads: list[float], **energies: list[float]) -> dict[str, Any]:
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
    document = path([0.25, 0.5, 1.0], **ENERGIES, **fracture)
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
    document = path([0.25, 0.5, 1.0], work=[1.0, 4.0, 0.0], stored=[1.0, 4.0, 0.0], stored_in_springs=[0.25, 1.0, 0.0])
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
    figure = path_picture.energies(path([0.5, 0.25, 1.0], **ENERGIES))
    assert figure is not None
    place = figure.axes[0].lines[0].get_xdata()
    assert {1.0, 2.0} <= {*place} and (np.diff(place) >= 0.0).all()
    # One leg: the load 0.5 is reached on a branch that stores 2 at the load 1, a quarter of it at 0.5; 3.5 are lost,
    # and 2.5 are heat.
    document = path([0.5, 0.25, 1.0], **ENERGIES | {"stored": [4.0, 1.0, 2.0], "stored_in_springs": [0.0] * 3})
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
    assert path_picture.energies(path([0.5, 0.6, 1.0])) is None
