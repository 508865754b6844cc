"""Displacements and stresses in pictures: the translation, the scale at which no triangle turns over, nodal values."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from support.sample_output import in_space, sample, write

from feti_homog.report.plots import deformed_panels, plot_helpers
from feti_homog.report.plots.decimation import (
    LEAST_AREA,
    DrawnMesh,
    drawn_displacement,
    drawn_mesh,
    largest_scale,
    node_means,
)
from feti_homog.report.plots.drawn_cell import DrawnCell


def square() -> DrawnMesh:
    points = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    label = np.zeros(2, int)
    return DrawnMesh(8, 1, 1, np.arange(4), points, np.array([[0, 1, 2], [2, 0, 3]]), label, label, label, label)


@pytest.mark.parametrize("bodies", [1, 2])
def test_values_at_nodes_are_means_within_a_body_weighted_by_area(bodies: int) -> None:
    """Two triangles of areas 1 and 3 with a side in common, each with nodes of its own: of one body or of two."""
    points = np.array([[0, 0], [2, 0], [2, 1], [2, 1], [0, 0], [-2, 2]], float)
    body = np.arange(2) % bodies
    drawn = DrawnMesh(8, 1, 1, np.arange(6), points, np.arange(6).reshape(2, 3), body, np.arange(2), body, body)
    means = node_means(np.array([4.0, 8.0]), drawn)
    middle = (4.0 * drawn.areas[0] + 8.0 * drawn.areas[1]) / drawn.areas.sum()
    assert means.tolist() == pytest.approx(
        [middle, 4, middle, middle, middle, 8] if bodies == 1 else [4.0] * 3 + [8.0] * 3
    )


def area_ratio(displacement: Any, drawn: DrawnMesh, scale: float) -> float:
    """Return the least of all triangles, by their corners."""
    before, after = (places[drawn.triangles] for places in (drawn.points, drawn.points + scale * displacement))
    areas = [np.linalg.det(corners[:, 1:] - corners[:, :1]) for corners in (before, after)]
    return float((areas[1] / areas[0]).min())


@pytest.mark.parametrize(
    ("gradient", "expected"),
    [
        ([[1.0, 0.0], [0.0, 0.3]], np.inf),
        ([[-1.0, 0.0], [0.0, 0.0]], 0.5),
        ([[-0.1, 0.0], [0.0, -0.1]], 10 * (1 - np.sqrt(0.5))),
        ([[0.0, 1.0], [1.0, 0.0]], np.sqrt(0.5)),
        ([[0.0, -1.0], [1.0, 0.0]], np.inf),
        ([[1.0, 0.0], [0.0, -0.5]], (0.5 + np.sqrt(0.25 + 1.0)) / 1.0),
    ],
    ids=["stretched", "pressed", "shrunk", "sheared", "turned", "longer and thinner"],
)
def test_the_largest_scale_of_a_uniform_gradient(gradient: Any, expected: float) -> None:
    drawn = square()
    displacement = drawn.points @ np.array(gradient).T + [7.0, -3.0]
    assert largest_scale(displacement, drawn) == pytest.approx(expected)
    if np.isfinite(expected):
        assert area_ratio(displacement, drawn, expected) == pytest.approx(LEAST_AREA)


@pytest.mark.parametrize("spatial", [False, True], ids=["plane", "space"])
def test_a_translation_is_not_drawn(tmp_path: Path, spatial: bool) -> None:
    whole = sample(8, refine=1)
    states = tuple(replace(state, displacement=state.displacement + np.array([0.3, -0.2])) for state in whole.states)
    moved = replace(whole, states=states)
    with h5py.File(write(tmp_path, in_space(moved) if spatial else moved), "r") as file:
        drawn = drawn_mesh(file)
        shown = [drawn_displacement(file[f"state/{k}"], drawn) for k in range(2)]
    for u, state in zip(shown, whole.states, strict=False):
        gradient = np.zeros((2, 2)) if spatial else np.diag(state.strain[:2])
        mean = (u - drawn.points @ gradient)[drawn.triangles].mean(axis=(0, 1))
        np.testing.assert_allclose(mean, 0.0, atol=1e-14)


@pytest.mark.parametrize(
    ("displacement", "opening", "largest", "scale"),
    [
        *((1.0, 0.0, *pair) for pair in ((np.inf, 0.1), (0.1, 0.1), (0.099, 0.05), (0.0035, 0.002), (7.0, 0.1))),
        *((u, 0.0, np.inf, scale) for u, scale in ((1.2, 0.1), (0.01, 10.0), (0.3e-4, 5e3), (0.0, 1.0), (2e-3, 50.0))),
        *((2e-3, 1e-3, np.inf, 50.0), (2e-2, 2e-3, np.inf, 10.0), (0.5, 1e-3, np.inf, 0.5), (0.1, 0.1, np.inf, 1.0)),
    ],
)
def test_the_scale_is_round_and_within_its_limit(
    displacement: float, opening: float, largest: float, scale: float
) -> None:
    """A tenth of the cell is seen; openings of 0.2 % of it, too, if displacements stay below a quarter."""
    assert plot_helpers.magnification(displacement, 1.0, opening, largest=largest) == pytest.approx(scale)


def test_no_triangle_of_a_magnified_state_turns_over(tmp_path: Path) -> None:
    """Where a small displacement varies fast, as under a temperature in narrow gaps."""
    whole = sample(8, refine=1)
    points = whole.mesh.points
    waves = 1e-5 * np.sin(2 * np.pi * 4 * points)
    states = tuple(replace(state, strain=0 * state.strain, displacement=waves) for state in whole.states)
    document = {"case": {"output": {}, "angle": {}}, "angle": []}
    with h5py.File(write(tmp_path, replace(whole, states=states)), "r") as file:
        drawn, scale = drawn_mesh(file), deformed_panels.shown_scale(file, document)
        displacement = drawn_displacement(file["state/0"], drawn)
    assert LEAST_AREA <= area_ratio(displacement, drawn, scale) < 0.9
    assert area_ratio(displacement, drawn, plot_helpers.magnification(np.abs(waves).max(), 1.0)) < 0


@pytest.mark.parametrize(
    ("panels", "ratio", "grid"),
    [(1, 1.0, (1, 1)), (3, 1.0, (1, 3)), (3, 1.1, (1, 3)), (4, 1.0, (2, 2)), (6, 1.0, (2, 3)), (5, 1.0, (2, 3)),
     (3, 2.0, (3, 1)), (6, 0.58, (2, 3))],
)  # fmt: skip
def test_panels_leave_few_places_empty(panels, ratio, grid):
    assert deformed_panels._grid(panels, ratio) == grid


@pytest.mark.parametrize(
    ("stress", "S33", "axial", "von_mises", "principal"),
    [
        ([3.0, 0.0, 0.0], 0.0, None, 3.0, 3.0),
        ([-3.0, -4.0, 0.0], 2.0, None, np.sqrt(31.0), 2.0),
        ([0.0, 0.0, 2.0], 0.0, None, 2.0 * np.sqrt(3.0), 2.0),
        ([5.0, 5.0, 0.0], 5.0, [0.0, 0.0], 0.0, 5.0),
        ([0.0, 0.0, 0.0], 0.0, [3.0, -4.0], 5.0 * np.sqrt(3.0), 5.0),
    ],
)
def test_a_uniform_stress_has_its_von_mises_and_its_largest_principal_stress(
    tmp_path: Path, stress: list[float], S33: float, axial: list[float] | None, von_mises: float, principal: float
) -> None:
    with h5py.File(write(tmp_path, sample(3) if axial is None else in_space(sample(3))), "r+") as file:
        state, values = file["state/1"], {"stress": stress, "stress_33": S33, "axial_stress": axial}
        for name, value in values.items():
            if value is not None:
                state[name][:] = value
        drawn = DrawnCell.of(file).drawn
        np.testing.assert_allclose(plot_helpers.nodal_stress(state, "von_mises", drawn), von_mises, atol=1e-12)
        np.testing.assert_allclose(plot_helpers.nodal_stress(state, "principal", drawn), principal, atol=1e-12)
