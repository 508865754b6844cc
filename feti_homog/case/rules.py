"""The relations between keys in a case file."""

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
from feti_homog.case.cell_sizes import CHOSEN
from feti_homog.case.interface_section import ARCS, Arc, Scatter, interface_tables
from feti_homog.case.loads import MixedLoad
from feti_homog.case.section_values import (
    ANALYSIS_TYPE,
    ANGLE_ANALYSIS,
    BREAKING,
    CRITERION,
    ENVELOPE_ANALYSIS,
    GENERALIZED,
    IN_THE_PLANE,
    MESH_FILE,
    MESH_SUFFIXES,
    PLANE,
    TABLE_SUFFIXES,
    VOIDS_OF_A_RANDOM_CELL,
)
from feti_homog.case.sections import OUT_OF_PLANE_STRESSES, SECTIONS, SECTIONS_OF_AN_ANALYSIS
from feti_homog.case.uncertainty import DIFFERENTIABLE
from feti_homog.materials.voigt import PLANE_STATES, SPATIAL_STRAINS, SPATIAL_STRESSES, STRAINS, STRESSES
from feti_homog.schema.keys import (
    ITEMS,
    Rule,
    Selector,
    TablePath,
    belonging,
    exclusive,
    has,
    keys_of,
    needed,
    refused,
)
from feti_homog.schema.values import INF, Test
from feti_homog.schema.wording import toml_value

CELL, INTERFACE, LOADS = ("cell",), ("interface",), ("strain", "to", "waypoints")
PLACES_OF_LOADS: tuple[TablePath, ...] = (("path", "to"), ("path", "waypoints", ITEMS), ("load", "to"))
PLACES_OF_TABLES: tuple[tuple[TablePath, type[Any]], ...] = (
    *(((section,), contents) for section, contents in SECTIONS.items()),
    (("interface", "debonded", ITEMS), Arc),
    (("interface", "scatter"), Scatter),
    *((place, MixedLoad) for place in PLACES_OF_LOADS),
)


def _values(selector: Selector) -> Sequence[str]:
    """Return the values that a selector may have."""
    return keys_of(SECTIONS[selector.section])[selector.key].type.options


def _conditional_keys() -> Iterator[Rule]:
    """Require or refuse sections and keys by selector values."""
    for section, condition in SECTIONS_OF_AN_ANALYSIS.items():
        line = f"[{section}]: missing section; {condition.in_words(section)} needs it"
        yield Rule((), partial(_has_section, section), line, (condition,))
        yield belonging((section,), condition, _values(ANALYSIS_TYPE))
    for path, contents in PLACES_OF_TABLES:
        for name, entry in keys_of(contents).items():
            for k, condition in enumerate(entry.only):
                above, values = entry.only[:k], _values(condition.selector)
                yield belonging((*path, name), condition, values, *above, instead=entry.instead)
            if entry.required and entry.only:
                line = f"missing; expected {entry.type.expected}"
                yield needed(path, name, line, *entry.only, unless=entry.unless)


def _has_section(section: str, document: Any) -> bool:
    return section in document


def _cell() -> Iterator[Rule]:
    """Yield the requirements and exclusions among the keys of [cell]."""
    yield exclusive(CELL, "width", "fibre_radius")
    line = "exclude each other; accuracy chooses the sizes"
    yield Rule(
        CELL, lambda cell: not any(has(cell, "accuracy", name) for name in CHOSEN), line, names=("accuracy", *CHOSEN)
    )
    yield exclusive(CELL, "fibre_fraction", "mix")
    yield exclusive(CELL, "match", "mix")
    yield _belongs_beside("radii", "mix", "; use fibre_radius")
    yield exclusive(CELL, "fibre_radius", "radii")
    line = "exclude each other beside radii; one follows from the other"
    yield Rule(CELL, lambda cell: not has(cell, "radii", "fibres", "width"), line, names=("fibres", "width"))
    number = keys_of(Cell)["fibres"].type.expected
    line = f"missing; expected {number}, or the width of the cell"
    yield needed(CELL, "fibres", line, beside="radii", unless=("width",))
    yield _belongs_beside("void_radius", "voids")
    line = f"expected {VOIDS_OF_A_RANDOM_CELL.expected}"
    yield refused((*CELL, "voids"), lambda value: isinstance(value, bool), line, RANDOM)
    line = "expected true or false: the mesh has its voids"
    yield refused((*CELL, "voids"), lambda value: not isinstance(value, bool), line, MESH)
    yield exclusive(CELL, "match", "voids", words="exclude each other; cells that match a table have no voids")
    names, line = ("match", "radius_spread"), "exclude each other; the table gives the radii"
    yield Rule(CELL, lambda cell: not has(cell, *names) or _at_most(0, cell["radius_spread"]), line, names=names)
    fewer = partial(_at_most, math.nextafter(FEWEST_MATCHED, 0))
    yield Rule(
        CELL,
        lambda cell: not has(cell, "match", "fibres") or not fewer(cell["fibres"]),
        lambda cell, _: f" = {cell['fibres']}: expected at least {FEWEST_MATCHED} with match",
        names=("fibres",),
    )


def _belongs_beside(name: str, owner: str, words: str = "") -> Rule:
    """Require `owner` wherever `name` is given in [cell]."""
    line = f"belongs to {owner}, which is missing{words}"
    return Rule(CELL, lambda cell: not has(cell, name) or owner in cell, line, names=(name,))


def _at_most(limit: float, value: Any) -> bool:
    """Return whether the value is a number up to the limit."""
    return isinstance(value, int | float) and not isinstance(value, bool) and value <= limit


def _files() -> Iterator[Rule]:
    """Require a mesh file, and a fibre file or list beside the cell size."""
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
    return isinstance(value, str) and value.endswith(suffixes)


def _bonds() -> Iterator[Rule]:
    """Yield the rules for debonded arcs, and the requirements for energies and envelopes."""
    start = "[interface] debonded: missing"
    line = f"{start}; {ANGLE_ANALYSIS.in_words('interface')} needs {ARCS.expected}"
    cracked = partial(_any_section, _some_arc)
    yield Rule((), lambda document: "interface" in document and cracked(document), line, (ANGLE_ANALYSIS,))
    # An empty list is meant; of a user's mesh a curve may be debonded.
    ways = ("debonded", *STIFFNESSES, "axial_stiffness")
    line = f"{start}; expected {ARCS.expected}, or []: nothing else can open"
    opens = partial(_any_section, lambda table: any(name in table for name in ways))
    yield Rule((), opens, line, (ANALYSIS_TYPE.among("stiffness", "load"), MESHED))
    yield exclusive(INTERFACE, "law", "criterion", words="exclude each other; criterion is the older word for law")
    for law in REGISTRY:
        for name in law.needs:
            missing = f"missing; law = {toml_value(law.name)} needs it"
            yield needed(INTERFACE, name, missing, BREAKING, CRITERION.among(law.name))
    type_ = ENVELOPE_ANALYSIS.in_words("")
    line = f"[interface]: missing section; {type_} needs it"
    yield Rule((), partial(_has_section, "interface"), line, (ENVELOPE_ANALYSIS,))
    for plane, names in ((IN_THE_PLANE, STRENGTHS[:2]), (GENERALIZED, STRENGTHS)):
        line = f"[interface] {', '.join(names)}: missing; {type_} needs one"
        yield Rule((), partial(_any_section, partial(_breaks, names)), line, (ENVELOPE_ANALYSIS, plane))
    line = f"expected false with debonded arcs; {type_} superposes loads, which contact forbids"
    yield Rule((), _touches_nowhere, f"[interface] contact: {line}", (ENVELOPE_ANALYSIS,))


def _any_section(test: Test, document: Any) -> bool:
    """Return whether [interface], or one of several, passes a test; other types are faults elsewhere."""
    tables = interface_tables(document)
    return "interface" not in document or any(not isinstance(table, dict) or test(table) for table in tables)


def _some_arc(table: Any) -> bool:
    """Return whether a section has debonded arcs."""
    return has(table, "debonded") and table["debonded"] != []


def _breaks(strengths: Sequence[str], table: Any) -> bool:
    """Return whether bonds of a section break under some load: a finite strength, or a law without one."""
    unlimited = [law.name for law in REGISTRY if not law.limits]
    is_finite = (has(table, name) and table[name] not in (math.inf, INF) for name in strengths)
    return any(is_finite) or any(has(table, key) and table[key] in unlimited for key in ("criterion", "law"))


def _touches_nowhere(document: Any) -> bool:
    """Return whether no debonded arcs come with contact."""
    tables = interface_tables(document)
    is_free = all(has(table, "contact") and table["contact"] is False for table in tables if isinstance(table, dict))
    return is_free or not any(map(_some_arc, tables))


def _loads() -> Iterator[Rule]:
    """Allow one form of a path, and a component's strain or stress; names in generalized plane strain."""
    yield replace(needed(("path",), LOADS[0], "missing; give one", unless=LOADS), names=LOADS)
    yield exclusive(("path",), *LOADS)
    line = f"expected a table such as {{E11 = 0.01}} in {GENERALIZED.in_words('path')}"
    yield refused(("path", "waypoints", ITEMS), lambda value: isinstance(value, list), line, GENERALIZED)
    for path, pair in product(PLACES_OF_LOADS, PLANE_STATES["generalized"].components):
        yield exclusive(path, *pair)


def _outputs() -> Iterator[Rule]:
    """Refuse outputs that some analyses cannot give."""
    others = ANALYSIS_TYPE.among(*(name for name in _values(ANALYSIS_TYPE) if name not in DIFFERENTIABLE))
    line = f"belongs to [analysis] type = {' or '.join(map(toml_value, DIFFERENTIABLE))}"
    yield refused(("output", "sensitivities"), lambda value: value is True, line, others)


def _along_fibres() -> Iterator[Rule]:
    """Refuse components along the fibres outside generalized plane strain."""
    along = [name for name in (*SPATIAL_STRESSES, *SPATIAL_STRAINS) if name not in (*STRESSES, *STRAINS)]
    for path, names in ((("output", "stress"), OUT_OF_PLANE_STRESSES), (("envelope", "plane", ITEMS), along)):
        yield replace(belonging(path, GENERALIZED, _values(PLANE)), holds=partial(_is_none_of, names))


def _is_none_of(names: Sequence[str], value: Any) -> bool:
    return value not in names


RULES = (
    *_conditional_keys(),
    *_cell(),
    *_files(),
    *_outputs(),
    exclusive(("decomposition",), "subdomains", "max_dofs"),
    *_bonds(),
    *_loads(),
    *_along_fibres(),
)
"""In the order of their faults."""
