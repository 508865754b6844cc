"""The comparison of cells with closed estimates obeys the laws that need no numbers of its own."""

import numpy as np
from support.command_line import assert_verified
from support.drivers import column, driven


def test_cells_lie_where_theory_wants_them(tmp_path):
    rows = driven("micromechanics", tmp_path, "--fields")
    for fraction in ("0.3", "0.5"):
        found = {row["geometry or method"]: row for row in rows if row["fibre_fraction"] == fraction}
        value = {name: {key: float(row[key]) for key in row if "_" in key} for name, row in found.items()}
        hexagonal, cylinders, shear = value["hexagonal"], value["composite_cylinders"], "G_transverse"
        # Mori and Tanaka's moduli are the lower bounds of stiff fibres; fractions of coarse meshes differ by 1e-5.
        for name in ("E_axial", "G_axial", shear):
            assert (1.0 - 1e-4) * value["mori_tanaka"][name] < hexagonal[name], name
        # Hexagonal cells are next to composite cylinders where these are exact.
        for name in ("E_axial", "nu_axial", "expansion_axial", "expansion_transverse"):
            assert abs(hexagonal[name] / cylinders[name] - 1.0) < 2e-3, name
        assert hexagonal[shear] < value["self_consistent"][shear] < 1.1 * hexagonal[shear]
        # Uniform fields: Hill's relation holds between any two arrangements.
        a, b = (value[name] for name in ("hexagonal", "random"))
        assert abs(a["E_axial"] / b["E_axial"] - 1.0) < 1e-3
    assert np.isnan(column([found["chamis"]], "G_axial")).sum() == 0
    assert_verified(*(path.parent for path in tmp_path.glob("*/result.h5")))
