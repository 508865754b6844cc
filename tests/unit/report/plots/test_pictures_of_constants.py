"""The picture of sensitivities, a heat map."""

import numpy as np

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
