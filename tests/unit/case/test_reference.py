"""The reference of the case file: nothing is left out, and every key is explained."""

import re

import pytest

from feti_homog.case import reference
from feti_homog.case.sections import GROUPS, RANGE_KEYS, TABLES, TOP_LEVEL, SweepSection
from feti_homog.errors import CaseError
from feti_homog.schema.keys import keys_of

ROWS = [(table, row) for table in reference.tables() for row in table.rows]


def rows(section: str) -> dict[str, reference.KeyRow]:
    return {row.key: row for table in reference.tables(section) for row in table.rows}


def test_all_keys_of_all_tables_are_there():
    found = [(table.section, row.key) for table, row in ROWS]
    assert {section for section, _ in found} == {*TOP_LEVEL, "sweep", "uncertainty", "unknown", "measured"}
    for table in TABLES:
        assert {(table.section, name) for name in keys_of(table.contents)} <= set(found)
    assert {("sweep", name) for name in (*keys_of(SweepSection), *RANGE_KEYS)} <= set(found)
    assert len({(table.place, row.key) for table, row in ROWS}) == len(found)


@pytest.mark.parametrize("row", [pytest.param(row, id=f"{table.place} {row.key}") for table, row in ROWS])
def test_every_key_says_in_a_sentence_what_it_means(row):
    assert row.meaning.endswith(".") and row.accepts
    assert row.meaning[0].isupper() or row.meaning[0] in '"t' or row.meaning.startswith("R^")


@pytest.mark.parametrize(
    ("section", "key", "expected"),
    [
        ("cell", "mesh_size", ("a number at least 0.0001 and at most 0.5", "", "0.05")),
        ("cell", "geometry", ('one of "square", "hexagonal", "random", "table", "mesh", "pixels"', "", "required")),
        ("material", "young", ("a number above 0", "stress", "required")),
        ("material", "E_transverse", ("a number above 0", "stress", "required")),
        ("material", "expansion_axial", ("a number", "1 / temperature", "")),
        ("interface", "normal_strength", ("a traction above 0, or inf", "stress", "inf")),
        ("interface", "debonded", ("a list of arcs {fibre, centre, angle}, at most 10000 of them", "", "[]")),
        ("angle", "values", ("a rising list of numbers from 0 to 360, at most 1000 of them", "degrees", "required")),
        ("output", "stress_unit", ("a string in one line", "", '""')),
        ("path", "increments", ("an integer at least 1 and at most 1000000", "", "required")),
        ("name", "name", ("a string in one line", "", "the file's name")),
    ],
)
def test_rows_are_those_of_the_keys(section, key, expected):
    row = rows(section)[key]
    assert (row.accepts, row.unit, row.default) == expected


def test_where_keys_apply():
    assert rows("cell")["fibres"].applies == 'geometry = "random"'
    assert rows("interface")["criterion"].applies == '[analysis] type = "path" or "envelope"'
    assert rows("path")["release"].applies == '[analysis] type = "path", method = "increments"'
    assert rows("cell")["refine"].applies == ""
    assert rows("angle")["strain"].applies == '[analysis] type = "angle", [analysis] plane = "strain" or "stress"'


def test_the_text_has_every_key_and_no_long_line():
    text = reference.as_text(reference.tables())
    assert max(map(len, text.splitlines())) <= reference.WIDTH
    assert all(f"\n  {row.key}\n" in text for _, row in ROWS)
    assert all(table.place in text for table in reference.tables())


def test_the_index_has_every_key_of_every_table_once_and_groups_without_keys_are_none():
    index, _, rest = reference.text().partition("\n\nbefore the first section: the case")
    assert rest and max(map(len, index.splitlines())) <= reference.WIDTH
    listed = [part.split() for part in re.split(r"\n\n[^\n]+\n|\n  (?! )", index)[1:] if part]
    expected = {(table.place.partition(",")[0], row.key) for table, row in ROWS}
    found = [
        (place, key) for place, keys in (" ".join(words).split(": ") for words in listed) for key in keys.split(", ")
    ]
    assert len(found) == len(set(found)) and set(found) == expected
    assert set(" ".join(GROUPS.values()).split()) <= {*reference.ORDER, *(f"{t.section}.{row.key}" for t, row in ROWS)}


@pytest.mark.parametrize(
    ("word", "expected"),
    [
        ("teeth", ("interface", "teeth")),  # a key
        ("Coulomb", ("interface", "friction")),  # a description, in any case
        ("coulomb", ("interface", "friction")),
        ("mesh size", ("cell", "mesh_size")),  # without its underscore
        ("micrograph", ("cell", "geometry")),
        ("decomp", ("decomposition", "max_dofs")),  # a part of the name of a section has all its keys
        ("latin", ("sweep", "sampling")),  # a value
    ],
)
def test_a_word_finds_keys_and_sections(word, expected):
    section, key = expected
    found = [(table, row) for table in reference.tables(word) for row in table.rows]
    assert (section, key) in {(table.section, row.key) for table, row in found}
    words = word.lower().replace(" ", "_")
    for table, row in found:
        assert words in " ".join((table.section, *vars(row).values())).lower().replace(" ", "_")
    left_out = [row for table, row in ROWS if row not in {other for _, other in found}]
    assert not any(words in " ".join(vars(row).values()).lower().replace(" ", "_") for row in left_out)


def test_keys_with_the_word_come_before_descriptions_with_it():
    (table,) = (table for table in reference.tables("teeth") if table.place == "[interface]")
    assert table.rows[0].key == "teeth" and len(table.rows) > 1


@pytest.mark.parametrize(
    ("word", "line"),
    [
        ("mesh_sise", "keys mesh_sise: no key, section or description has it; near words: mesh_size, mesh_error"),
        (
            "alpha",
            "keys alpha: no key, section or description has it; near words: expansion, expansion_axial, "
            "expansion_transverse",
        ),
        ("qwxz", "keys qwxz: no key, section or description has it; `feti-homog keys` lists all keys"),
    ],
)
def test_a_word_that_is_nowhere(word, line):
    with pytest.raises(CaseError) as caught:
        reference.tables(word)
    assert caught.value.faults == (line,) and caught.value.exit_code == 2
