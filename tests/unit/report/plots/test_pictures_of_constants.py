"""Pictures of thermal expansion and of sensitivities: sums of states, and a heat map."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from feti_homog.report.plots import response_curves
from feti_homog.report.plots.decimation import FreeExpansion

EXPANSION = [3e-5, 2e-5, 1e-5, 0.0, 0.0, 4e-6]


@pytest.fixture
def states(tmp_path: Path) -> Any:
    """Seven unit loads and the last of minus one; displacements of a cell of one material, u = H x."""
    points = np.random.default_rng(1).random((9, 2))
    in_plane = [(1, 0, 0, 0), (0, 0, 0, 1), *[(0, 0, 0, 0)] * 3, (0, 0.5, 0.5, 0), (0, 0, 0, 0)]
    with h5py.File(tmp_path / "result.h5", "w") as file:
        file["points"] = points
        for number in range(8):
            group = file.create_group(f"state/{number}")
            loads = np.zeros(7)
            loads[min(number, 6)] = 1.0 if number < 7 else -1.0
            group.attrs.update(strain=loads[:6], temperature=loads[6], label="a load")
            group["displacement"] = points @ np.reshape(in_plane[min(number, 6)], (2, 2))
            group["status"] = np.full(3, min(number, 2), np.int8)
        yield file


def test_free_expansion_superposes_unit_loads(states: Any) -> None:
    found = FreeExpansion.of(states["state/6"], {"thermal_expansion": EXPANSION})
    assert found is not None
    expected = states["points"][()] @ np.array([[3e-5, 2e-6], [2e-6, 2e-5]])
    np.testing.assert_allclose(found["displacement"][2:5], expected[2:5], rtol=1e-12)
    assert len(found["displacement"]) == 9 and found["status"][:].tolist() == [2, 2, 2]
    assert found.attrs["strain"].tolist() == EXPANSION and "damage" not in found


@pytest.mark.parametrize("number", [0, 7])
def test_other_states_are_drawn_as_they_are(states: Any, number: int) -> None:
    assert FreeExpansion.of(states[f"state/{number}"], {"thermal_expansion": EXPANSION}) is None
    assert FreeExpansion.of(states["state/6"], {}) is None


def test_without_a_unit_load_the_cell_is_held(states: Any) -> None:
    del states["state/1"]
    assert FreeExpansion.of(states["state/6"], {"thermal_expansion": EXPANSION}) is None


def test_heat_map_has_the_elasticities() -> None:
    """C11 = 3 p^2 q^0, of which the elasticities are 2 and 0; nothing follows of a constant that is zero."""
    found = {
        "parameters": ["material.matrix.young", "material.$.poisson"], "parameter_values": [2.0, 0.3],
        "constants": ["C11", "C12"], "constant_values": [12.0, 0.0], "derivatives": [[12.0, 0.0], [1.0, 0.0]],
    }  # fmt: skip
    picture = response_curves.sensitivities({"case": {"name": "a $"}, "sensitivities": found})
    assert picture is not None
    axes = picture.axes[0]
    assert [text.get_text() for text in axes.texts] == ["2.00", "-", "", "-"]
    assert [label.get_text() for label in axes.get_xticklabels()] == ["C11", "C12"]
    np.testing.assert_allclose(np.ma.filled(axes.images[0].get_array(), np.nan)[:, 0], [2.0, 0.0])
    assert response_curves.sensitivities({"case": {}}) is None
