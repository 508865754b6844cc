"""Titles of the curves of a sweep: realisations and bands are named where there are some."""

from __future__ import annotations

import pytest

from feti_homog.studies.sweep.report import figures
from feti_homog.studies.sweep.report.outputs import outputs
from feti_homog.studies.sweep.report.sweep_table import SweepTable

WORDS = {1: "test: stress along the paths", 2: "test: realisations and their mean; band: range of the realisations"}


def path_document():
    points = [
        {"load_factor": t, "strain": [0.2 * t, 0, 0], "stress": [8.0 * t, t, 0.0], "broke": 1, "dissipated": 0.1,
         "work": 0.3, "bonded": 9, "open": 1, "closed": 0}
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
    documents = [path_document()] * realisations
    table = SweepTable(
        name="test", stress_unit="GPa", folder=["case"] * realisations, point=[1] * realisations,
        realisation=[*range(1, realisations + 1)], status=["done"] * realisations, reason=[""] * realisations,
        inputs={"cell.seed": [*range(realisations)]}, documents=documents, outputs=outputs(documents[0]),
    )  # fmt: skip
    assert figures.curves_figure(table).get_suptitle() == WORDS[realisations]
