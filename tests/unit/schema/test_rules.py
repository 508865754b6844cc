"""Rules by the words of JSON Schema, against jsonschema; the places of their faults."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hypothesis import given
from jsonschema import Draft202012Validator
from unit.case.documents import changed_documents
from unit.case.test_json_schema import SOURCES

from feti_homog.case.rules import RULES
from feti_homog.schema.keys import Selector
from feti_homog.schema.rules import ITEMS, Rule, exclusive, holds, needed, refused

VALIDATORS = [(rule.schema, Draft202012Validator(rule.schema)) for rule in RULES]


def values_in(value: Any, depth: int) -> Iterator[Any]:
    """Yield the value and, to some depth, those in it."""
    yield value
    if depth and isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from values_in(item, depth - 1)


@given(changed_documents(SOURCES))
def test_what_holds_is_valid(document):
    for value in values_in(document, 2):
        for schema, validator in VALIDATORS:
            assert holds(schema, value) == validator.is_valid(value), (schema, value)


def faults(rule: Rule, document: dict[str, Any], **selected: str) -> list[str]:
    return list(rule.faults(document, {Selector("a", name): value for name, value in selected.items()}))


def test_faults_name_the_section_and_the_place_in_it():
    assert faults(exclusive(("a",), "x", "y"), {"a": {"x": 1, "y": 2}}) == ["[a] x, y: exclude each other; give one"]
    in_a_list = exclusive(("a", "loads", ITEMS), "x", "y")
    document = {"a": {"loads": [{"x": 1}, {"x": 1, "y": 1}, 3]}}
    assert faults(in_a_list, document) == ["[a] loads[1].x, loads[1].y: exclude each other; give one"]
    assert faults(refused(("a", "x"), {"enum": [1]}, "no"), {"a": {"x": 1}}) == ["[a] x = 1: no"]


def test_sections_of_one_name_are_numbered():
    rule = needed(("a",), "x", "missing")
    assert faults(rule, {"a": [{"x": 1}, {}]}) == ["[a 2] x: missing"]
    assert faults(rule, {"a": [{}]}) == faults(rule, {"a": {}}) == ["[a] x: missing"]
    assert not faults(rule, {})


def test_rules_have_conditions():
    rule = needed(("a",), "x", "missing", Selector("a", "kind").among("one", "two"))
    assert faults(rule, {"a": {}}, kind="one") and not faults(rule, {"a": {}}, kind="three")
    assert not faults(rule, {"a": {}})


def test_what_is_no_table_is_faulty_elsewhere():
    assert not faults(exclusive(("a",), "x", "y"), {"a": 3}) and not faults(needed(("a",), "x", "missing"), {"a": 3})
