"""The drivers of friction run, draw, and meet what Coulomb's law requires."""

from __future__ import annotations

import numpy as np
import pytest
from support.drivers import column, driven


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
