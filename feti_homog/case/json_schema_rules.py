"""The rules of the JSON Schema of a case file: which keys are required, and which belong to a case."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any

from feti_homog.case.cell_section import ALL_CIRCULAR, GEOMETRY, MESH, MESHED, TABLE
from feti_homog.case.element_sizes import ASKED, CHOSEN
from feti_homog.case.envelope_section import pairs_of
from feti_homog.case.interface_section import STIFFNESSES, STRENGTHS, Arc
from feti_homog.case.mixed_load import MixedLoad, components
from feti_homog.case.sections import OUT_OF_PLANE_STRESSES, SECTIONS, SECTIONS_OF_AN_ANALYSIS
from feti_homog.case.selectors import (
    ANALYSIS_TYPE,
    ANGLE_ANALYSIS,
    BY_ENERGY,
    CRITERION,
    ENVELOPE_ANALYSIS,
    GENERALIZED,
    IN_THE_PLANE,
    METHOD,
    PLANE,
)
from feti_homog.case.tables import REQUIRED
from feti_homog.materials.forms import EXPANSION_PAIR, MATERIAL_FORMS
from feti_homog.materials.voigt import STRAINS, STRESSES
from feti_homog.schema.keys import Condition, Key, Selector, defaults_of, keys_of
from feti_homog.schema.values import LARGEST

Schema = dict[str, Any]

ITEMS = "items"  # on the way to a table: of a list
PLACES_OF_LOADS = (("path", "to"), ("path", "waypoints", ITEMS), ("load", "to"))


def rules_of_one_case() -> Schema:
    """What must be given, by conditions that are independent of each other."""
    required = [_required(path, contents) for path, contents in _tables()]
    selectors = (GEOMETRY, ANALYSIS_TYPE, PLANE, METHOD, CRITERION)
    conditional = [_rule(selector, value) for selector in selectors for value in _values(selector)]
    return {
        "required": list(REQUIRED),
        "allOf": [
            *filter(None, required),
            *conditional,
            *_file_rules(),
            *_material_rules(),
            *_arc_rules(),
            *_energy_rules(),
            *_generalized_rules(),
            *_envelope_rules(),
            _at(("cell",), {"not": {"required": ["width", "fibre_radius"]}}),
            _at(("cell",), {"not": {"required": list(ASKED)}}),
            *(_at(("cell",), {"not": {"required": list(pair)}}) for pair in product(ASKED, CHOSEN)),
            *_mix_rules(),
            _at(("decomposition",), {"not": {"required": ["subdomains", "max_dofs"]}}),
            _at(("path",), {"oneOf": [{"required": [name]} for name in ("strain", "to", "waypoints")]}),
            *_mixed_load_rules(),
        ],
    }


def _tables() -> Iterator[tuple[tuple[str, ...], type[Any]]]:
    """The way to each table with keys that may be conditional, and the table."""
    for section, contents in SECTIONS.items():
        yield (section,), contents
    yield ("interface", "debonded", ITEMS), Arc
    for place in PLACES_OF_LOADS:
        yield place, MixedLoad


def _at(path: Sequence[str], schema: Schema) -> Schema:
    """The schema for what stands at a path, if it is there."""
    for name in reversed(path):
        schema = {ITEMS: schema} if name == ITEMS else {"properties": {name: schema}}
    return schema


def _required(path: Sequence[str], contents: type[Any]) -> Schema:
    """The keys that a table always has; empty if there are none."""
    names = [name for name, entry in keys_of(contents).items() if entry.required and entry.only is None]
    return _at(path, {"required": names}) if names else {}


def _values(selector: Selector) -> Sequence[str]:
    values: Sequence[str] = keys_of(SECTIONS[selector.section])[selector.key].type.json_schema["enum"]
    return values


def _if(condition: Condition) -> Schema:
    """That a selector has one of some values; its default if it is not given."""
    selector = condition.selector
    default = defaults_of(SECTIONS[selector.section]).get(selector.key)
    has_value: Schema = {"properties": {selector.key: {"enum": list(condition.values)}}}
    if default not in condition.values:
        has_value["required"] = [selector.key]
    return {"properties": {selector.section: has_value}, "required": [selector.section]}


def _rule(selector: Selector, value: str) -> Schema:
    """What follows from a selector's value: required keys, and those that belong to other values."""
    consequences = [_consequence(path, keys_of(contents), selector, value) for path, contents in _tables()]
    if selector == ANALYSIS_TYPE:
        consequences.append(_section_consequence(value))
    return {"if": _if(selector.among(value)), "then": {"allOf": [*filter(None, consequences)]}}


def _consequence(path: Sequence[str], keys: Mapping[str, Key], selector: Selector, value: str) -> Schema:
    own = {name: entry for name, entry in keys.items() if entry.only is not None and entry.only.selector == selector}
    belongs = {name: entry.belongs({selector: value}) for name, entry in own.items()}
    required = [_presence(name, entry) for name, entry in own.items() if entry.required and belongs[name]]
    excluded = {name: False for name, is_own in belongs.items() if not is_own}
    return _at(path, {"properties": excluded} | ({"allOf": required} if required else {})) if own else {}


def _presence(name: str, entry: Key) -> Schema:
    """That a key is there, or one that it is not required beside."""
    there: list[Schema] = [{"required": [each]} for each in (name, *entry.unless)]
    return {"anyOf": there} if entry.unless else there[0]


def _section_consequence(value: str) -> Schema:
    conditions = SECTIONS_OF_AN_ANALYSIS.items()
    required = [section for section, condition in conditions if value in condition.values]
    excluded = {section: False for section, condition in conditions if value not in condition.values}
    return {"required": required, "properties": excluded}


def _file_rules() -> list[Schema]:
    """A mesh comes in a file; the fibres of a table come in a file, or in a list with the size of the cell."""
    in_a_list = {"required": ["fibre_list", "width", "height"]}
    of_a_table = {"oneOf": [{"required": ["file"]}, {"required": ["fibre_list"]}]}
    listed = {"if": {"required": ["fibre_list"]}, "then": in_a_list}
    of_a_mesh = {"required": ["file"]}

    def named(suffix: str) -> Schema:
        return {"properties": {"file": {"pattern": f"\\.{suffix}$"}}}

    return [
        {"if": _if(MESH), "then": _at(("cell",), of_a_mesh | named("msh"))},
        {"if": _if(TABLE), "then": _at(("cell",), of_a_table | listed | named("csv"))},
    ]


def _mix_rules() -> list[Schema]:
    """A mix has the fractions; radii, with the number of fibres or the width, make the size of the cell."""
    apart = [{"not": {"required": ["mix", name]}} for name in ("fibre_fraction", "match")]
    one_size = {"oneOf": [{"required": ["fibres"]}, {"required": ["width"]}], "properties": {"fibre_radius": False}}
    of_radii = {"required": ["mix"], **one_size}
    return [_at(("cell",), {"allOf": [*apart, {"if": {"required": ["radii"]}, "then": of_radii}]})]


def _material_rules() -> list[Schema]:
    complete = [
        {"required": [name for name, entry in keys_of(contents).items() if entry.required]}
        for contents in MATERIAL_FORMS.values()
    ]
    axial, transverse = EXPANSION_PAIR
    expansions = {
        "dependentRequired": {axial: [transverse], transverse: [axial]},
        "not": {"required": ["expansion", axial]},
    }
    of_circles = {"required": ["fibre"], "patternProperties": {"^fibre:": False}}
    unmixed = {"allOf": [_if(ALL_CIRCULAR), {"not": _at(("cell",), {"required": ["mix"]})}]}
    return [
        _at(("material",), {"required": ["matrix"], "additionalProperties": {"anyOf": complete} | expansions}),
        {"if": unmixed, "then": _at(("material",), of_circles)},
        {"if": _at(("cell",), {"required": ["coating"]}), "then": _at(("material",), {"required": ["coating"]})},
    ]


def _arc_rules() -> list[Schema]:
    """Arcs must be given where nothing else can debond."""
    some_arc = {"required": ["debonded"], "properties": {"debonded": {"minItems": 1}}}
    unbroken = ANALYSIS_TYPE.among("stiffness", "load")
    return [
        {"if": _if(ANGLE_ANALYSIS), "then": {"required": ["interface"], **_at(("interface",), some_arc)}},
        {
            "if": {"allOf": [_if(unbroken), _if(MESHED)]},
            "then": _at(
                ("interface",),
                {"anyOf": [{"required": [name]} for name in ("debonded", *STIFFNESSES, "axial_stiffness")]},
            ),
        },
    ]


def _energy_rules() -> list[Schema]:
    """Bonds that break by energy have springs, and no strengths."""
    strengths = dict.fromkeys(STRENGTHS, False)
    springs = _at(("interface",), {"required": [*STIFFNESSES], "properties": strengths})
    return [{"if": _if(BY_ENERGY), "then": springs}]


def _generalized_rules() -> list[Schema]:
    """Generalized plane strain alone has stresses out of the plane, and no strains of three components."""
    only_there = {"not": {"enum": list(OUT_OF_PLANE_STRESSES)}}
    return [
        {"if": _if(IN_THE_PLANE), "then": _at(("output", "stress"), only_there)},
        {"if": _if(GENERALIZED), "then": _at(("path", "waypoints", ITEMS), {"type": "object"})},
    ]


def _mixed_load_rules() -> list[Schema]:
    """A component has a strain or a stress, never both."""
    both = {"type": "object", "anyOf": [{"required": list(names)} for names in components(*GENERALIZED.values)]}
    return [_at(place, {"not": both}) for place in PLACES_OF_LOADS]


def _envelope_rules() -> list[Schema]:
    """An envelope needs bonds that break and debonded faces without contact; its plane is that of the case."""
    finite = {"type": "number", "maximum": LARGEST}
    strong = {"anyOf": [{"required": [name], "properties": {name: finite}} for name in STRENGTHS]}
    by_energy = {"properties": {"criterion": {"const": "energy"}}, "required": ["criterion"]}
    some_arc = {"required": ["debonded"], "properties": {"debonded": {"minItems": 1}}}
    free = {"if": some_arc, "then": {"required": ["contact"], "properties": {"contact": {"const": False}}}}
    bonding = {"allOf": [{"anyOf": [by_energy, strong]}, free]}
    in_the_plane = {"envelope": {"properties": {"plane": pairs_of(STRESSES, STRAINS)}}}
    no_axial_strength = {"interface": {"properties": {"axial_strength": False}}}
    return [
        {"if": _if(ENVELOPE_ANALYSIS), "then": {"required": ["interface"], **_at(("interface",), bonding)}},
        {"if": _if(IN_THE_PLANE), "then": {"properties": in_the_plane | no_axial_strength}},
    ]
