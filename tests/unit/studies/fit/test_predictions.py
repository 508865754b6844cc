"""Values of results in place of measured ones: none where nothing happened, and no closed form beyond its law."""

from __future__ import annotations

import copy

import pytest

from feti_homog import run
from feti_homog.case.case import Case
from feti_homog.errors import CaseError
from feti_homog.studies.fit.predictions import Datum, exact_derivatives, predicted, responses

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
        assert exact_derivatives(document, [data[name]], "interface.normal_strength") is None
