"""The picture of sensitivities, a heat map."""

import numpy as np
import pytest

from feti_homog.report.plots import response_curves


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


@pytest.mark.parametrize(("constants", "head"), [(["C33"], "C33 (gamma12)"), (["C33", "C66"], "C33")])
def test_the_third_entry_is_a_shear_in_the_plane_alone(constants, head) -> None:
    count = len(constants)
    found = {
        "parameters": ["material.fibre.young"], "parameter_values": [2.0],
        "constants": constants, "constant_values": [1.0] * count, "derivatives": [[0.5]] * count,
    }  # fmt: skip
    picture = response_curves.sensitivities({"case": {}, "sensitivities": found})
    assert picture is not None and picture.axes[0].get_xticklabels()[0].get_text() == head


def test_angles_name_the_shear() -> None:
    points = [{"angle": angle, "stiffness": np.diag([3.0, 2.0, 1.0]).tolist()} for angle in (0.0, 90.0)]
    case = {"name": "a", "analysis": {"plane": "strain"}, "interface": {"contact": True}}
    lines = response_curves.angle({"case": case, "angle": points}).axes[0].lines[:4]
    assert [line.get_label() for line in lines] == [
        "$C_{11}$", "$C_{22}$", "$C_{12}$", r"$C_{33}$ ($\gamma_{12}$)",
    ]  # fmt: skip


def test_stiffnesses_in_space_are_relative_so_that_none_is_flat() -> None:
    first = np.arange(1.0, 37.0).reshape(6, 6)
    points = [{"angle": angle, "stiffness": (share * first).tolist()} for angle, share in ((0.0, 1.0), (90.0, 0.5))]
    case = {"name": "a", "analysis": {"plane": "generalized"}, "output": {"stress_unit": "GPa"}}
    axes = response_curves.angle({"case": case, "angle": points}).axes[0]
    assert axes.get_ylabel() == "stiffness / stiffness at 0 degrees"
    assert [line.get_label() for line in axes.lines[1:3]] == ["$C_{22}$, 8 GPa", "$C_{33}$, 15 GPa"]
    assert all(list(line.get_ydata()) == [1.0, 0.5] for line in axes.lines[:7])
