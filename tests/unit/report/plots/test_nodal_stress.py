"""Stresses at the nodes of pictures."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from support.sample_output import in_space, sample, write

from feti_homog.report.plots import plot_helpers
from feti_homog.report.plots.drawn_cell import DrawnCell


@pytest.mark.parametrize(
    ("stress", "S33", "axial", "expected"),
    [
        ([3.0, 0.0, 0.0], 0.0, None, 3.0),
        ([0.0, 0.0, 2.0], 0.0, None, 2.0 * np.sqrt(3.0)),
        ([5.0, 5.0, 0.0], 5.0, [0.0, 0.0], 0.0),
        ([0.0, 0.0, 0.0], 0.0, [3.0, -4.0], 5.0 * np.sqrt(3.0)),
    ],
)
def test_a_uniform_stress_has_its_von_mises_stress(
    tmp_path: Path, stress: list[float], S33: float, axial: list[float] | None, expected: float
) -> None:
    with h5py.File(write(tmp_path, sample(3) if axial is None else in_space(sample(3))), "r+") as file:
        state, values = file["state/1"], {"stress": stress, "stress_33": S33, "axial_stress": axial}
        for name, value in values.items():
            if value is not None:
                state[name][:] = value
        drawn = DrawnCell.of(file).drawn
        np.testing.assert_allclose(plot_helpers.nodal_stress(state, "von_mises", drawn), expected, atol=1e-12)
