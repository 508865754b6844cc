"""moduli.png of a sweep: marks, bars, bounds and series."""

from __future__ import annotations

import moduli_picture
import numpy as np
import pytest
from matplotlib.image import imread
from support.sweep_tables import collected, document, fractions, spatial_document

from feti_homog import FetiHomogError


@pytest.mark.slow
def test_moduli_are_drawn(tmp_path):
    assert_drawn(tmp_path, fractions())
    waiting = collected({"cell.fibre_fraction": [0.1, 0.2]}, [None] * 2, [1, 2], [1] * 2)
    for table in (collected({"cell.order": [1]}, [document(0.4, 8, 0)], [1], [1]), waiting):
        with pytest.raises(FetiHomogError, match="fewer than two fibre fractions"):
            moduli_picture.draw(tmp_path, table)


def test_bars_are_the_mean_errors_of_the_mesh():
    errors = ({"constants": {"bulk": error, "nu31": 1.0}, "energy": 0.01} for error in (2.0, 4.0, 1.0, 3.0))
    documents = [document(c, 8, shift) for shift in (0.0, 1.0) for c in (0.2, 0.4)]
    documents = [each | {"mesh_error": error} for each, error in zip(documents, errors, strict=True)]
    table = collected({"cell.fibre_fraction": [0.2, 0.4] * 2}, documents, [1, 2] * 2, [1, 1, 2, 2])
    assert "nu31_mesh_error" not in table.outputs  # of a constant that has no column
    panel = (figure := moduli_picture.moduli_figure(table)).axes[moduli_picture.PANELS.index("bulk")]
    assert {"realisations", "95 % confidence of the mean"} <= {each.get_text() for each in figure.legends[0].texts}
    (bars,) = (each for each in panel.containers if each.get_label() == "estimated error of the mesh")
    (ends,) = (lines.get_segments() for lines in bars.lines[2])
    assert [end[:, 1].tolist() for end in ends] == [pytest.approx([96.0, 99.0]), pytest.approx([106.0, 113.0])]


def assert_drawn(folder, table):
    path = moduli_picture.draw(folder, table)
    picture = imread(path)
    assert path == folder / "moduli.png" and min(picture.shape[:2]) > 500 and picture[..., :3].std() > 0.03


def test_bounds_in_space_enclose_each_other_and_what_is_between():
    """At any fraction the tighter ones lie between Reuss and Voigt; all meet where there is one phase."""
    documents = [spatial_document(c, 0.0) for c in (0.2, 0.6)]
    bounds = moduli_picture.moduli_bounds(collected({"cell.fibre_fraction": [0.2, 0.6]}, documents, [1, 2], [1, 1]))
    assert bounds.tight == "Hill, Hashin" and bounds.fractions[0] == 0.0
    for rows in bounds.rows.values():
        assert (rows[1] >= rows[0] * (1 - 1e-12)).all() and np.ptp(rows[:, 0]) < 1e-9 * rows[0, 0]
        if len(rows) == 4:
            assert (rows[0] <= rows[2] * (1 + 1e-12)).all() and (rows[2] <= rows[3] * (1 + 1e-12)).all()
            assert (rows[3] <= rows[1] * (1 + 1e-12)).all()
    assert [len(rows) for rows in bounds.rows.values()] == [4, 2, 4, 4]


def test_secants_in_space_are_drawn_without_bounds(tmp_path):
    documents = [spatial_document(c, 0.0) for c in (0.2, 0.4)]
    for each in documents:
        del each["constants"], each["transversely_isotropic"]
    table = collected({"cell.fibre_fraction": [0.2, 0.4]}, documents, [1, 2], [1, 1])
    assert moduli_picture.panels_of(table) == ("C11", "C33", "C44", "C66")
    assert (
        moduli_picture.moduli_figure(table).get_suptitle().endswith("plane generalized; no bounds, for faces may touch")
    )
    assert_drawn(tmp_path, table)


def test_what_varies_along_is_no_other_series():
    documents = [document(0.4, fibres, 0.0) for fibres in (4, 8, 4, 8)]
    inputs = {"cell.fibres": [4, 8, 4, 8], "cell.mesh_size": [0.3, 0.2, 0.3, 0.2], "material.fibre.young": [1, 1, 2, 2]}
    found = moduli_picture.series_over(collected(inputs, documents, [1, 2, 3, 4], [1] * 4), "cell.fibres")
    assert [(one.label, one.points, one.x.tolist()) for one in found] == [
        ("fibre young 1 GPa", [1, 2], [4.0, 8.0]), ("fibre young 2 GPa", [3, 4], [4.0, 8.0]),
    ]  # fmt: skip


def test_stiffnesses_in_space_are_drawn(tmp_path):
    documents = [spatial_document(c, shift) for shift in (0.0, 1.0) for c in (0.2, 0.4)]
    table = collected({"cell.fibre_fraction": [0.2, 0.4] * 2, "cell.seed": [0, 0, 1, 1]}, documents, [1, 2] * 2, [1, 2])
    assert moduli_picture.panels_of(table) == ("E_axial", "E_transverse", "G_axial", "G_transverse")
    assert_drawn(tmp_path, table)
