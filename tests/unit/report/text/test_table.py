"""Tables as HTML: the decimals of text, and errors however small."""

from __future__ import annotations

from feti_homog.report.text.stiffness_tables import moduli, stiffnesses
from feti_homog.report.text.table import Column, Table


def test_html_has_the_decimals_of_text_and_small_errors():
    columns = [Column(""), Column("stiffness", 12, ".3f"), Column("value"), Column("error", 12, ".1e")]
    table = Table("t", columns, [["S11", 12.34567, 12.34567891, 4.6e-13], ["S12", 1e-6, 1e-15, 0.0], ["n", 3]])
    assert table.cells == [["S11", "12.346", "12.34568", "4.6e-13"], ["S12", "0.000", "0", "0.0e+00"], ["n", "3"]]


def test_the_error_of_the_mesh_gives_the_digits_of_a_constant():
    document = {
        "effective_stiffness": [[11.8501, 5.4, 1e-6], [5.4, 11.85, 0.0], [1e-6, 0.0, 3.2]],
        "moduli": {"E1": 9.379948, "nu12": 0.4565729, "G12": 3.220756},
        "mesh_error": {"constants": {"E1": 0.01234347, "nu12": 0.0008491602}},
    }
    (table,) = moduli(document, "GPa")
    assert table.cells == [["E1 (GPa)", "9.380", "0.012"], ["nu12", "0.45657", "0.00085"], ["G12 (GPa)", "3.220756"]]
    assert stiffnesses(document, "")[0].cells[2] == ["S12", "0.000001", "0.000000", "3.200000"]
