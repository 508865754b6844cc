"""The relations between the keys of a case file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from operator import eq
from typing import Any

from feti_homog.case.bond_laws import REGISTRY, STIFFNESSES, STRENGTHS
from feti_homog.case.cell_files import FEWEST_MATCHED
from feti_homog.case.cell_section import MESH, MESHED, RANDOM, TABLE, Cell
from feti_homog.case.element_sizes import CHOSEN
from feti_homog.case.interface_section import ARCS, Arc, Scatter
from feti_homog.case.mixed_load import MixedLoad
from feti_homog.case.section_values import MESH_FILE, MESH_SUFFIXES, TABLE_SUFFIXES, VOIDS_OF_A_RANDOM_CELL
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
from feti_homog.materials.voigt import PLANE_STATES, SPATIAL_STRAINS, SPATIAL_STRESSES, STRAINS, STRESSES
from feti_homog.schema.keys import Condition, Selector, keys_of
from feti_homog.schema.rules import (
    ITEMS,
    Path,
    Place,
    Rule,
    Test,
    belonging,
    exclusive,
    has,
    misplaced,
    needed,
    refused,
)
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


def _some_arc(table: Any) -> bool:
    """Return whether a section has debonded arcs."""
    return has(table, "debonded") and table["debonded"] != []


def _any_section(test: Test) -> Test:
    """Return the test that [interface], or one of several, passes a test; other types are faults elsewhere."""

    def holds(document: Any) -> bool:
        section = document.get("interface")
        tables = section if isinstance(section, list) else [section]
        return any(not isinstance(table, dict) or test(table) for table in tables)

    return holds


def _given(section: str) -> Test:
    """Return the test that a document has a section."""
    return lambda document: section in document


def _values(selector: Selector) -> Sequence[str]:
    """Return the values that a selector may have."""
    return keys_of(SECTIONS[selector.section])[selector.key].type.options


def _sections_of_an_analysis() -> Iterator[Rule]:
    """Sections that one type of analysis needs, and that no other has."""
    for section, own in SECTIONS_OF_AN_ANALYSIS.items():
        line = f"[{section}]: missing section; {own.in_words(section)} needs it"
        yield _document(_given(section), line, own)
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


def _document(holds: Test, line: str, *when: Condition) -> Rule:
    """Return a rule for the document as a whole."""
    return Rule((), holds, lambda _: line, when)


def _cell() -> Iterator[Rule]:
    """Yield the requirements and exclusions among the keys of [cell]."""
    yield exclusive(CELL, "width", "fibre_radius")
    yield Rule(CELL, lambda cell: not any(has(cell, "accuracy", name) for name in CHOSEN), _sizes)
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
    line = f"expected {VOIDS_OF_A_RANDOM_CELL.expected}"
    yield refused((*CELL, "voids"), lambda value: isinstance(value, bool), line, RANDOM)
    line = "expected true or false: the mesh has its voids"
    yield refused((*CELL, "voids"), lambda value: not isinstance(value, bool), line, MESH)
    yield exclusive(CELL, "match", "voids", words="exclude each other; cells that match a table have no voids")
    line = "exclude each other; the table gives the radii"
    yield Rule(
        CELL,
        lambda cell: not has(cell, "match", "radius_spread") or _below(cell["radius_spread"], 0, or_equal=True),
        lambda at: f"{at.named('match', 'radius_spread')}: {line}",
    )
    yield Rule(
        CELL,
        lambda cell: not has(cell, "match", "fibres") or not _below(cell["fibres"], FEWEST_MATCHED),
        lambda at: f"{at.named('fibres')} = {at.value['fibres']}: expected at least {FEWEST_MATCHED} with match",
    )


def _below(value: Any, limit: float, or_equal: bool = False) -> bool:
    """Return whether the value is a number below the limit."""
    is_of_type = isinstance(value, int | float) and not isinstance(value, bool)
    return is_of_type and (value < limit or (or_equal and value == limit))


def _sizes(place: Place) -> str:
    """Return the fault of a cell that asks for an accuracy and gives sizes too."""
    given = [name for name in CHOSEN if name in place.value]
    return f"{place.named('accuracy', *given)}: exclude each other; accuracy chooses the sizes"


def _files() -> Iterator[Rule]:
    """Yield a mesh comes in a file; the fibres of a table come in a file, or in a list beside the size of the cell."""
    yield exclusive(CELL, "file", "fibre_list")
    yield needed(CELL, "file", f"missing; expected the name of a {MESH_FILE}", MESH)
    line = "missing; expected the name of a .csv file, or fibre_list"
    yield needed(CELL, "file", line, TABLE, unless=("fibre_list",))
    for suffixes, expected, geometry in ((TABLE_SUFFIXES, MESH_FILE, MESH), (MESH_SUFFIXES, ".csv file", TABLE)):
        line = f"expected the name of a {expected} for {geometry.in_words('cell')}"
        yield refused((*CELL, "file"), partial(_ends, suffixes), line, geometry)
    for wrong, right, geometry in (("overlaps", "snap", MESH), ("snap", "overlaps", TABLE)):
        line = f'expected "none" or "{right}" for {geometry.in_words("cell")}'
        yield refused((*CELL, "repair"), partial(eq, wrong), line, geometry)
    for name in ("width", "height"):
        line = "missing; fibre_list has no line such as # width = 120, height = 80"
        yield needed(CELL, name, line, TABLE, beside="fibre_list")


def _ends(suffixes: tuple[str, ...], value: Any) -> bool:
    """Return whether the value is the name of a file with one of some suffixes."""
    return isinstance(value, str) and value.endswith(suffixes)


def _output() -> Iterator[Rule]:
    """Yield what some analyses cannot give."""
    others = ANALYSIS_TYPE.among(*(name for name in _values(ANALYSIS_TYPE) if name not in DIFFERENTIABLE))
    line = f"belongs to [analysis] type = {' or '.join(map(toml_value, DIFFERENTIABLE))}"
    yield refused(("output", "sensitivities"), lambda value: value is True, line, others)


def _loads() -> Iterator[Rule]:
    """One form of a path; of each component its strain or its stress, by name in generalized plane strain."""
    yield Rule(
        ("path",),
        lambda path: not isinstance(path, dict) or any(name in path for name in LOADS),
        lambda place: f"{place.named(*LOADS)}: missing; give one",
    )
    yield exclusive(("path",), *LOADS)
    line = f"expected a table such as {{E11 = 0.01}} in {GENERALIZED.in_words('path')}"
    yield refused(("path", "waypoints", ITEMS), lambda value: isinstance(value, list), line, GENERALIZED)
    for path, pair in product(PLACES_OF_LOADS, PLANE_STATES["generalized"].components):
        yield exclusive(path, *pair)


def _bonds() -> Iterator[Rule]:
    """Yield the rules of debonded arcs, and the requirements of energies and envelopes."""
    line = f"[interface] debonded: missing; {ANGLE_ANALYSIS.in_words('interface')} needs {ARCS.expected}"
    cracked = _any_section(_some_arc)
    yield _document(lambda document: "interface" in document and cracked(document), line, ANGLE_ANALYSIS)
    # An empty list is meant; of a user's mesh a curve may be debonded.
    ways = ("debonded", *STIFFNESSES, "axial_stiffness")
    line = f"[interface] debonded: missing; expected {ARCS.expected}, or []: nothing else can open"
    unbroken = ANALYSIS_TYPE.among("stiffness", "load")
    yield _document(_any_section(lambda table: any(name in table for name in ways)), line, unbroken, MESHED)
    yield exclusive(INTERFACE, "law", "criterion", words="exclude each other; criterion is the older word for law")
    for law in REGISTRY:
        missing = f"missing; law = {toml_value(law.name)} needs it"
        for name in law.needs:
            yield needed(INTERFACE, name, missing, BREAKING, CRITERION.among(law.name))
    type_ = ENVELOPE_ANALYSIS.in_words("")
    line = f"[interface]: missing section; {type_} needs it"
    yield _document(_given("interface"), line, ENVELOPE_ANALYSIS)
    for plane, names in ((IN_THE_PLANE, STRENGTHS[:2]), (GENERALIZED, STRENGTHS)):
        line = f"[interface] {', '.join(names)}: missing; {type_} needs one"
        yield _document(_any_section(partial(_breaks, names)), line, ENVELOPE_ANALYSIS, plane)
    line = f"expected false with debonded arcs; {type_} superposes loads, which contact forbids"
    yield _document(_touches_nowhere, f"[interface] contact: {line}", ENVELOPE_ANALYSIS)


def _breaks(strengths: Sequence[str], table: Any) -> bool:
    """Return whether bonds of a section break under some load: a finite strength, or a law without one."""
    unlimited = [law.name for law in REGISTRY if not law.limits]
    is_finite = (has(table, name) and table[name] not in (math.inf, INF) for name in strengths)
    return any(is_finite) or any(has(table, key) and table[key] in unlimited for key in ("criterion", "law"))


def _touches_nowhere(document: Any) -> bool:
    """Return whether no debonded arcs come with contact."""
    section = document.get("interface")
    tables = section if isinstance(section, list) else [section]
    is_free = all(has(table, "contact") and table["contact"] is False for table in tables if isinstance(table, dict))
    return is_free or not any(map(_some_arc, tables))


def _along_fibres() -> Iterator[Rule]:
    """Components that generalized plane strain alone has."""
    for path, names in ((("output", "stress"), OUT_OF_PLANE_STRESSES), (("envelope", "plane", ITEMS), ALONG_FIBRES)):
        rule = belonging(path, GENERALIZED, _values(PLANE))
        yield replace(rule, holds=partial(_is_none_of, names))


def _is_none_of(names: Sequence[str], value: Any) -> bool:
    return value not in names


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
