"""The drivers of debonding by energy run, draw, and meet what is known exactly."""

from __future__ import annotations

import json

import numpy as np
import pytest
from reference.references import GLASS_EPOXY_ONSET
from support.drivers import column, driven

# MPa: S11 of the square cell of `mesh_objectivity`, in which fibres are as far apart as they can be.
ONSET_STRESS = GLASS_EPOXY_ONSET.value[1]


def test_small_fibres_are_stronger_by_energy(tmp_path):
    rows = driven("energy_debonding", tmp_path)
    onset, exact = column(rows, "onset"), column(rows, "exact onset")
    assert np.abs(onset / exact - 1.0).max() < 0.01
    assert onset[0] > 1.1 * onset[1]
    angle = column(rows, "debonding angle")
    assert (angle > 20.0).all() and (angle < 80.0).all() and angle[0] < angle[1]


def test_curves_by_energy_that_is_released_depend_little_on_the_mesh(tmp_path):
    rows = driven("mesh_objectivity", tmp_path)
    coarse, fine = ({row["bonds"]: row for row in rows[start::2]} for start in (0, 1))
    for bonds in ("springs", "released"):
        assert float(fine[bonds]["onset S11"]) == pytest.approx(ONSET_STRESS, rel=2e-3)
    spread = {b: abs(float(coarse[b]["S11 at 1.5"]) / float(fine[b]["S11 at 1.5"]) - 1.0) for b in fine}
    assert spread["released"] < 0.05 < spread["springs"] < spread["strength"]


def test_cells_of_random_fibres_scatter(tmp_path):
    rows = driven("transverse_strength", tmp_path)
    peak, first = column(rows, "peak S11"), column(rows, "first break S11")
    assert (peak >= first).all() and (peak > 40.0).all() and (peak < 100.0).all() and peak[0] != peak[1]
    results = [json.loads(path.read_text()) for path in tmp_path.glob("seed_*/result.json")]
    assert len(results) == 2 and all(result["status"] == "done" for result in results)


def test_plies_break_by_tension_across_and_by_shear_along_the_fibres(tmp_path):
    rows = driven("ply_strength", tmp_path)
    assert [(row["test"], float(row["temperature"])) for row in rows] == [
        ("tension", 0.0),
        ("tension", -100.0),
        ("shear", 0.0),
        ("shear", -100.0),
    ]
    modulus, peak = column(rows, "modulus"), column(rows, "peak")
    # Until a bond breaks the temperature changes no stiffness.
    assert modulus[0] == pytest.approx(modulus[1], rel=1e-6) and modulus[2] == pytest.approx(modulus[3], rel=1e-6)
    assert (peak > 40.0).all() and (peak < 150.0).all()
    results = [json.loads(path.read_text()) for path in tmp_path.glob("*K/result.json")]
    assert len(results) == 4 and all(result["status"] == "done" for result in results)
    cooled = [result for result in results if len(result["case"]["path"]["waypoints"]) == 2]
    assert all(result["path"][-1]["temperature"] == -100.0 for result in cooled)
