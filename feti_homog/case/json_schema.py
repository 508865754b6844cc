"""The case file as a JSON Schema (draft 2020-12), made of its keys alone: `feti-homog schema`.

Types, choices, ranges and unknown keys are checked everywhere; which keys are required or belong to a case only in
files without [sweep], where all keys must stand in their sections.  Relations between numbers, such as the fibre
fraction at which fibres touch, are beyond a schema: `feti-homog check` knows them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from feti_homog.case.interface_section import Arc
from feti_homog.case.json_schema_rules import Schema, rules_of_one_case
from feti_homog.case.mixed_load import MixedLoad
from feti_homog.case.petsc_section import PREFIXED
from feti_homog.case.phase_names import PHASE
from feti_homog.case.sections import SECTIONS
from feti_homog.case.sweep_section import AXIS_MEANING, RANGE_KEYS, SWEEP, SweepSection
from feti_homog.case.tables import TOP_LEVEL
from feti_homog.materials.forms import MATERIAL_FORMS
from feti_homog.schema.keys import Key, defaults_of, keys_of
from feti_homog.schema.values import text

AXIS_VALUES = {"type": "array", "minItems": 1}
AXIS_TABLE = {"type": "object", "minProperties": 1, "additionalProperties": {"$ref": "#/$defs/axis"}}
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def json_schema() -> Schema:
    """The schema of a case file, with or without [sweep]."""
    return {
        "$schema": DIALECT,
        "title": "Case file of feti_homog",
        "type": "object",
        "properties": {
            "name": dict(text.json_schema) | {"description": "Name of the case; by default that of the file."},
            **{section: _reference(section) for section in SECTIONS},
            "interface": {"anyOf": [_reference("interface"), _several(_reference("interface"))]},
            "material": _materials(),
            "petsc": _petsc(),
            SWEEP: _sweep(),
        },
        "additionalProperties": False,
        "$defs": {
            **{section: _table(contents) for section, contents in SECTIONS.items()},
            **{_definition(form): _table(contents) for form, contents in MATERIAL_FORMS.items()},
            "arc": _table(Arc),
            "mixed_load": _table(MixedLoad),
            "axis": _axis(),
            "axes": _axes(),
            "range": _object({name: _key(entry) for name, entry in RANGE_KEYS.items()}) | {"required": ["from", "to"]},
        },
        "if": {"not": {"required": [SWEEP]}},
        "then": rules_of_one_case(),
    }


def _reference(name: str) -> Schema:
    return {"$ref": f"#/$defs/{name}"}


def _several(table: Schema) -> Schema:
    return {"type": "array", "items": table, "minItems": 1}


def _definition(form: str) -> str:
    """The name of a form as references, which have no spaces, take it."""
    return form.replace(" ", "_")


def _object(properties: Mapping[str, Any]) -> Schema:
    return {"type": "object", "properties": dict(properties), "additionalProperties": False}


def _table(contents: type[Any]) -> Schema:
    defaults = defaults_of(contents)
    own = {name: {"default": default} for name, default in defaults.items()}
    return _object({name: _key(entry) | own.get(name, {}) for name, entry in keys_of(contents).items()})


def _key(entry: Key) -> Schema:
    unit = f" Unit: {entry.unit}." if entry.unit else ""
    return dict(entry.type.json_schema) | {"description": entry.meaning + unit}


def _materials() -> Schema:
    forms = {"anyOf": [_reference(_definition(form)) for form in MATERIAL_FORMS]}
    phases = {f"^({PHASE.pattern})$": forms}
    return {"type": "object", "patternProperties": phases, "additionalProperties": False}


def _petsc() -> Schema:
    value = {"type": ["string", "number", "boolean"]}
    names = {f"^{PREFIXED}$": value}
    return {"type": "object", "patternProperties": names, "additionalProperties": False}


def _sweep() -> Schema:
    sections = [name for name in TOP_LEVEL if name != "name"]
    table = _table(SweepSection)
    table["properties"] |= {name: _reference("axes") for name in sections}
    return table | {"patternProperties": {rf"^({'|'.join(sections)})\.": _reference("axis")}}


def _axes() -> Schema:
    """The axes of a section: a list of values, or a table of axes."""
    return {"description": AXIS_MEANING, "anyOf": [AXIS_VALUES, AXIS_TABLE]}


def _axis() -> Schema:
    """A list of values, a range, or a table of axes."""
    no_range = {"not": {"anyOf": [{"required": ["from"]}, {"required": ["to"]}]}}
    return {"description": AXIS_MEANING, "anyOf": [AXIS_VALUES, _reference("range"), AXIS_TABLE | no_range]}
