"""Values of results in place of measured ones: none where nothing happened, derivatives where a law is exact."""

import copy

import pytest

from feti_homog import run
from feti_homog.case.cases import Case
from feti_homog.errors import CaseError
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
