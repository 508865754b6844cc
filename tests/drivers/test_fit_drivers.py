"""The fits of the drivers return what their data were made of."""

import re

import pytest
from support.jobs import ROOT, mpirun

TRUTH = {
    "carbon_fibre": {"E_transverse": 14.0, "nu_transverse": 0.25, "G_axial": 28.0},
    "interface_toughness": {"toughness": 2.0, "strength in opening": 90.0},
}


@pytest.mark.parametrize("driver", TRUTH)
def test_estimates_are_what_the_data_were_made_of(tmp_path, driver):
    job = mpirun(0, ROOT / f"drivers/{driver}.py", "--out", tmp_path, "--quick")
    assert job.returncode == 0, job.stderr
    rows = re.findall(r"^(\w[\w ]*?) +[\d.]+ +([\d.]+)(?: +\S+)?$", job.stdout, re.MULTILINE)
    found = {name: float(value) for name, value in rows}
    assert {name: found[name] for name in TRUTH[driver]} == pytest.approx(TRUTH[driver], rel=3e-3)
