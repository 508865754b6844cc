"""Panels of states, debonded arcs, units, colours of all states, and texts in pictures, small, narrow and flat ones."""

from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.text import Text
from PIL import Image
from support.sample_output import path_of, sample, write

from feti_homog.errors import CaseError
from feti_homog.report.plots import cell_picture, deformed_panels, drawn_cell, figures, path_picture, plot_helpers
from feti_homog.report.plots.drawn_cell import bar_beside, figure_of, label_cell_axes
from feti_homog.report.plots.plot_helpers import DPI, save
from feti_homog.report.text import tables

PATH = path_of([0.5, 0.2, 1.0])


@pytest.mark.parametrize(("last", "count"), [(180, 7), (180, 13), (360, 7), (180, 19), (180, 37), (180, 5), (90, 3)])
def test_angles_in_panels_are_evenly_spaced_and_have_the_middle(last: int, count: int) -> None:
    angles = np.linspace(0, last, count)
    numbers = deformed_panels.shown_states({"angle": [{}] * count}, deformed_panels.MAX_ANGLES, count)
    shown = angles[numbers]
    assert 3 <= len(shown) <= deformed_panels.MAX_ANGLES and {0, last / 2, last} <= {*shown}
    assert np.ptp(np.diff(shown)) == pytest.approx(0.0)


@pytest.mark.parametrize("count", [1, 2, 8, 12, 1000])
def test_other_numbers_of_angles_have_panels_too(count: int) -> None:
    numbers = deformed_panels.shown_states({"angle": [{}] * count}, deformed_panels.MAX_ANGLES, count)
    assert (numbers[0], numbers[-1]) == (0, count - 1) and len(numbers) >= min(count, 4)


@pytest.mark.parametrize("lines", [1, 2, 4])
def test_titles_of_panels_leave_the_title_of_the_figure_free(tmp_path: Path, monkeypatch: Any, lines: int) -> None:
    monkeypatch.setattr(deformed_panels.landmarks, "marks", lambda _: dict.fromkeys(range(3), "peak\n" * lines))
    with h5py.File(write(tmp_path, sample(4))) as file:
        figure = deformed_panels.panels(file, PATH, 1.0)
        (canvas := FigureCanvasAgg(figure)).draw()
        renderer: Any = canvas.get_renderer()
        title = figure._suptitle.get_window_extent(renderer)  # type: ignore[attr-defined]
        boxes = [axes.title.get_window_extent(renderer) for axes in figure.axes if axes.get_title()]
    assert len(boxes) >= 3 and not any(title.overlaps(box) for box in boxes)


def test_columns_of_panels_are_even_if_the_end_has_colours_of_its_own(tmp_path: Path, monkeypatch: Any) -> None:
    whole, document = sample(4), PATH | {"path": PATH["path"][:1] * 5}
    first = whole.states[0]
    states = [replace(first, point=k, stress=first.stress * (1.0 if k < 4 else 10.0)) for k in range(5)]
    monkeypatch.setattr(deformed_panels.landmarks, "marks", lambda _: dict.fromkeys(range(4), "peak") | {4: "end"})
    monkeypatch.setattr(deformed_panels, "_grid", lambda *_: (2, 3))
    with h5py.File(write(tmp_path, replace(whole, states=tuple(states)))) as file:
        figure = deformed_panels.panels(file, document, 1.0)
    panels = [axes for axes in figure.axes if axes.get_title().startswith(("peak", "end"))]
    assert len(panels) == 5 and any("own colours" in axes.get_title() for axes in panels)
    left = [axes.get_position().x0 for axes in panels[:3]]
    assert left[2] - left[1] == pytest.approx(left[1] - left[0], rel=0.02)
    (bar,) = panels[4].child_axes
    (canvas := FigureCanvasAgg(figure)).draw()
    renderer: Any = canvas.get_renderer()
    assert bar.get_tightbbox(renderer).y1 < panels[4].get_window_extent(renderer).y0


@pytest.mark.parametrize("title", ["", "one"])
def test_an_empty_title_takes_no_room(tmp_path: Path, title: str) -> None:
    look = plot_helpers.Look(title=title)
    for has_own in (True, False):
        figure = look.figure(4.0, 3.0)
        axes = figure.subplots()
        own = figure.suptitle("own") if has_own else axes.set_title("own")
        plot_helpers.save(figure, tmp_path / "picture.png", look)
        assert own.get_text() == title and own.get_in_layout() == bool(title)


def test_crowded_points_have_no_numbers() -> None:
    axes = plot_helpers.PLAIN.figure(7.0, 4.0).subplots()
    place = np.linspace(0.0, 1.0, 2001)
    curve = np.column_stack([place, place * (1.0 - place)])
    axes.plot(*curve.T)
    path_picture._number_points(axes, curve, [0, *range(1000, 1010), 2000])
    numbers = [int(text.get_text()) for text in axes.texts]
    assert {0, 1000, 2000} <= {*numbers} and len(numbers) < 8
    (canvas := FigureCanvasAgg(axes.figure)).draw()  # type: ignore[arg-type]
    renderer: Any = canvas.get_renderer()
    boxes = [text.get_bbox_patch().get_window_extent(renderer) for text in axes.texts]  # type: ignore[union-attr]
    assert not any(one.overlaps(other) for k, one in enumerate(boxes) for other in boxes[:k])


def test_drawings_leave_the_common_colours_without_listeners(tmp_path: Path) -> None:
    """Frames of an animation come and go; the colours that they share outlive them."""
    with h5py.File(write(tmp_path, sample(4))) as file:
        cell = deformed_panels.DeformedCell.of_states(file, range(3), PATH, 1.0, 10_000)
        axes = plot_helpers.PLAIN.figure(4.0, 4.0).subplots()
        shapes = cell.draw(axes, 0, cell.moved(0))
        cell.bar(axes, shapes)
        assert shapes.get_clim() == (cell.colours[0].vmin, cell.colours[0].vmax)
        assert not cell.colours[0].callbacks.callbacks


@pytest.mark.parametrize("debonded", [False, True])
def test_the_cell_shows_arcs_that_are_debonded_before_the_load(tmp_path: Path, debonded: bool) -> None:
    whole = sample(8)
    some = np.arange(len(whole.states[0].status)) < 3
    initial = np.where(some, drawn_cell.CLOSED, drawn_cell.BONDED) * debonded
    states = replace(whole.states[0], status=initial), *whole.states[1:]  # breaks under the load do not count
    with h5py.File(write(tmp_path, replace(whole, states=states))) as file:
        cell = drawn_cell.DrawnCell.of(file)
        figure = cell_picture.figure(cell)
        nodes = np.isin(cell.interface.nodes, np.flatnonzero(some)).any(axis=1)
        expected = cell.drawn.points[cell.interface.edges[nodes]].reshape(-1, 2)
    words = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert words == ["matrix", "fibre", *["initially debonded"] * debonded]
    lines = [line for line in figure.axes[0].patches if isinstance(line, PathPatch)]
    red = [line for line in lines if line.get_edgecolor()[:3] == pytest.approx((0xB0 / 0xFF, 0.0, 0.0))]
    assert len(red) == debonded
    for line in red:
        np.testing.assert_array_equal(line.get_path().vertices, expected)


@pytest.mark.parametrize(
    ("given", "shown"),
    [("um", "µm"), ("MPa um", "MPa µm"), ("MPa/um", "MPa/µm"), ("um2", "µm2"), ("µm", "µm"), ("umol", "umol"),
     ("mm", "mm"), ("vacuum", "vacuum"), ("", "")],
)  # fmt: skip
def test_micrometres_have_the_micro_sign(given: str, shown: str) -> None:
    assert tables.with_micro(given) == shown
    assert plot_helpers.unit_label(given) == (f"({shown})" if given else "")
    assert tables.in_brackets(given) == (f" ({shown})" if given else "")


@pytest.mark.parametrize("size", [(8.0, 80.0), (240.0, 10.0), (1.0, 1.0)])
def test_bars_beside_narrow_and_flat_cells_are_wide_and_high_enough(size: tuple[float, float]) -> None:
    attributes = {"width": size[0], "height": size[1], "length_unit": "um"}
    figure, axes = figure_of(attributes)
    axes.plot([0.0, size[0]], [0.0, size[1]])
    bar = bar_beside(axes, ScalarMappable(), "both")
    label_cell_axes(axes, attributes)
    figure.draw_without_rendering()
    drawn = bar.ax.get_window_extent().size / figure.dpi
    assert drawn[0] > 0.12 and drawn[1] > 0.96  # inches


@pytest.mark.parametrize("letters", [10, 200])
def test_titles_wider_than_the_figure_are_drawn_whole(tmp_path: Path, letters: int) -> None:
    figure = Figure(figsize=(3.0, 2.0), layout="constrained")
    title = figure.subplots().set_title("M" * letters)
    with Image.open(save(figure, tmp_path / "long.png")) as picture:
        assert picture.width >= title.get_window_extent().width
        assert (picture.width > 3.2 * DPI) == (letters == 200)
        edges = np.asarray(picture)[:, [0, -1]]
    assert (edges == 255).all()


@pytest.mark.parametrize("panels", [1, 2, 4, 6])
@pytest.mark.parametrize("ratio", [0.05, 1.0, 20.0])
def test_panels_leave_no_row_empty(panels: int, ratio: float) -> None:
    rows, columns = deformed_panels._grid(panels, ratio)
    assert (rows - 1) * columns < panels <= rows * columns


def test_panels_and_frames_of_tall_cells_fit_on_a_page() -> None:
    assert deformed_panels._height(np.array([1.0, 1.0]), 3.6) == 3.6
    assert deformed_panels._height(np.array([8.0, 80.0]), 3.6) == pytest.approx(6.0)


NAMED = {
    "name": "a case with a name of several words, longer than a column",
    "interface": {"contact": True, "criterion": "max", "normal_strength": 0.06},
}


def texts(figure: Figure) -> list[Text]:
    """Return the texts in a picture, without tick labels beyond the limits of their axis."""
    hidden = set()
    for axes in figure.findobj(Axes):
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            margin = 1e-6 * (high - low)
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                if not (axes.axison and low - margin <= tick.get_loc() <= high + margin):
                    hidden |= {tick.label1, tick.label2}
    return [text for text in figure.findobj(Text) if text.get_visible() and text.get_text() and text not in hidden]


@pytest.mark.slow
@pytest.mark.parametrize("strains", [[0.5, 0.2, 1.0], [-0.015, -0.011, -0.01]], ids=["rising", "small and negative"])
def test_texts_in_a_column_of_a_paper_are_whole_and_apart(
    tmp_path: Path, monkeypatch: Any, strains: list[float]
) -> None:
    """In pictures of 8.5 x 7 cm no text leaves the canvas or lies on another text."""
    whole = sample(4)
    states = tuple(
        replace(state, strain=strains[k] * np.array([1.0, -0.3, 0.0])) for k, state in enumerate(whole.states)
    )
    document = path_of(strains)
    write(tmp_path, replace(whole, states=states), document | {"case": document["case"] | NAMED})
    found: dict[str, Figure] = {}
    save = plot_helpers.save

    def keep(figure: Figure, path: Path, look: plot_helpers.Look) -> Path:
        found[path.name] = figure
        return save(figure, path, look)

    monkeypatch.setattr(plot_helpers, "save", keep)
    figures.plot(tmp_path, plot_helpers.Look(size=(8.5, 7.0)))
    assert {"path.png", "path_states.png", "interface.png", "partition.png"} <= found.keys()
    for name, figure in found.items():
        (canvas := FigureCanvasAgg(figure)).draw()
        renderer: Any = canvas.get_renderer()
        boxes = {text: text.get_window_extent(renderer) for text in texts(figure)}
        assert len(boxes) > 5
        for text, box in boxes.items():
            assert min(box.min) >= -1.0 and (box.max <= figure.bbox.max + 1.0).all(), (name, text)
        for (text, box), (other, beside) in combinations(boxes.items(), 2):
            assert not box.shrunk(0.95, 0.8).overlaps(beside.shrunk(0.95, 0.8)), (name, text, other)


def test_panels_have_the_colours_of_all_states(tmp_path: Path, monkeypatch: Any) -> None:
    """A state without a landmark and of the other sign counts; the end of far larger stresses does not."""
    document = path_of([0.1, 0.2, 1.0])
    monkeypatch.setattr(deformed_panels.landmarks, "marks", lambda document: {0: "peak", 2: "end"})
    write(tmp_path, sample(4), document)
    with h5py.File(tmp_path / "result.h5", "r+") as file:
        for number, value in enumerate((2.0, -3.0, 3.5)):
            table = file[f"state/{number}/stress"]
            table[:] = value * np.linspace(0.0, 1.0, len(table))[:, None]
            file[f"state/{number}"].attrs["point"] = number
        ranges = []
        for last in (1.0, 100.0):
            file["state/2/stress"][:] *= last
            cell = deformed_panels.DeformedCell.of_states(file, range(3), document, 1.0, 10_000)
            ranges.append((cell.colours[0].vmin, cell.colours[0].vmax))
    assert ranges[0][0] == -ranges[0][1] and 2.5 < ranges[0][1] <= 3.5
    assert ranges[1][0] == -ranges[1][1] and 2.0 < ranges[1][1] <= 3.0


def test_a_state_of_a_path_is_drawn_by_its_mark(tmp_path: Path, monkeypatch: Any) -> None:
    marks = {0: "first break and largest stress", 2: "end"}
    monkeypatch.setattr(deformed_panels.landmarks, "marks", lambda document: marks)
    write(tmp_path, sample(4), document := path_of([0.1, 0.2, 1.0]))
    with h5py.File(tmp_path / "result.h5") as file:
        points = {number: int(state.attrs["point"]) for number, state in file["state"].items()}
        assert {*marks} <= {*points.values()}
        for word, point in (("first break", 0), ("largest stress", 0), ("end", 2)):
            ((name, _),) = figures.of_fields(tmp_path, file, document, plot_helpers.PLAIN, word)
            assert points[name.removeprefix("state_")] == point
        with pytest.raises(CaseError, match=r"--state peak: .*, first break, largest stress\), .*, end\)"):
            next(figures.of_fields(tmp_path, file, document, plot_helpers.PLAIN, "peak"))
