"""Values of results in place of measured ones: none where nothing happened, derivatives where a law is exact."""

import copy

import numpy as np
import pytest
from scipy.stats import norm

from feti_homog import run
from feti_homog.case.cases import Case
from feti_homog.errors import CaseError
from feti_homog.studies import pictures
from feti_homog.studies.predictions import Datum, exact_derivatives, predicted, responses

CASE = {
    "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.5, "order": 1},
    "material": {"matrix": {"young": 3.0, "poisson": 0.35}, "fibre": {"young": 70.0, "poisson": 0.2}},
    "analysis": {"type": "path", "plane": "strain"},
    "path": {"strain": [0.01, 0.0, 0.0]},
    "interface": {"normal_strength": 1.0},
    "output": {"pictures": False},
}


def test_a_path_without_a_break_has_no_onset():
    """The largest stress is that at the end of the load, which does not grow with the strength."""
    document = run(Case.parse(copy.deepcopy(CASE))).document
    data = {name: Datum(0, name, 1.0, 0.1) for name in ("onset_S11", "peak_S11", "peak_E11")}
    with pytest.raises(CaseError, match=r"\[measured\] onset_S11: this result has no such value; no bond breaks"):
        predicted(document, [data["onset_S11"]])
    assert not [name for name in responses(document) if name.startswith("onset_")]
    for name in ("peak_S11", "peak_E11"):
        with pytest.raises(CaseError, match=rf"{name}: .*; the path ends before its stress falls: load it further"):
            predicted(document, [data[name]])
        assert exact_derivatives(document, [data[name]], "interface.normal_strength") is None


def broken(**bond):
    """Return the result of a path on which bonds break."""
    return run(Case.parse(copy.deepcopy(CASE) | {"interface": bond, "path": {"strain": [0.8, 0.0, 0.2]}})).document


def test_the_only_strength_scales_the_load_of_onset_and_one_of_two_does_not():
    """Twice the only strength is twice the onset; one of two alone has no closed form, and both together have."""
    data = [Datum(0, name, 1.0, 0.1) for name in ("onset_S11", "onset_E11")]
    one, twice = (predicted(broken(normal_strength=R), data) for R in (1.0, 2.0))
    assert twice == pytest.approx(2 * one)
    alone = broken(normal_strength=2.0)
    slopes = exact_derivatives(alone, data, "interface.normal_strength")
    assert slopes == pytest.approx(one) and 2.0 * slopes == pytest.approx(twice)
    assert exact_derivatives(alone, data, "interface.tangential_strength") is None
    peak = [Datum(0, "peak_S11", 1.0, 0.1)]
    assert predicted(alone, peak) == pytest.approx(responses(alone)["peak_S11"])
    both = broken(normal_strength=1.0, tangential_strength=0.1)
    assert (predicted(both, data) < 0.9 * one).all()
    for name in ("normal_strength", "tangential_strength"):
        assert exact_derivatives(both, data, f"interface.{name}") is None
    numbers = {"normal_strength": 1.0, "tangential_strength": float("inf")}
    assert exact_derivatives(broken(**numbers), data, "interface.normal_strength") == pytest.approx(one)


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
