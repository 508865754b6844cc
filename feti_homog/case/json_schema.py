"""The case file as a JSON Schema (draft 2020-12), made of its keys alone: `feti-homog schema`.

Types, choices, ranges and unknown keys are checked everywhere; which keys are required or belong to a case only in
files without [sweep], where all keys must stand in their sections.  Relations between numbers, such as the fibre
fraction at which fibres touch, are beyond a schema: `feti-homog check` checks them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from feti_homog.case.cell_section import ALL_CIRCULAR
from feti_homog.case.interface_section import Arc, Scatter
from feti_homog.case.material_sections import CONSTANTS
from feti_homog.case.mixed_load import TEMPERATURE, MixedLoad
from feti_homog.case.rules import PLACES_OF_LOADS, PLACES_OF_TABLES, RULES
from feti_homog.case.sections import (
    AXIS_MEANING,
    PREFIXED,
    RANGE_KEYS,
    REQUIRED,
    SECTIONS,
    SWEEP,
    TOP_LEVEL,
    SweepSection,
)
from feti_homog.case.selectors import ANALYSIS_TYPE, CRITERION, GENERALIZED, PLANE
from feti_homog.case.uncertainty import UNCERTAINTY
from feti_homog.materials.forms import EXPANSION_PAIR, MATERIAL_FORMS
from feti_homog.materials.laws import NEEDED
from feti_homog.microstructure.phase_names import COATING, FIBRE, MATRIX, PHASE
from feti_homog.schema.keys import Condition, Key, defaults_of, keys_of
from feti_homog.schema.rules import ITEMS, Rule, Schema
from feti_homog.schema.values import text

AXIS_VALUES = {"type": "array", "minItems": 1}
AXIS_TABLE = {"type": "object", "minProperties": 1, "additionalProperties": {"$ref": "#/$defs/axis"}}
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def json_schema() -> Schema:
    """Return the schema of a case file, with or without [sweep]."""
    forms = {"anyOf": [_reference(_definition(form)) for form in MATERIAL_FORMS]}
    return {
        "$schema": DIALECT,
        "title": "Case file of feti_homog",
        "type": "object",
        "properties": {
            "name": dict(text.json_schema) | {"description": "Name of the case; by default the name of the file."},
            **{section: _reference(section) for section in SECTIONS},
            "interface": {"anyOf": [_reference("interface"), _several(_reference("interface"))]},
            "material": _by_name(f"^({PHASE.pattern})$", forms),
            "petsc": _by_name(f"^{PREFIXED}$", {"type": ["string", "number", "boolean"]}),
            UNCERTAINTY: {"type": "object"},  # of cases that are written; files give {mean, std} in place of a number
            SWEEP: _sweep(),
        },
        "additionalProperties": False,
        "$defs": {
            **{section: _table(contents) for section, contents in SECTIONS.items()},
            "interface": _with_uncertain(_table(SECTIONS["interface"]), "_stiffness"),
            **{_definition(form): _with_uncertain(_table(contents)) for form, contents in MATERIAL_FORMS.items()},
            "arc": _table(Arc),
            "scatter": _table(Scatter),
            "mixed_load": _table(MixedLoad),
            "axis": _axis(),
            "axes": _axes(),
            "range": _object({name: _key(entry) for name, entry in RANGE_KEYS.items()}) | {"required": ["from", "to"]},
        },
        "if": {"not": {"required": [SWEEP]}},
        "then": _rules_of_one_case(),
    }


def _reference(name: str) -> Schema:
    return {"$ref": f"#/$defs/{name}"}


def _several(table: Schema) -> Schema:
    return {"type": "array", "items": table, "minItems": 1}


def _definition(form: str) -> str:
    """Return the name of a form as references, which have no spaces, take it."""
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


def _with_uncertain(table: Schema, ending: str = "") -> Schema:
    """Return a table whose numbers, of keys with this ending, may be {mean, std} or {mean, cv}."""
    for name, one in table["properties"].items():
        if name.endswith(ending) and one.get("type") == "number":
            words = {key: one.pop(key) for key in ("description", "default") if key in one}
            positive = {"type": "number", "exclusiveMinimum": 0}
            spread = [_object({"mean": one, by: positive}) | {"required": ["mean", by]} for by in ("std", "cv")]
            table["properties"][name] = {"anyOf": [one, *spread]} | words
    return table


def _by_name(pattern: str, contents: Schema) -> Schema:
    """Return the table of contents of one kind by names of this pattern."""
    return {"type": "object", "patternProperties": {pattern: contents}, "additionalProperties": False}


def _sweep() -> Schema:
    sections = [name for name in TOP_LEVEL if name != "name"]
    table = _table(SweepSection)
    table["properties"] |= {name: _reference("axes") for name in sections}
    return table | {"patternProperties": {rf"^({'|'.join(sections)})\.": _reference("axis")}}


def _axes() -> Schema:
    """Return the axes of a section: a list of values, or a table of axes."""
    return {"description": AXIS_MEANING, "anyOf": [AXIS_VALUES, AXIS_TABLE]}


def _axis() -> Schema:
    """Return a list of values, a range, or a table of axes."""
    no_range = {"not": {"anyOf": [{"required": ["from"]}, {"required": ["to"]}]}}
    return {"description": AXIS_MEANING, "anyOf": [AXIS_VALUES, _reference("range"), AXIS_TABLE | no_range]}


def _rules_of_one_case() -> Schema:
    """Return the required keys, by independent conditions."""
    always = [_required(path, contents) for path, contents in PLACES_OF_TABLES]
    pairs = {"if": {"minItems": 2}, "then": {"items": {"required": ["between"]}}}  # of several [[interface]]
    rules = [*filter(None, always), *map(_rule, RULES), *_material_rules(), {"properties": {"interface": pairs}}]
    return {"required": list(REQUIRED), "allOf": rules}


def _rule(rule: Rule) -> Schema:
    """Return a rule that the reader has too."""
    schema = _at(rule.path, rule.schema)
    return {"if": {"allOf": [_if(condition) for condition in rule.when]}, "then": schema} if rule.when else schema


def _at(path: Sequence[str], schema: Schema | bool) -> Schema:
    """Return the schema for what stands at a path, if it is there; of several sections of one name in each."""
    if not path:
        return {"allOf": [schema]}
    name, *below = path
    inner = _at(below, schema) if below else schema
    if name == ITEMS:
        return {"items": inner}
    each = {"if": {"type": "array"}, "then": {"items": inner}, "else": inner}
    return {"properties": {name: each if name == "interface" else inner}}


def _required(path: Sequence[str], contents: type[Any]) -> Schema:
    """Return the keys that a table always has; empty if there are none."""
    names = [name for name, entry in keys_of(contents).items() if entry.required and not entry.only]
    return _at(path, {"required": names}) if names else {}


def _if(condition: Condition) -> Schema:
    """Return the condition that a selector has one of some values, or that it is absent and its default is."""
    selector = condition.selector
    default = defaults_of(SECTIONS[selector.section]).get(selector.key)
    has_value: Schema = {"properties": {selector.key: {"enum": list(condition.values)}}}
    if default not in condition.values:
        has_value["required"] = [selector.key]
    if selector == CRITERION:  # which may have its other name
        by_law: Schema = {"properties": {"law": {"enum": list(condition.values)}}}
        has_value = {"if": {"required": ["law"]}, "then": by_law, "else": has_value}
    if selector.section == "interface":  # the first of several, for all agree
        has_value = {"if": {"type": "array"}, "then": {"prefixItems": [has_value]}, "else": has_value}
    return {"properties": {selector.section: has_value}, "required": [selector.section]}


def _material_rules() -> list[Schema]:
    """Return which constants and phases belong together."""
    complete = [
        {"required": [name for name, entry in keys_of(contents).items() if entry.required]}
        for contents in MATERIAL_FORMS.values()
    ]
    axial, transverse = EXPANSION_PAIR
    expansions = {
        "dependentRequired": {axial: [transverse], transverse: [axial]},
        "not": {"required": ["expansion", axial]},
    }
    phases = {"required": [MATRIX], "additionalProperties": {"anyOf": complete} | expansions}
    temperatures = (("envelope", TEMPERATURE), *((*place, TEMPERATURE) for place in PLACES_OF_LOADS))
    warm = {"anyOf": [_there(path) for path in temperatures]}
    expand = {"anyOf": [{"required": [name]} for name in ("expansion", axial)]}
    of_circles = {"propertyNames": {"not": {"pattern": ":"}}}
    of_one_phase = {"required": [FIBRE], "propertyNames": {"enum": [MATRIX, FIBRE, COATING]}}
    unmixed = {"allOf": [_if(ALL_CIRCULAR), {"not": _at(("cell",), {"required": ["mix"]})}]}
    coated = _at(("cell",), {"required": ["coating"]})
    uncoated = {"allOf": [_if(ALL_CIRCULAR), {"not": coated}]}
    certain = {"additionalProperties": {"not": {"type": "object", "required": ["mean"]}}}
    passed_on = {
        "if": _if(ANALYSIS_TYPE.among("stiffness")),
        "else": {"allOf": [_each_material(certain), _at(("interface",), certain)]},
    }
    return [
        _at(("material",), phases | {"propertyNames": {"not": {"enum": sorted(CONSTANTS)}}}),
        {"if": _if(ALL_CIRCULAR), "then": _at(("material",), of_circles)},
        {"if": unmixed, "then": _at(("material",), of_one_phase)},
        {"if": warm, "then": _each_material(expand)},
        passed_on,
        *(_needs(form, plane, names) for form, planes in NEEDED.items() for plane, names in planes.items()),
        {"if": _if(GENERALIZED), "then": _each_material({"properties": {"stiffness": {"minItems": 6}}})},
        {"if": coated, "then": _at(("material",), {"required": [COATING]})},
        {"if": uncoated, "then": _at(("material",), {"properties": {COATING: False}})},
    ]


def _each_material(schema: Schema) -> Schema:
    return _at(("material",), {"additionalProperties": schema})


def _needs(form: type[Any], plane: str, names: Sequence[str]) -> Schema:
    """Return the requirements of a plane state on a form of material, identified by a key that it always has."""
    own = next(name for name, entry in keys_of(form).items() if entry.required)
    of_form = {"if": {"required": [own]}, "then": {"required": [*names]}}
    return {"if": _if(PLANE.among(plane)), "then": _each_material(of_form)}


def _there(path: Sequence[str]) -> Schema:
    """Return the condition that a path exists, in a list in any of its items."""
    schema: Schema = {}
    for name in reversed(path):
        schema = {"contains": schema} if name == ITEMS else {"required": [name], "properties": {name: schema}}
        schema |= {"type": "array" if name == ITEMS else "object"}
    return schema
