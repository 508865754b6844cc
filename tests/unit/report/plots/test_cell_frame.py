"""Pictures of narrow and flat cells and of long names: colour bars that can be read, and words that are whole."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from PIL import Image

from feti_homog.report.plots import deformed_panels
from feti_homog.report.plots.drawn_cell import bar_beside, figure_of, label_cell_axes
from feti_homog.report.plots.plot_helpers import DPI, save


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
    assert deformed_panels._inches(np.array([1.0, 1.0]), 3.6) == (3.6, 3.6)
    assert deformed_panels._inches(np.array([8.0, 80.0]), 3.6) == pytest.approx((0.6, 6.0))
