"""Relations between keys: conditions, the places of their faults, and documents changed at random."""

import tomllib
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from unit.case.documents import changed_documents
from unit.case.faulty_cases import FAULTY_CASES, NOT_TOML
from unit.case.valid_cases import VALID_CASES

from feti_homog.case.cases import parse
from feti_homog.case.rules import ITEMS, Rule, exclusive, needed
from feti_homog.errors import CaseError
from feti_homog.schema.keys import Selector

SOURCES = [tomllib.loads(text) for text in VALID_CASES.values()]
SOURCES += [tomllib.loads(text) for words, text in FAULTY_CASES.items() if words not in NOT_TOML]
SOURCES += [{**each, "interface": [each["interface"]]} for each in SOURCES if "interface" in each]


@settings(deadline=None)
@given(changed_documents(SOURCES))
def test_every_fault_of_a_changed_document_is_a_line_of_its_own(document):
    try:
        parse(document, Path("nowhere"))
    except CaseError as error:
        assert len({*error.faults}) == len(error.faults)
        assert all(fault.strip() and len(fault.splitlines()) == 1 for fault in error.faults)


def faults(rule: Rule, document: dict[str, Any], **selected: str) -> list[str]:
    return list(rule.faults(document, {Selector("a", name): value for name, value in selected.items()}))


def test_faults_name_the_section_and_the_place_in_it():
    assert faults(exclusive(("a",), "x", "y"), {"a": {"x": 1, "y": 2}}) == ["[a] x, y: exclude each other; give one"]
    in_a_list = exclusive(("a", "loads", ITEMS), "x", "y")
    document = {"a": {"loads": [{"x": 1}, {"x": 1, "y": 1}, 3]}}
    assert faults(in_a_list, document) == ["[a] loads[1].x, loads[1].y: exclude each other; give one"]
    assert faults(Rule(("a", "x"), lambda value: value != 1, "no"), {"a": {"x": 1}}) == ["[a] x = 1: no"]


def test_rules_number_sections_and_have_conditions():
    rule = needed(("a",), "x", "missing")
    assert faults(rule, {"a": [{"x": 1}, {}]}) == ["[a 2] x: missing"]
    assert faults(rule, {"a": [{}]}) == faults(rule, {"a": {}}) == ["[a] x: missing"]
    assert not faults(rule, {})
    rule = needed(("a",), "x", "missing", Selector("a", "kind").among("one", "two"))
    assert faults(rule, {"a": {}}, kind="one") and not faults(rule, {"a": {}}, kind="three")
    assert not faults(rule, {"a": {}})
    assert not faults(exclusive(("a",), "x", "y"), {"a": 3}) and not faults(needed(("a",), "x", "missing"), {"a": 3})
