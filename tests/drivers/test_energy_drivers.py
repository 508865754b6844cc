"""The drivers of debonding by energy run, draw, and meet what is known exactly."""

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
    # Each debond runs on where the bonds were pulled most, towards the flanks, which are pressed.
    angle = column(rows, "debonding angle")
    assert 0.0 < angle[0] < angle[1] < 90.0


def test_curves_by_energy_that_is_released_depend_little_on_the_mesh(tmp_path):
    rows = driven("mesh_objectivity", tmp_path)
    coarse, fine = ({row["bonds"]: row for row in rows[start::2]} for start in (0, 1))
    for bonds in ("springs", "released"):
        assert float(fine[bonds]["onset S11"]) == pytest.approx(ONSET_STRESS, rel=2e-3)
    spread = {b: abs(float(coarse[b]["S11 at 1.5"]) / float(fine[b]["S11 at 1.5"]) - 1.0) for b in fine}
    assert spread["released"] < 0.05 < spread["springs"] < spread["strength"]


def test_a_cohesive_law_beside_brittle_bonds(tmp_path):
    rows = driven("cohesive_fibre", tmp_path, "--table")
    onset, teeth = column(rows, "onset S11"), column(rows, "teeth")
    assert [row["law"] for row in rows[:3]] == ["strength", "released", "bilinear"]
    # On the same mesh with two numbers of teeth: the first exceeds the peak by rho^(1 / 2 n), rho = 2 K G / N^2.
    rho = 2 * 1e4 * 2 / 60**2
    assert teeth[2] == 2 and teeth[4] == 4
    assert onset[2] / onset[4] == pytest.approx(rho ** (1 / 8), rel=1e-9)
    # The last row is that of a prototype with other triangles: first event, then where debonding is stable.
    assert onset[-1] == pytest.approx(49.723, rel=0.01)
    at = [float(rows[-1][f"S11 at {x:g}"]) for x in (0.6, 0.8, 1.0, 1.5, 2.0, 3.0)]
    np.testing.assert_allclose(at, [27.27, 26.27, 26.68, 29.94, 35.66, 49.97], rtol=0.03)
    # Twice the toughness holds more bonds at the same strength.
    assert rows[3]["toughness"] == "2.0" and float(rows[3]["debonding angle"]) < float(rows[2]["debonding angle"])


def of_its_path(row, folder, component, name=""):
    """Return the result in a folder.

    Its path has the first break and, where its load is the highest so far, the peak.
    """
    result = json.loads((folder / "result.json").read_text())
    load, stress = np.array([[point["load_factor"], point["stress"][component]] for point in result["path"]]).T
    first = next(k for k, point in enumerate(result["path"]) if point["broke"] + point.get("softened", 0))
    assert float(row[f"first break{name}"]) == pytest.approx(stress[first])
    assert float(row[f"peak{name}"]) == pytest.approx(stress[load >= np.maximum.accumulate(load)].max())
    assert result["status"] == "done"
    return result


@pytest.mark.parametrize("law", ["energy", "bilinear"])
def test_cells_of_random_fibres_scatter(tmp_path, law):
    rows = driven("transverse_strength", tmp_path, "--law", law)
    assert float(rows[0]["peak S11"]) != float(rows[1]["peak S11"])
    for row, folder in zip(rows, sorted(tmp_path.glob("seed_*")), strict=True):
        result = of_its_path(row, folder, 0, " S11")
        assert ("softened" in result["path"][0]) == (law == "bilinear")


def test_plies_break_by_tension_across_and_by_shear_along_the_fibres(tmp_path):
    rows = driven("ply_strength", tmp_path, "--temperatures", "0", "-80")  # which --quick leaves as they are
    assert [(row["test"], float(row["temperature"])) for row in rows] == [
        ("tension", 0.0),
        ("tension", -80.0),
        ("shear", 0.0),
        ("shear", -80.0),
    ]
    modulus = column(rows, "modulus")
    # Until a bond breaks the temperature changes no stiffness.
    assert modulus[0] == pytest.approx(modulus[1], rel=1e-6) and modulus[2] == pytest.approx(modulus[3], rel=1e-6)
    folders = [tmp_path / f"{row['test']}_{float(row['temperature']):g}K" for row in rows]
    component = {"tension": 1, "shear": 3}
    results = [of_its_path(row, folder, component[row["test"]]) for row, folder in zip(rows, folders, strict=True)]
    cooled = [result for result in results if len(result["case"]["path"]["waypoints"]) == 2]
    assert all(result["path"][-1]["temperature"] == -80.0 for result in cooled)
