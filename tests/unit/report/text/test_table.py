"""Tables as HTML: the decimals of text, and errors however small."""

from feti_homog.report.text.stiffness_tables import moduli, stiffnesses
from feti_homog.report.text.tables import Column, Table


def test_html_has_the_decimals_of_text_and_small_errors():
    columns = [Column(""), Column("stiffness", 12, ".3f"), Column("value"), Column("error", 12, ".1e")]
    table = Table("t", columns, [["S11", 12.34567, 12.34567891, 4.6e-13], ["S12", 1e-6, 1e-15, 0.0], ["n", 3]])
    assert table.cells == [["S11", "12.346", "12.34568", "4.6e-13"], ["S12", "0.000", "0", "0.0e+00"], ["n", "3"]]


def test_the_error_of_the_mesh_gives_the_digits_of_a_constant():
    document = {
        "case": {"output": {"stress_unit": "GPa"}},
        "effective_stiffness": [[11.8501, 5.4, 1e-6], [5.4, 11.85, 0.0], [1e-6, 0.0, 3.2]],
        "moduli": {"E1": 9.379948, "nu12": 0.4565729, "G12": 3.220756},
        "mesh_error": {"constants": {"E1": 0.01234347, "nu12": 0.0008491602}},
    }
    table = moduli(document)
    assert table.cells == [["E1", "9.380", "+- 0.012"], ["nu12", "0.45657", "+- 0.00085"], ["G12", "3.220756", ""]]
    assert stiffnesses(document)[0].cells[2] == ["S12", "0.000001", "0.000000", "3.200000"]


def test_rows_abreast_and_columns_in_blocks():
    rows = [["a", 1, "+- 2"], ["bc", 3, ""], ["d", 5, "+- 6"]]
    columns = [Column("", -4, indent=0), Column("value", 6, "d"), Column("error", -6, indent=1)]
    assert Table("t", columns, rows, ["above"], ["below"], abreast=2).lines == [
        "t", "above", "  a        1 +- 2     bc       3", "  d        5 +- 6", "below",
    ]  # fmt: skip
    table = Table("t", [Column("", -4), *map(Column, "xyz")], [["p", 1, 2, "-"], ["q", "-", "-", 3]], most_columns=2)
    assert [line.split() for line in table.lines] == [["t"], ["x", "y"], ["p", "1", "2"], ["z"], ["q", "3"]]
    assert table.cells == [["p", "1", "2", "-"], ["q", "-", "-", "3"]] and table.html.count("<tr>") == 3


def test_notes_stand_in_the_caption():
    html = Table("t", [Column("x")], [[1]], ["a < b"], ["c"]).html
    assert "<caption>t<small>a &lt; b</small><small>c</small></caption>" in html
