"""Tables of constants in space have all that is computed, and nothing else."""

import pytest

from feti_homog.report.text.stiffness_tables import constants

CELL = {"E_axial": 41.7, "G_transverse": 3.7, "expansion_axial": None, "deviation": 0.002}
AXES = dict.fromkeys(("E1", "E2", "E3", "nu12", "nu13", "nu23", "G12", "G13", "G23"), 1.5)


def test_the_range_over_directions_stands_above_the_table_if_there_is_one():
    assert constants({"case": {}}) == []
    across = {"E_least": 9.81, "E_largest": 10.93, "G_least": 3.3, "G_largest": 3.82}
    (table,) = constants({"case": {}, "transversely_isotropic": CELL, "transverse_moduli": across})
    assert table.lines[1] == "  over all directions across: E from 9.81 to 10.93, G from 3.3 to 3.82"


def test_a_row_for_each_source_and_a_column_for_each_constant_that_one_knows():
    estimates = {"halpin_tsai": {"E_axial": 41.6, "G_transverse": None}, "chamis": {"E_axial": None}}
    document = {"constants": AXES, "transversely_isotropic": CELL, "estimates": estimates}
    document["fibre_bounds"] = {"E_axial": [40.0, 43.0], "nu_axial": None}
    document["case"] = {"output": {"stress_unit": "GPa"}}
    axes, table = (each.lines for each in constants(document))
    assert len(axes) == 4 and axes[0].endswith("(GPa)")
    assert "0.2 %" in table[0] and table[1].split() == ["E_axial", "G_transverse"]
    assert [line.split()[-2:] for line in table[2:-1]] == [
        ["41.7", "3.7"], ["41.6", "-"], ["40", "-"], ["43", "-"],
    ]  # fmt: skip
    assert len({len(line) for line in table[1:-1]}) == 1
    assert table[-1].strip().startswith("-: not available from this method")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"case": {"material": {"coating": {}}}}, "fibres without coatings"),
        ({"cell": {"porosity": 0.1}}, "cells without voids"),
        ({"case": {"interface": [{}, {}]}}, "round fibres that are bonded, all alike"),
        ({"cell": {"fractions": {"matrix": 1.0}}}, "composites"),
        ({}, "round fibres"),
    ],
)
def test_a_cell_without_estimates_is_reported_of_what_they_are(more, words):
    (table,) = constants({"case": {}, "transversely_isotropic": CELL, **more})
    assert table.lines[-1] == f"  closed-form estimates exist for {words} only"
