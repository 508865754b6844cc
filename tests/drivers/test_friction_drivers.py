"""The drivers of friction run, draw, and meet what Coulomb's law requires; a cycle that is killed goes on."""

import json

import numpy as np
import pytest
from support.base_case import with_lines
from support.command_line import in_process
from support.drivers import column, driven
from support.hooks import WAIT, Hook, HookedJob
from support.small_path import SHEET_PATH

CYCLES = with_lines(
    SHEET_PATH.replace('"stress"', '"strain"').replace("strain = [0.2, 0.0, 0.05]\n", "").replace("states = 8\n", ""),
    *("[cell] mesh_size = 0.15", "[interface] friction = 0.3", "[output] fields = false"),
    '[interface] debonded = [{fibre = "all", centre = 30.0, angle = 200.0}]',
    "[path] waypoints = [[-0.05, 0.0, 0.0], [-0.05, 0.0, 0.15], [-0.05, 0.0, -0.15], [-0.05, 0.0, 0.15]]",
)


def test_loops_scale_with_the_pressure(tmp_path):
    """Twice the pressure and the amplitude: four times the area, the same loss factor and modulus."""
    rows = driven("hysteresis", tmp_path)
    area, loss, modulus = (column(rows, name) for name in ("loop area", "loss factor", "secant modulus"))
    assert [(row["pressure"], row["amplitude"]) for row in rows[::3]] == [("10.0", "0.004"), ("20.0", "0.008")]
    # Smaller loops before have left some stress.
    assert area[3] == pytest.approx(4 * area[0], rel=1e-4) and (area > 0.0).all()
    assert (loss[3], modulus[3]) == pytest.approx((loss[0], modulus[0]), rel=1e-4)
    # Slip softens the cell.
    assert modulus[1] < modulus[0]


def test_friction_carries_shear_under_pressure(tmp_path):
    rows = driven("compression_shear", tmp_path)
    assert [row["friction"] for row in rows] == ["0.0", "0.0", "0.4", "0.4"]
    end, heat = column(rows, "S12 at end"), column(rows, "heat")
    assert end[2] > end[0] and np.abs(heat[:2]).max() == 0.0 < heat[2]


@pytest.mark.parametrize(("method", "kept"), [("events", 40), ("increments", 12)])
def test_a_path_killed_in_the_middle_of_a_cycle_goes_on_as_it_was(tmp_path, method, kept):
    """Between two changes of statuses, or steps, of the second half-cycle, with a history of slips."""
    steps = 'method = "increments"\nincrements = 20\n' if method == "increments" else ""
    (tmp_path / "case.toml").write_text(CYCLES.replace("[output]", f"{steps}[output]"))
    words = ("run", tmp_path / "case.toml", "--out")
    assert in_process(*words, tmp_path / "whole").returncode == 0
    there = Hook("feti_homog.results.checkpoints:Checkpoint.write", WAIT, when=f"args[1] == {kept - 1}", after=True)
    with HookedJob(0, [there], *words, tmp_path / "out") as job:
        assert job.reported() == "0 here"
        job.killed()
    assert in_process(*words, tmp_path / "out", "--resume").returncode == 0
    found, whole = (json.loads((tmp_path / name / "result.json").read_text()) for name in ("out", "whole"))
    last = whole["path"][found["resumed"] - 1]
    assert found["resumed"] == kept and 0.5 < last["load_factor"] < 0.75 and last["broke"] == 0
    for key in ("load_factor", "stress", "strain", "friction_heat", "work", "broke", "open"):
        a, b = (np.array([point[key] for point in of["path"]], float) for of in (found, whole))
        np.testing.assert_allclose(a, b, atol=1e-9 * np.abs(b).max(), err_msg=key)
