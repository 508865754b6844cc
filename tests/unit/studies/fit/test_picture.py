"""fit.png: residuals beside the band of 95 %, measured and computed values in their order, curves with deviations."""

import numpy as np
import pytest
from scipy.stats import norm

from feti_homog.studies import pictures

ROWS = [
    {"test": 1, "name": "E1", "value": 4.0, "std": 0.5, "computed": 5.0, "residual": 2.0, "strain": None},
    {"test": 1, "name": "nu12", "value": 0.3, "std": 0.1, "computed": 0.2, "residual": -1.0, "strain": None},
    {"test": 2, "name": "E1", "value": 8.0, "std": 2.0, "computed": 7.0, "residual": -0.5, "strain": None},
]


def test_residuals_stand_in_the_rows_of_their_values_beside_the_band_of_95_percent():
    (axes,) = pictures.fit_figure({"name": "fit", "measured": ROWS}).axes
    (band,) = axes.patches
    assert band.get_extents().transformed(axes.transData.inverted()).intervalx == pytest.approx(
        norm.ppf([0.025, 0.975]), abs=5e-3
    )
    words = [label.get_text() for label in axes.get_yticklabels()]
    order = [part.strip() for part in axes.texts[0].get_text().split("/")]
    numbers = dict(zip(order, np.array([label.split()[1::2] for label in words], float).T, strict=True))
    assert [label.split()[0] for label in words] == [row["name"] for row in ROWS]
    assert numbers["measured"].tolist() == [4.0, 0.3, 8.0] and numbers["computed"].tolist() == [5.0, 0.2, 7.0]
    assert axes.get_xlabel() == "(computed - measured) / std"
    off = (numbers["computed"] - numbers["measured"]) / [row["std"] for row in ROWS]
    drawn = {line.get_label(): line.get_xydata().tolist() for line in axes.lines[1:]}
    assert drawn == {"test 1": [[off[0], 0.0], [pytest.approx(off[1]), 1.0]], "test 2": [[off[2], 2.0]]}
    assert axes.yaxis_inverted() and axes.lines[0].get_xdata() == [0.0, 0.0]
    heading, band = axes.texts
    assert (heading.get_text(), band.get_text()) == ("measured / computed", "grey: 95 %")
    figure = pictures.fit_figure({"name": "fit", "measured": ROWS, "unknowns": {"a": {"estimate": 2.0, "std": 0.25}}})
    assert figure.get_suptitle() == "fit: computed and measured\na = 2 ± 0.25 (std)"
    assert heading.get_window_extent().x1 < axes.get_window_extent().x0 < band.get_window_extent().x0


def test_curves_have_points_with_deviations_and_lines_through_what_is_computed():
    common = {"test": 3, "name": "S22", "strain_name": "E11", "residual": 0.0}
    rows = [
        common | {"strain": 0.1 * k, "value": 5.0 * k, "std": 1.0 + k, "computed": 6.0 * k} for k in (1.0, 2.0, 3.0)
    ]
    (axes,) = pictures.fit_figure({"name": "fit", "measured": rows}).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("macroscopic strain $E_{11}$", r"stress $\Sigma_{22}$")
    named = dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    np.testing.assert_allclose(named["test 3, computed"].get_xydata(), [[0.1, 6.0], [0.2, 12.0], [0.3, 18.0]])
    points, _, (bars,) = named["test 3, measured"]
    np.testing.assert_allclose(points.get_xydata(), [[0.1, 5.0], [0.2, 10.0], [0.3, 15.0]])
    np.testing.assert_allclose([segment[:, 1] for segment in bars.get_segments()], [[3, 7], [7, 13], [11, 19]])


def test_curves_of_results_are_whole_with_units():
    """Between the measured strains 0.1 and 0.2 the stress falls at the load of the break, from 8 to 2."""
    points = [
        {"load_factor": t, "broke": 0, "strain": [e, 0, 0], "stress": [0, s, 0]}
        for t, e, s in [(0.5, 0.1, 8.0), (1.0, 0.2, 4.0)]
    ]
    case = {
        "analysis": {"plane": "strain"},
        "path": {"strain": [0.2, 0, 0], "method": "events"},
        "output": {"stress_unit": "MPa"},
    }
    row = {"test": 1, "name": "S22", "strain_name": "E11", "residual": 0.0, "std": 1.0}
    rows = [row | {"strain": 0.1 * k, "value": 5.0, "computed": 8.0 / k} for k in (1.0, 2.0)]
    document = {"name": "fit", "measured": rows, "unknowns": {"material.fibre.E_axial": {"estimate": 2.0, "std": 0.25}}}
    figure = pictures.fit_figure(document, [{"case": case, "path": points}])
    assert figure.get_suptitle() == "fit: computed and measured\nmaterial.fibre.E_axial (MPa) = 2 ± 0.25 (std)"
    (axes,) = figure.axes
    assert axes.get_ylabel() == r"stress $\Sigma_{22}$ (MPa)"
    named = dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    np.testing.assert_allclose(named["test 1, computed"].get_xydata(), [[0, 0], [0.1, 8], [0.1, 2], [0.2, 4]])
