"""match.png: the cells of a sweep beside the tables that they match."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread
from support.fibre_patterns import poisson_points
from support.measured_fibres import clustered_table

from feti_homog.fibres.fibre_window import read_window
from feti_homog.microstructure.neighbour_match import nearest_neighbours
from feti_homog.sweep.report import figures
from feti_homog.sweep.report.sweep_table import SweepTable


def document(path, seed):
    points = poisson_points(30, seed=seed)
    fibres = [{"centre": centre.tolist(), "radius": 0.2} for centre in points.centres]
    case = {"cell": {"geometry": "random"} | ({} if path is None else {"match": str(path)})}
    return {"case": case, "cell": {"width": 10.0, "height": 10.0, "match_distance": 0.01 * seed}, "fibres": fibres}


def sweep_table(documents):
    count = len(documents)
    return SweepTable(
        name="test", stress_unit="", folder=[""] * count, point=[1] * count, realisation=list(range(count)),
        status=["done"] * count, reason=[""] * count, inputs={}, outputs={}, documents=documents,
    )  # fmt: skip


@pytest.fixture
def two(tmp_path):
    return [clustered_table(tmp_path / name, 40, seed=seed) for name, seed in (("a.csv", 1), ("b.csv", 2))]


def test_a_row_for_each_table_with_its_cells(two):
    a, b = two
    table = sweep_table([document(a, 1), document(b, 2), document(a, 3), None, document(None, 4)])
    assert figures.tables(table) == two
    axes = figures.figure(table).axes
    assert [each.get_title() for each in axes[::3]] == [
        "a.csv, 40 fibres; cells to 0.0300 mean diameters",
        "b.csv, 40 fibres; cells to 0.0200 mean diameters",
    ]
    drawn = [line for line in axes[0].lines if len(line.get_xdata())]
    assert len(drawn) == 2 * (2 + 1)
    near = nearest_neighbours(poisson_points(30, seed=1))
    assert drawn[0].get_xdata() == pytest.approx(np.sort(near.distances[:, 0]) / 0.4)
    assert drawn[0].get_ydata() == pytest.approx(np.arange(1, 31) / 30)
    own, window = nearest_neighbours(read_window(a)), read_window(a)
    counted = own.weights[:, 0] > 0
    assert drawn[2].get_xdata() == pytest.approx(np.sort(own.distances[counted, 0]) / (2 * window.mean_radius))
    assert drawn[2].get_ydata()[-1] == pytest.approx(1.0)


def test_it_is_drawn_where_cells_match_a_table_that_is_there(two, tmp_path):
    table = sweep_table([document(two[0], 1)])
    assert figures.plot(tmp_path, table) == [tmp_path / "match.png"]
    assert imread(tmp_path / "match.png")[..., :3].std() > 0.02
    two[0].unlink()
    assert figures.plot(tmp_path, replace(table)) == []
