"""The fit of a carbon fibre to plies returns the fibre of which they were made."""

from __future__ import annotations

import re

import pytest
from support.jobs import ROOT, mpirun


def test_the_fibre_is_that_of_the_plies(tmp_path):
    job = mpirun(0, ROOT / "drivers/carbon_fibre.py", "--out", tmp_path, "--quick")
    assert job.returncode == 0, job.stderr
    found = {
        name: float(value) for name, value in re.findall(r"^(\w+) +[\d.]+ +([\d.]+) +\S+$", job.stdout, re.MULTILINE)
    }
    truth = {"E_transverse": 14.0, "nu_transverse": 0.25, "G_axial": 28.0}
    assert {name: found[name] for name in truth} == pytest.approx(truth, rel=3e-3)
