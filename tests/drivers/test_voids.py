"""Stiffness and onset of debonding over the porosity."""

import csv

import numpy as np
from matplotlib.image import imread
from support.command_line import assert_verified
from support.jobs import ROOT, mpirun


def test_voids_soften_as_mori_and_tanaka_say(tmp_path):
    """From below, as for stiff fibres, by less than a fifth; all folders are verified."""
    job = mpirun(2, ROOT / "drivers/voids.py", "--out", tmp_path / "out", "--quick", "--fields")
    assert job.returncode == 0, job.stderr
    with (tmp_path / "out/voids.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["porosity"]) for row in rows] == [0.0, float(rows[1]["porosity"])]
    for row in rows:
        for name in ("K", "G"):
            assert 1.0 < float(row[name]) / float(row[f"{name} Mori-Tanaka"]) < 1.2, (row["porosity"], name)
    assert all(float(rows[1][name]) < float(rows[0][name]) for name in ("K", "G"))
    assert np.std(imread(tmp_path / "out/voids.png")[..., :3]) > 0.05
    assert_verified(*(path.parent for path in (tmp_path / "out").glob("*/result.h5")))
