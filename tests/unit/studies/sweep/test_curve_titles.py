"""Titles of the curves of a sweep: realisations and bands are named where there are some."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from feti_homog.studies.sweep.report import figures
from feti_homog.studies.sweep.report.outputs import outputs
from feti_homog.studies.sweep.report.sweep_table import SweepTable

WORDS = {1: "test: stress along the paths", 2: "test: realisations and their mean; band: range of the realisations"}


def path_document(scale=1.0):
    points = [
        {"load_factor": t, "strain": [0.2 * t, 0, 0], "stress": [8.0 * scale * t, t, 0.0], "broke": 1,
         "dissipated": 0.1, "work": 0.3, "bonded": 9, "open": 1, "closed": 0}
        for t in (0.1, 0.5, 1.0)
    ]  # fmt: skip
    case = {
        "cell": {"geometry": "random", "fibre_fraction": 0.4, "fibres": 2},
        "material": {"matrix": {"young": 88.0, "poisson": 0.299}, "fibre": {"young": 200.0, "poisson": 0.222}},
        "analysis": {"type": "path", "plane": "strain"}, "path": {"method": "events", "strain": [0.2, 0, 0]},
    }  # fmt: skip
    return {
        "case": case, "cell": {"fibre_fraction": 0.4, "elements": 10, "nodes": 9},
        "solver": {"ranks": 1, "subdomains": 2, "dofs": 18, "multipliers": 4, "iterations": [3]},
        "checks": {"hill": 1e-12}, "timings": {"solve": 0.1}, "memory": 1000, "path": points,
    }  # fmt: skip


@pytest.mark.parametrize("realisations", WORDS)
def test_realisations_and_their_band_are_named_where_there_are_some(realisations):
    assert figures.curves_figure(table_of([path_document()] * realisations)).get_suptitle() == WORDS[realisations]


def table_of(documents):
    """Return the table of realisations of one point."""
    realisations = len(documents)
    return SweepTable(
        name="test", stress_unit="GPa", folder=["case"] * realisations, point=[1] * realisations,
        realisation=[*range(1, realisations + 1)], status=["done"] * realisations, reason=[""] * realisations,
        inputs={"cell.seed": [*range(realisations)]}, documents=documents, outputs=outputs(documents[0]),
    )  # fmt: skip


@pytest.mark.parametrize("count", [2, 12], ids=["range", "interval"])
def test_the_band_is_the_range_of_few_curves_and_the_confidence_interval_of_many(count):
    """Straight lines whose ends have a mean and, by Student's t, an interval."""
    scales = np.linspace(0.8, 1.3, count)
    figure = figures.curves_figure(table_of([path_document(scale) for scale in scales]))
    axes = figure.axes[0]
    ends, half = 8.0 * scales, 8.0 * stats.t.ppf(0.975, count - 1) * scales.std(ddof=1) / count**0.5
    expected = (ends.min(), ends.max()) if count == 2 else (ends.mean() - half, ends.mean() + half)
    (band,) = axes.collections
    corners = band.get_paths()[0].vertices
    last = corners[np.isclose(corners[:, 0], 0.2)]
    assert (last[:, 1].min(), last[:, 1].max()) == pytest.approx(expected)
    mean = next(line for line in axes.lines if str(line.get_label()).endswith("realisations)"))
    assert mean.get_xydata()[-1] == pytest.approx([0.2, ends.mean()])
    assert axes.get_ylabel() == "$\\Sigma_{11}$ (GPa)"
    assert ("95 %" in figure.get_suptitle()) == (count == 12)
