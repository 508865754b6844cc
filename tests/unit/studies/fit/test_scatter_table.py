"""The table of a study of scatter: results have their units."""

from __future__ import annotations

from feti_homog.studies.uncertainty.scatter_table import text


def test_stresses_have_their_unit_and_strains_none():
    scatter = {
        "value": 30.0,
        "std_inputs": 3.0,
        "mesh_error": None,
        "std": 3.0,
        "shares": [1.0],
        "derivative_errors": None,
    }
    document = {
        "stress_unit": "MPa", "cells": 1, "parameters": [{"name": "material.matrix.young", "by": "differences"}],
        "results": [scatter | {"name": name} for name in ("onset_S11", "peak_E11", "E_axial")],
    }  # fmt: skip
    rows = [line.split("  ")[1] for line in text(document).splitlines() if " 30 " in line]
    assert rows == ["onset_S11 (MPa)", "peak_E11", "E_axial (MPa)"]
    del document["stress_unit"]  # as files of earlier versions
    assert "onset_S11  " in text(document)
