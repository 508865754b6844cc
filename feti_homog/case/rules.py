"""Define the rules between keys of a case file, such as requirements and exclusions, and the text of their faults."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

from feti_homog.case import section_values as kinds
from feti_homog.case.bond_laws import COHESIVE, REGISTRY, STIFFNESSES, STRENGTHS
from feti_homog.case.cell_section import MESH, MESHED, OWN_MESH, PIXELS, RANDOM, TABLE, Cell
from feti_homog.case.cell_sizes import CHOSEN
from feti_homog.case.interface_section import ARCS, Arc, Scatter, interface_tables
from feti_homog.case.load_sections import MixedLoad
from feti_homog.case.sections import DIFFERENTIABLE, SECTIONS, SECTIONS_OF_AN_ANALYSIS
from feti_homog.errors import MOST_FAULTS
from feti_homog.materials import voigt
from feti_homog.schema import keys, types, wording

TablePath = tuple[str, ...]
ITEMS = "items"
"""The path entry that denotes every item of a list."""
CELL, INTERFACE, LOADS = ("cell",), ("interface",), ("strain", "to", "waypoints")
UNIT_LOADS = ("stiffness", "conductivity")
"""The analyses under unit loads, at one state of the bonds."""
PLACES_OF_LOADS: tuple[TablePath, ...] = (("path", "to"), ("path", "waypoints", ITEMS), ("load", "to"))
PLACES_OF_TABLES: tuple[tuple[TablePath, type[Any]], ...] = (
    *(((section,), contents) for section, contents in SECTIONS.items()),
    (("interface", "debonded", ITEMS), Arc),
    (("interface", "scatter"), Scatter),
    *((place, MixedLoad) for place in PLACES_OF_LOADS),
)


@dataclass(frozen=True)
class Rule:
    """A requirement on the value at a document path, under some conditions.

    Attributes:
        path: names from the section to a table or value; without a value there, the rule holds. Empty: the document.
        holds: test of the value; None if the path must not have a value.
        words: end of the fault line, or a function of the value and the selected options that returns this end.
        when: conditions; the rule applies if all hold.
        names: keys in the fault line; if the table has some of them, only these. Empty: the line shows the value.
    """

    path: TablePath
    holds: types.Test | None
    words: str | Callable[[Any, keys.Selected], str]
    when: tuple[keys.Condition, ...] = ()
    names: tuple[str, ...] = ()

    def faults(self, document: Mapping[str, Any], selected: keys.Selected) -> Iterator[str]:
        """Yield one line for each value that breaks the rule; sections are numbered from 1, items of a list from 0."""
        if not all(condition.holds(selected) for condition in self.when):
            return
        content = document.get(self.path[0]) if self.path else document
        sections = content[: types.MOST_SECTIONS] if isinstance(content, list) else [content]
        label = " ".join(self.path[:1])
        matches = [(f"{label} {k}" if len(sections) > 1 else label, "", each) for k, each in enumerate(sections, 1)]
        for step in self.path[1:]:
            parents, matches = matches, []
            for name, place, parent in parents:
                if step == ITEMS and isinstance(parent, list):
                    matches += [(name, f"{place}[{k}]", item) for k, item in enumerate(parent[: types.MOST_ROWS])]
                elif isinstance(parent, dict) and step in parent:
                    matches.append((name, f"{place}.{step}" if place else step, parent[step]))
        faulty = (match for match in matches if match[2] is not None and not (self.holds and self.holds(match[2])))
        for count, (section, place, value) in enumerate(faulty):
            words = f": {self.words}" if isinstance(self.words, str) else self.words(value, selected)
            shown = wording.toml_value(value) if count <= MOST_FAULTS else ""  # others are only counted
            subject = f" {place} = {shown}" if place else ""
            if self.names:
                above, names = f"{place}." if place else "", [name for name in self.names if name in value]
                subject = f" {', '.join(above + name for name in names or self.names)}"
            yield f"[{section}]{subject}{words}" if self.path else words.removeprefix(": ")


def has(table: Any, *names: str) -> bool:
    """Return whether a value is a table with all the keys `names`."""
    return isinstance(table, dict) and {*names} <= table.keys()


def exclusive(path: TablePath, *names: str, words: str = "exclude each other; give one") -> Rule:
    """Return the rule that a table at `path` has at most one of the keys `names`."""
    return Rule(path, lambda table: sum(has(table, name) for name in names) < 2, words, names=names)


def needed(
    path: TablePath, name: str, words: str, *when: keys.Condition, beside: str = "", unless: Sequence[str] = ()
) -> Rule:
    """Return the rule that a table at `path` has the key `name`, or one of the keys `unless`.

    The rule applies under the conditions `when` and, if a key `beside` is given, only to tables with this key.
    """

    def holds(table: Any) -> bool:
        is_asked = isinstance(table, dict) and (not beside or beside in table)
        return not is_asked or any(each in table for each in (name, *unless))

    return Rule(path, holds, words, when, (name,))


def belonging(
    path: TablePath, condition: keys.Condition, values: Sequence[str], *when: keys.Condition, instead: str = ""
) -> Rule:
    """Return the rule that refuses the key or section at `path` unless the selector has a value of `condition`.

    The rule applies under the conditions `when`. `values` are all values of the selector; the fault advises `instead`.
    """
    others = tuple(value for value in values if value not in condition.values)

    def words(_: Any, selected: keys.Selected) -> str:
        owner = f"{condition.in_words(path[0])}, not {wording.toml_value(selected[condition.selector])}"
        return f": belongs to {owner}{f'; use {instead}' if instead else ''}"

    return Rule(path, None, words, (*when, condition.selector.among(*others)))


def _values(selector: keys.Selector) -> Sequence[str]:
    """Return the valid values of a selector."""
    return keys.keys_of(SECTIONS[selector.section])[selector.key].type.options


def _conditional_keys() -> Iterator[Rule]:
    """Yield the rules by which selector values require or refuse sections and keys."""
    for section, condition in SECTIONS_OF_AN_ANALYSIS.items():
        line = f"[{section}]: missing section; {condition.in_words(section)} needs it"
        yield needed((), section, line, condition)
        yield belonging((section,), condition, _values(kinds.ANALYSIS_TYPE))
    for path, contents in PLACES_OF_TABLES:
        for name, entry in keys.keys_of(contents).items():
            for k, condition in enumerate(entry.only):
                above, values = entry.only[:k], _values(condition.selector)
                instead = entry.instead if condition is entry.only[-1] else ""
                yield belonging((*path, name), condition, values, *above, instead=instead)
            if entry.required and entry.only:
                line = f"missing; expected {entry.type.expected}"
                yield needed(path, name, line, *entry.only, unless=entry.unless)


def _cell() -> Iterator[Rule]:
    """Yield the requirements and exclusions between keys of [cell]."""
    for pair in (("width", "fibre_radius"), ("fibre_fraction", "mix"), ("match", "mix"), ("fibre_radius", "radii")):
        yield exclusive(CELL, *pair)
    names, line = ("accuracy", *CHOSEN), "exclude each other; accuracy chooses the sizes"
    yield Rule(CELL, lambda cell: not has(cell, "accuracy") or {*CHOSEN}.isdisjoint(cell), line, names=names)
    for name, owner, instead in (("radii", "mix", "; use fibre_radius"), ("void_radius", "voids", "")):
        line = f"belongs to {owner}, which is missing{instead}"
        yield replace(needed(CELL, owner, line, beside=name), names=(name,))
    line = "exclude each other beside radii; one follows from the other"
    yield Rule(CELL, lambda cell: not has(cell, "radii", "fibres", "width"), line, names=("fibres", "width"))
    number = keys.keys_of(Cell)["fibres"].type.expected
    line = f"missing; expected {number}, or the width of the cell"
    yield needed(CELL, "fibres", line, beside="radii", unless=("width",))
    line = f"expected {kinds.VOIDS_OF_A_RANDOM_CELL.expected}"
    yield Rule((*CELL, "voids"), lambda value: not isinstance(value, bool), line, (RANDOM,))
    line = "expected true or false: the mesh gives the voids"
    yield Rule((*CELL, "voids"), lambda value: isinstance(value, bool), line, (MESH,))
    unit_loads, types_of_analysis = kinds.ANALYSIS_TYPE.among(*UNIT_LOADS), _values(kinds.ANALYSIS_TYPE)
    rule = belonging((*CELL, "boundary"), unit_loads, types_of_analysis, OWN_MESH)
    yield replace(rule, holds=lambda value: value == "periodic")
    line = 'excludes repair = "snap" and smooth = true, whose sides match'

    def matches(cell: Any) -> bool:
        is_periodic = not has(cell, "boundary") or cell["boundary"] == "periodic"
        return is_periodic or (cell.get("repair") != "snap" and cell.get("smooth") is not True)

    yield Rule(CELL, matches, line, (OWN_MESH,), ("boundary",))
    yield exclusive(CELL, "match", "voids", words="exclude each other; cells that match a table have no voids")
    pair, line = ("match", "radius_spread"), "exclude each other; the table gives the radii"
    yield Rule(CELL, lambda cell: not has(cell, *pair) or cell["radius_spread"] == 0, line, names=pair)


def _files() -> Iterator[Rule]:
    """Yield the rules for mesh files, fibre tables and fibre lists."""
    yield exclusive(CELL, "file", "fibre_list")
    line = "missing; expected the name of a .csv file, or fibre_list"
    yield needed(CELL, "file", line, TABLE, unless=("fibre_list",))
    files = {MESH: (kinds.MESH_FILE, [*kinds.MESH_SUFFIXES]), PIXELS: (kinds.IMAGE_FILE, [*kinds.IMAGE_SUFFIXES])}
    for condition, (words, _) in files.items():
        yield needed(CELL, "file", f"missing; expected the name of a {words}", condition)
    files[TABLE] = (".csv file", [*kinds.TABLE_SUFFIXES])
    for condition, (words, suffixes) in files.items():
        others = {suffix for _, some in files.values() for suffix in some} - {*suffixes}
        yield _refused("file", types.file_name("", *others), f"the name of a {words}", condition)
    yield _refused("repair", types.choice("overlaps"), '"none" or "snap"', MESH)
    yield _refused("repair", types.choice("snap"), '"none" or "overlaps"', TABLE)
    yield _refused("window", types.choice("mirrored"), '"periodic" or "cut"', TABLE)
    yield _refused("window", types.choice("cut"), '"periodic" or "mirrored"', PIXELS)
    line = "belongs to smooth = true; else elements are halves of pixels"

    def has_default_size(cell: Any) -> bool:
        return cell.get("smooth") is True or cell.get("mesh_size", Cell.mesh_size) == Cell.mesh_size

    yield Rule(CELL, has_default_size, line, (PIXELS,), ("mesh_size",))
    for name in ("width", "height"):
        line = "missing; fibre_list has no line such as # width = 120, height = 80"
        yield needed(CELL, name, line, TABLE, beside="fibre_list")


def _refused(name: str, values: types.ValueType, ways: str, condition: keys.Condition) -> Rule:
    """Return the rule that refuses `values` of the [cell] key `name` under a condition and advises the other `ways`."""
    line = f"expected {ways} for {condition.in_words('cell')}"
    return Rule((*CELL, name), lambda value: not values.accepts(value), line, (condition,))


def _bonds() -> Iterator[Rule]:
    """Yield the rules for debonded arcs, bond laws and envelopes."""
    start = "[interface] debonded: missing"
    line = f"{start}; {kinds.ANGLE_ANALYSIS.in_words('interface')} needs {ARCS.expected}"
    cracked = partial(_any_section, _some_arc)
    yield Rule((), lambda document: "interface" in document and cracked(document), line, (kinds.ANGLE_ANALYSIS,))
    # An empty list is a decision of the user. In a user's mesh a curve may be debonded instead.
    ways = ("debonded", *STIFFNESSES, "axial_stiffness")
    line = f"{start}; expected {ARCS.expected}, or []: nothing else can open"
    opens = partial(_any_section, lambda table: any(name in table for name in ways))
    yield Rule((), opens, line, (kinds.ANALYSIS_TYPE.among("stiffness", "load"), MESHED))
    yield exclusive(INTERFACE, "law", "criterion", words="exclude each other; criterion is the older word for law")

    def has_constant(key: str, table: Any) -> bool:
        never_break = all(has(table, name) and table[name] in (math.inf, types.INF) for name in COHESIVE[:2])
        return not isinstance(table, dict) or key in table or never_break

    for law in REGISTRY:
        when = (kinds.BREAKING, kinds.CRITERION.among(law.name))
        for name in law.needs:
            yield Rule(INTERFACE, partial(has_constant, name), partial(law.missing, name), when, (name,))
    type_ = kinds.ENVELOPE_ANALYSIS.in_words("")
    yield needed((), "interface", f"[interface]: missing section; {type_} needs it", kinds.ENVELOPE_ANALYSIS)
    for plane, names in ((kinds.IN_THE_PLANE, STRENGTHS[:2]), (kinds.GENERALIZED, STRENGTHS)):
        line = f"[interface] {', '.join(names)}: missing; {type_} needs one"
        yield Rule((), partial(_any_section, partial(_breaks, names)), line, (kinds.ENVELOPE_ANALYSIS, plane))

    def touches_nowhere(document: Any) -> bool:
        tables = [table for table in interface_tables(document) if isinstance(table, dict)]
        return all(table.get("contact") is False for table in tables) or not any(map(_some_arc, tables))

    way = 'which contact forbids: type = "path" finds the onset of one load'
    line = f"expected false with debonded arcs; {type_} superposes loads, {way}"
    yield Rule((), touches_nowhere, f"[interface] contact: {line}", (kinds.ENVELOPE_ANALYSIS,))


def _any_section(test: types.Test, document: Any) -> bool:
    """Return whether any [interface] section passes `test` or is no table; True without the key `interface`."""
    tables = interface_tables(document)
    return "interface" not in document or any(not isinstance(table, dict) or test(table) for table in tables)


def _some_arc(table: Any) -> bool:
    """Return whether an interface section has debonded arcs."""
    return has(table, "debonded") and table["debonded"] != []


def _breaks(strengths: Sequence[str], table: Any) -> bool:
    """Return whether bonds can break: by a finite one of the `strengths`, or by a law that always has a limit."""
    unlimited = [law.name for law in REGISTRY if not law.limits]
    is_finite = (has(table, name) and table[name] not in (math.inf, types.INF) for name in strengths)
    return any(is_finite) or any(has(table, key) and table[key] in unlimited for key in ("criterion", "law"))


def _loads_and_outputs() -> Iterator[Rule]:
    """Yield the rules for loads, and for outputs that some analyses do not have."""
    yield replace(needed(("path",), LOADS[0], "missing; give one", unless=LOADS), names=LOADS)
    yield exclusive(("path",), *LOADS)
    line = f"expected a table such as {{E11 = 0.01}} in {kinds.GENERALIZED.in_words('path')}"
    yield Rule(("path", "waypoints", ITEMS), lambda value: not isinstance(value, list), line, (kinds.GENERALIZED,))
    for path, pair in product(PLACES_OF_LOADS, voigt.PLANE_STATES["generalized"].components):
        yield exclusive(path, *pair)
    plane, scalar = ("analysis", "plane"), voigt.CONDUCTION.name
    line = f'expected {wording.toml_value(scalar)}, or no plane, in type = "conductivity"'
    yield Rule(plane, lambda value: value == scalar, line, (kinds.CONDUCTIVITY,))
    line = 'belongs to type = "conductivity"'
    yield Rule(plane, lambda value: value != scalar, line, (kinds.MECHANICAL,))
    condition = kinds.ANALYSIS_TYPE.among(*DIFFERENTIABLE)
    rule = belonging(("output", "sensitivities"), condition, _values(kinds.ANALYSIS_TYPE))
    yield replace(rule, holds=lambda value: value is not True)
    along = {*voigt.SPATIAL_STRESSES, *voigt.SPATIAL_STRAINS} - {*voigt.STRESSES, *voigt.STRAINS}
    for place in (("output", "stress"), ("envelope", "plane", ITEMS)):
        rule = belonging(place, kinds.GENERALIZED, _values(kinds.PLANE))
        yield replace(rule, holds=lambda value: str(value) not in along)


RULES = (
    *_conditional_keys(),
    *_cell(),
    *_files(),
    exclusive(("decomposition",), "subdomains", "max_dofs"),
    *_bonds(),
    *_loads_and_outputs(),
)
"""All rules, in the order in which their faults are printed."""
