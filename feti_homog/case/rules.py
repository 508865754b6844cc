"""The relations between the keys of a case file that the reader and the JSON Schema share."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

from feti_homog.case.bond_laws import REGISTRY, STIFFNESSES, STRENGTHS
from feti_homog.case.cell_files import FEWEST_MATCHED
from feti_homog.case.cell_section import MESH, MESHED, TABLE, Cell
from feti_homog.case.element_sizes import ASKED, CHOSEN
from feti_homog.case.interface_section import ARCS, Arc, Scatter
from feti_homog.case.mixed_load import MixedLoad
from feti_homog.case.section_values import MESH_FILE, MESH_SUFFIXES, TABLE_SUFFIXES
from feti_homog.case.sections import OUT_OF_PLANE_STRESSES, SECTIONS, SECTIONS_OF_AN_ANALYSIS
from feti_homog.case.selectors import (
    ANALYSIS_TYPE,
    ANGLE_ANALYSIS,
    BREAKING,
    CRITERION,
    ENVELOPE_ANALYSIS,
    GENERALIZED,
    IN_THE_PLANE,
    PLANE,
)
from feti_homog.case.uncertainty import DIFFERENTIABLE
from feti_homog.materials import plane_state
from feti_homog.materials.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES, STRAINS, STRESSES
from feti_homog.schema.keys import Condition, Selector, keys_of
from feti_homog.schema.rules import ITEMS, Path, Place, Rule, Schema, belonging, exclusive, misplaced, needed, refused
from feti_homog.schema.values import INF
from feti_homog.schema.wording import toml_value

CELL, INTERFACE, LOADS = ("cell",), ("interface",), ("strain", "to", "waypoints")
PLACES_OF_LOADS: tuple[Path, ...] = (("path", "to"), ("path", "waypoints", ITEMS), ("load", "to"))
PLACES_OF_TABLES: tuple[tuple[Path, type[Any]], ...] = (
    *(((section,), contents) for section, contents in SECTIONS.items()),
    (("interface", "debonded", ITEMS), Arc),
    (("interface", "scatter"), Scatter),
    *((place, MixedLoad) for place in PLACES_OF_LOADS),
)
ALONG_FIBRES = [name for name in (*SPATIAL_STRESSES, *SPATIAL_STRAINS) if name not in (*STRESSES, *STRAINS)]
SOME_ARC: Schema = {"required": ["debonded"], "properties": {"debonded": {"minItems": 1}}}
NO_TABLES: Schema = {"not": {"anyOf": [{"type": "object"}, {"type": "array"}]}}


def _any_section(schema: Schema) -> Schema:
    """Return the condition that a section, or one of several, is valid; other types are faults elsewhere."""
    return {"anyOf": [{"type": "object", **schema}, {"type": "array", "contains": schema}, NO_TABLES]}


def _values(selector: Selector) -> list[str]:
    """Return the values that a selector may have."""
    values: list[str] = keys_of(SECTIONS[selector.section])[selector.key].type.json_schema["enum"]
    return values


def _sections_of_an_analysis() -> Iterator[Rule]:
    """Sections that one type of analysis needs, and that no other has."""
    for section, own in SECTIONS_OF_AN_ANALYSIS.items():
        line = f"[{section}]: missing section; {own.in_words(section)} needs it"
        yield _document({"required": [section]}, line, own)
        yield belonging((section,), own, _values(ANALYSIS_TYPE))


def _conditional_keys() -> Iterator[Rule]:
    """Keys that some cases have or need, and others have not."""
    for path, contents in PLACES_OF_TABLES:
        for name, entry in keys_of(contents).items():
            for k, condition in enumerate(entry.only):
                above, values = entry.only[:k], _values(condition.selector)
                yield belonging((*path, name), condition, values, *above, instead=entry.instead)
            if entry.required and entry.only:
                line = f"missing; expected {entry.type.expected}"
                yield needed(path, name, line, *entry.only, unless=entry.unless)


def _document(schema: Schema, line: str, *when: Condition) -> Rule:
    """Return a rule for the document as a whole."""
    return Rule((), schema, lambda _: line, when)


def _cell() -> Iterator[Rule]:
    """Yield the requirements and exclusions among the keys of [cell]."""
    yield exclusive(CELL, "width", "fibre_radius")
    yield exclusive(CELL, *ASKED)
    yield Rule(
        CELL, {"not": {"type": "object", "anyOf": [{"required": [*pair]} for pair in product(ASKED, CHOSEN)]}}, _sizes
    )
    yield exclusive(CELL, "fibre_fraction", "mix")
    yield exclusive(CELL, "match", "mix")
    yield misplaced(CELL, "radii", "mix", "; use fibre_radius")
    yield exclusive(CELL, "fibre_radius", "radii")
    yield exclusive(
        CELL, "fibres", "width", words="exclude each other beside radii; one follows from the other", beside=("radii",)
    )
    number = keys_of(Cell)["fibres"].type.expected
    line = f"missing; expected {number}, or the width of the cell"
    yield needed(CELL, "fibres", line, beside="radii", unless=("width",))
    yield misplaced(CELL, "void_radius", "voids")
    yield misplaced(CELL, "accuracy_check", "accuracy")
    yield exclusive(CELL, "match", "voids", words="exclude each other; cells that match a table have no voids")
    both = {"required": ["match", "radius_spread"], "properties": {"radius_spread": {"exclusiveMinimum": 0}}}
    line = "exclude each other; the table gives the radii"
    yield Rule(CELL, {"not": {"type": "object", **both}}, lambda at: f"{at.named('match', 'radius_spread')}: {line}")
    enough = {"properties": {"fibres": {"minimum": FEWEST_MATCHED}}}
    yield Rule(
        CELL,
        {"if": {"required": ["match"]}, "then": enough},
        lambda at: f"{at.named('fibres')} = {at.value['fibres']}: expected at least {FEWEST_MATCHED} with match",
    )


def _sizes(place: Place) -> str:
    """Return the fault of a cell that asks for a size or an accuracy, and gives sizes too."""
    asked, *others = [name for name in (*ASKED, *CHOSEN) if name in place.value]
    return f"{place.named(asked, *others)}: exclude each other; {asked} chooses the sizes"


def _files() -> Iterator[Rule]:
    """Yield a mesh comes in a file; the fibres of a table come in a file, or in a list beside the size of the cell."""
    yield exclusive(CELL, "file", "fibre_list")
    yield needed(CELL, "file", f"missing; expected the name of a {MESH_FILE}", MESH)
    line = "missing; expected the name of a .csv file, or fibre_list"
    yield needed(CELL, "file", line, TABLE, unless=("fibre_list",))
    meshes = "|".join(suffix[1:] for suffix in MESH_SUFFIXES)
    tables = "|".join(suffix[1:] for suffix in TABLE_SUFFIXES)
    for pattern, expected, geometry in ((rf"\.({tables})$", MESH_FILE, MESH), (rf"\.({meshes})$", ".csv file", TABLE)):
        line = f"expected the name of a {expected} for {geometry.in_words('cell')}"
        yield refused((*CELL, "file"), {"type": "string", "pattern": pattern}, line, geometry)
    for wrong, right, geometry in (("overlaps", "snap", MESH), ("snap", "overlaps", TABLE)):
        line = f'expected "none" or "{right}" for {geometry.in_words("cell")}'
        yield refused((*CELL, "repair"), {"enum": [wrong]}, line, geometry)
    for name in ("width", "height"):
        line = "missing; fibre_list has no line such as # width = 120, height = 80"
        yield needed(CELL, name, line, TABLE, beside="fibre_list")


def _output() -> Iterator[Rule]:
    """Yield what some analyses cannot give."""
    others = ANALYSIS_TYPE.among(*(name for name in _values(ANALYSIS_TYPE) if name not in DIFFERENTIABLE))
    line = f"belongs to [analysis] type = {' or '.join(map(toml_value, DIFFERENTIABLE))}"
    yield refused(("output", "sensitivities"), {"type": "boolean", "enum": [True]}, line, others)
    pairs = (("cell", "accuracy_check", "repeat"), ("output", "mesh_error", False))
    tables = {s: {"type": "object", "required": [key], "properties": {key: {"enum": [v]}}} for s, key, v in pairs}
    line = '[output] mesh_error = false: expected true with [cell] accuracy_check = "repeat"'
    yield Rule((), {"not": {"required": ["cell", "output"], "properties": tables}}, lambda _: line)


def _loads() -> Iterator[Rule]:
    """One form of a path; of each component its strain or its stress, by name in generalized plane strain."""
    given: Schema = {"anyOf": [{"required": [name]} for name in LOADS]}
    yield Rule(("path",), given, lambda place: f"{place.named(*LOADS)}: missing; give one")
    yield exclusive(("path",), *LOADS)
    line = f"expected a table such as {{E11 = 0.01}} in {GENERALIZED.in_words('path')}"
    yield refused(("path", "waypoints", ITEMS), {"type": "array"}, line, GENERALIZED)
    for path, pair in product(PLACES_OF_LOADS, plane_state.GENERALIZED.components):
        yield exclusive(path, *pair)


def _bonds() -> Iterator[Rule]:
    """Yield the rules of debonded arcs, and the requirements of energies and envelopes."""
    line = f"[interface] debonded: missing; {ANGLE_ANALYSIS.in_words('interface')} needs {ARCS.expected}"
    yield _document(
        {"required": ["interface"], "properties": {"interface": _any_section(SOME_ARC)}}, line, ANGLE_ANALYSIS
    )
    # An empty list is meant; of a user's mesh a curve may be debonded.
    ways: Schema = {"anyOf": [{"required": [name]} for name in ("debonded", *STIFFNESSES, "axial_stiffness")]}
    line = f"[interface] debonded: missing; expected {ARCS.expected}, or []: nothing else can open"
    unbroken = ANALYSIS_TYPE.among("stiffness", "load")
    yield _document({"properties": {"interface": _any_section(ways)}}, line, unbroken, MESHED)
    yield exclusive(INTERFACE, "law", "criterion", words="exclude each other; criterion is the older word for law")
    for law in REGISTRY:
        missing = f"missing; law = {toml_value(law.name)} needs it"
        for name in law.needs:
            yield needed(INTERFACE, name, missing, BREAKING, CRITERION.among(law.name))
    type_, unlimited = ENVELOPE_ANALYSIS.in_words(""), [law.name for law in REGISTRY if not law.limits]
    yield _document({"required": ["interface"]}, f"[interface]: missing section; {type_} needs it", ENVELOPE_ANALYSIS)
    for plane, names in ((IN_THE_PLANE, STRENGTHS[:2]), (GENERALIZED, STRENGTHS)):
        finite: Schema = {"maximum": sys.float_info.max, "not": {"enum": [INF]}}
        strong: list[Schema] = [{"required": [name], "properties": {name: finite}} for name in names]
        strong += [{"required": [key], "properties": {key: {"enum": unlimited}}} for key in ("criterion", "law")]
        line = f"[interface] {', '.join(names)}: missing; {type_} needs one"
        bonds = {"properties": {"interface": _any_section({"anyOf": strong})}}
        yield _document(bonds, line, ENVELOPE_ANALYSIS, plane)
    free: Schema = {"required": ["contact"], "properties": {"contact": {"enum": [False]}}}
    cracked: Schema = {"if": _any_section(SOME_ARC), "then": {**free, "items": free}}
    line = f"expected false with debonded arcs; {type_} superposes loads, which contact forbids"
    yield _document({"properties": {"interface": cracked}}, f"[interface] contact: {line}", ENVELOPE_ANALYSIS)


def _along_fibres() -> Iterator[Rule]:
    """Components that generalized plane strain alone has."""
    for path, names in ((("output", "stress"), OUT_OF_PLANE_STRESSES), (("envelope", "plane", ITEMS), ALONG_FIBRES)):
        rule = belonging(path, GENERALIZED, _values(PLANE))
        yield replace(rule, schema={"not": {"enum": [*names]}})


RULES = (
    *_sections_of_an_analysis(),
    *_conditional_keys(),
    *_cell(),
    *_files(),
    *_output(),
    exclusive(("decomposition",), "subdomains", "max_dofs"),
    *_bonds(),
    *_loads(),
    *_along_fibres(),
)
"""In the order of their faults."""
