"""The driver of coated fibres: composite cylinders are met, results obey every law."""

import csv

import numpy as np
from matplotlib.image import imread
from support.command_line import assert_verified
from support.jobs import ROOT, mpirun


def test_the_driver_meets_composite_cylinders(tmp_path):
    job = mpirun(2, ROOT / "drivers/coated_fibres.py", "--out", tmp_path / "out", "--quick", "--fields")
    assert job.returncode == 0, job.stderr
    with (tmp_path / "out/coated_fibres.csv").open(newline="") as stream:
        ratio, bulk, cylinders, shear, inner, outer = np.array(list(csv.reader(stream))[1:], float).T
    assert np.abs(bulk / cylinders - 1).max() < 2e-3 and np.all(np.diff(shear) > 0)
    # A soft coating shields both of its faces.
    assert inner[0] > inner[1] and outer[0] > outer[1] and ratio[1] < 1 < ratio[2]
    assert imread(tmp_path / "out/coated_fibres.png")[..., :3].std() > 0.05
    assert_verified(tmp_path / "out/bonded-2.85", tmp_path / "out/fibre-2.85")
