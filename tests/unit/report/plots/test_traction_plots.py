"""Fibre numbers in pictures, and places of interface nodes along their fibres."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from matplotlib.figure import Figure
from support.sample_output import Sample, sample, write

from feti_homog.report.plots.cell_picture import write_fibre_numbers
from feti_homog.report.plots.drawn_cell import DrawnCell
from feti_homog.report.plots.traction_plots import Coordinate, _limit, _panel, coordinate

CORNERS = np.array([[0.75, 0.25], [0.75, 0.75], [0.25, 0.75], [0.25, 0.25]])


def around(whole: Sample, count: int, number: int) -> Sample:
    """Return the sample with `count` interface nodes on each side of the square fibre, which has this number.

    The nodes are in any order; the fibre is moved by half a cell, so that the sides of the cell cut it in four.
    """
    steps = np.arange(count)[:, None] / count
    sides = np.concatenate([a + steps * (b - a) for a, b in zip(CORNERS, np.roll(CORNERS, -1, axis=0), strict=True)])
    normals = np.repeat([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]], count, axis=0)
    normals[::count] = (normals[::count] + np.roll(normals[::count], 1, axis=0)) / np.sqrt(2.0)
    order = np.random.default_rng(5).permutation(len(sides))
    old = vars(whole.interface)
    tables = {name: np.resize(table, (len(sides), *table.shape[1:])) for name, table in old.items()}
    tables |= {"points": sides[order], "normal": normals[order]}
    tables |= {name: np.full(len(sides), number) for name in ("fibre", "fibre_number")}
    states = tuple(replace(state, **_resized(state, len(whole.interface.points), len(sides))) for state in whole.states)
    fibres = replace(whole.fibres, number=np.array([number]))
    return replace(whole, interface=type(whole.interface)(**tables), fibres=fibres, states=states)


def _resized(state: Any, old: int, new: int) -> dict[str, Any]:
    """Return the tables of a state on `old` interface nodes, for `new` ones."""
    tables = {name: value for name, value in vars(state).items() if isinstance(value, np.ndarray) and len(value) == old}
    return {name: np.resize(table, (new, *table.shape[1:])) for name, table in tables.items()}


def found(path: Path, number: int, limit: int) -> tuple[Coordinate, Any]:
    with h5py.File(path) as file:
        return coordinate(DrawnCell.of(file, limit), number), file["interface/points"][:]


@pytest.mark.parametrize("limit", [100_000, 40], ids=["all triangles", "coarse ones"])
def test_flat_faces_have_an_arc_length(tmp_path: Path, limit: int) -> None:
    """Counterclockwise around the square of length 2, from the first node whose normal is nearest to x1."""
    place, points = found(write(tmp_path, around(sample(4, refine=1), 4, 2)), 2, limit)
    assert place.label.startswith("arc length from normal $x_1$, counter") and place.ends == pytest.approx((0.0, 2.0))
    np.testing.assert_allclose(place.values, np.arange(16) / 8, atol=1e-12)
    along = points[place.nodes]
    np.testing.assert_allclose(np.linalg.norm(np.diff(along, axis=0), axis=1), 0.125)
    x, y = along.T
    assert (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() > 0.0
    assert along[0, 0] == pytest.approx(0.75)
    axes = Figure().subplots()
    values = {"status": np.zeros(points.shape[0], int), "damage": np.arange(points.shape[0])}
    _panel(axes, [values], "damage", place)
    x, y = axes.lines[0].get_data()
    assert x[-1] == place.ends[1] and y[-1] == values["damage"][place.nodes[0]]  # the curve closes


def test_open_ends_of_an_interface_have_an_arc_length_too(tmp_path: Path) -> None:
    """Two sides of the sample's fibre are interfaces."""
    place, points = found(write(tmp_path, sample(8)), 1, 100_000)
    assert place.label.startswith("arc length, counter") and not place.is_closed
    np.testing.assert_allclose(place.values, [0, 0.125, 0.25, 0.375, 0.5, 0.5, 0.625, 0.75, 0.875, 1.0], atol=1e-12)
    for rows in (place.nodes[:5], place.nodes[5:]):
        upper = points[rows[0], 1] > 0.5
        assert (np.diff(points[rows, 0]) * (-1 if upper else 1) > 0).all()


def test_round_fibres_have_directions(tmp_path: Path) -> None:
    whole = sample(4)
    path = write(tmp_path, replace(whole, fibres=replace(whole.fibres, radius=np.array([0.25]))))
    place, _ = found(path, 1, 100_000)
    assert place.ends == (-180.0, 180.0)
    np.testing.assert_allclose(place.values, [-90.0] * 5 + [90.0] * 5)


def test_values_beyond_the_axes_are_marked_in_their_panel() -> None:
    upper, lower = panels = Figure().subplots(2, 1, sharey=True)
    wave = np.sin(np.linspace(0.0, 7.0, 300))
    upper.plot(np.append(wave, [40.0, -30.0]))
    lower.plot(np.append(wave, 20.5))
    _limit(panels)
    low, high = lower.get_ylim()
    assert -30.0 < low < -1.0 and 1.0 < high < 20.5
    assert [text.get_text() for axes in panels for text in axes.texts] == ["▲ 40\n▼ -30", "▲ 20.5"]
    smooth = Figure().subplots()
    smooth.plot(wave)
    _limit([smooth])
    assert not smooth.texts


@pytest.mark.parametrize(
    ("radius", "centre", "places"),
    [
        (np.nan, [0.5, 0.5], [[0.5, 0.5]]),
        (0.25, [0.5, 0.5], [[0.5, 0.5]]),
        (0.25, [0.0, 0.0], [[0.1, 0.1], [0.9, 0.1], [0.1, 0.9], [0.9, 0.9]]),
        (0.25, [0.0, 0.5], [[0.1, 0.5], [0.9, 0.5]]),
        (0.25, [0.9, 0.5], [[0.9, 0.5], [0.1, 0.5]]),
    ],
)
def test_every_part_of_a_fibre_has_its_number(tmp_path: Path, radius: float, centre: Any, places: Any) -> None:
    """The number of the case file, whatever the body: here that of a third fibre, the first body after the matrix."""
    whole = sample(8)
    fibres = replace(whole.fibres, number=np.array([3]), centre=np.array([centre]), radius=np.array([radius]))
    axes = Figure().subplots()
    with h5py.File(write(tmp_path, replace(whole, fibres=fibres))) as file:
        write_fibre_numbers(axes, DrawnCell.of(file), 5.0)
    assert {text.get_text() for text in axes.texts} == {"3"}
    shown = sorted(tuple(np.round(text.get_position(), 2)) for text in axes.texts)
    np.testing.assert_allclose(shown, sorted(map(tuple, places)), atol=0.06)


def test_fibres_of_cells_with_a_boundary_have_no_images(tmp_path: Path) -> None:
    """The number stands in the half that the side leaves of the fibre, not at the other side of the cell."""
    whole = sample(8)
    header = replace(whole.header, case='{"cell": {"boundary": "displacement"}}')
    x, y = whole.mesh.points[whole.mesh.triangles].mean(axis=1).T
    mesh = replace(whole.mesh, body=((x - 1.0) ** 2 + (y - 0.5) ** 2 < 0.25**2).astype(whole.mesh.body.dtype))
    fibres = replace(whole.fibres, centre=np.array([[1.0, 0.5]]), radius=np.array([0.25]))
    axes = Figure().subplots()
    with h5py.File(write(tmp_path, replace(whole, header=header, mesh=mesh, fibres=fibres))) as file:
        write_fibre_numbers(axes, DrawnCell.of(file), 5.0)
    ((left, height),) = (text.get_position() for text in axes.texts)
    assert left == pytest.approx(0.9) and height == pytest.approx(0.5)
