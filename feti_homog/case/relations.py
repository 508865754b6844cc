"""Read the [interface] sections, find contradictions between keys or sections, and write remarks on loads."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

from feti_homog.case import load_sections
from feti_homog.case.bond_laws import BRANCH, COHESIVE, LAWS, STIFFNESSES, STRENGTHS
from feti_homog.case.interface_section import InterfaceSection, Scatter, interface_tables, labelled
from feti_homog.case.material_sections import coating_faults, missing_expansions
from feti_homog.case.section_values import PAIR
from feti_homog.materials import laws, material_forms, voigt
from feti_homog.schema import TableReader, keys, types, wording

# Relative tolerance between a softening branch and the keys that repeat its numbers.
SAME = 1e-6
# Largest ratio of toughness to the energy at the peak: beyond, 1 - d has fewer than three digits for a damage d near 1.
MOST_BRITTLE = 1e12
COMMON = tuple(name for name, entry in keys.keys_of(InterfaceSection).items() if not entry.by_pair)
"""Keys with one value for all interfaces: every [[interface]] section must repeat this value."""


def relation_faults(sections: Mapping[str, Any], document: Mapping[str, Any], plane: str | None) -> list[str]:
    """List faults that no single key shows, such as loads of zero, repeated waypoints and missing expansions.

    `sections` are the fields of `Case`, None if faulty or absent; `plane` is None if no plane state is valid.
    """
    path, load, angle, envelope = (sections[name] for name in ("path", "single_load", "angle", "envelope"))
    kind, section = ("path", path) if load is None else ("load", load)
    placed = {} if section is None else section.placed
    warm = [place for place, target in placed.items() if load_sections.TEMPERATURE in load_sections.named(target)]
    faults, heated = list[str](), [f"[{kind}] {place}.{load_sections.TEMPERATURE}" for place in warm]
    if load is not None and not any(load.to.named.values()):
        faults.append(f"[load] to = {wording.toml_value(load.to.named)}: expected a load other than zero")
    elif path is not None:
        if plane is not None and [path.strain, path.to, path.waypoints].count(None) == 2:
            loads = load_sections.completed(tuple(placed.values()), plane)
            repeats = [not any(loads[0].values()), *(before == after for before, after in pairwise(loads))]
            formers = ["zero, where the path begins", *list(placed)[:-1]]
            for (place, entry), former, is_repeat in zip(placed.items(), formers, repeats, strict=True):
                value = entry.named if isinstance(entry, load_sections.MixedLoad) else entry
                noun = "load" if isinstance(value, dict) else "strain"
                if is_repeat:
                    given = f"[path] {place} = {wording.toml_value(value)}"
                    faults.append(f"{given}: expected a {noun} other than {former}")
        if path.increments is not None and path.increments < len(placed):
            faults.append(f"[path] increments = {path.increments}: expected at least one for each waypoint")
    if envelope is not None and envelope.temperature is not None:
        heated.append(f"[envelope] {load_sections.TEMPERATURE}")
    if heated:
        faults += missing_expansions(document.get("material"), heated[0])
    faults += coating_faults(sections["cell"], document.get("material"))
    if angle is not None and angle.strain is not None and not any(angle.strain):
        faults.append("[angle] strain: expected a strain other than zero")
    return faults


def axes_lines(
    kind: str, section: load_sections.AnalysisSection, materials: Mapping[str, material_forms.Material], plane: str
) -> tuple[str, ...]:
    """Return (remark,) if axes may be mistaken for ply axes, else (); always () except in generalized plane strain."""
    if plane != voigt.GENERALIZED.name:
        return ()
    from feti_homog.materials import engineering_constants  # needed only in generalized plane strain

    loaded = [name for load in section.placed.values() for name, value in load_sections.named(load).items() if value]
    of_loads = engineering_constants.axes_line(section.plane if isinstance(section, load_sections.Envelope) else loaded)
    phases = [f"[material.{name}]" for name, m in materials.items() if isinstance(m, material_forms.Orthotropic)]
    lines = [f"[{kind}] {of_loads}"] if of_loads else []
    if phases:
        lines.append(f"{', '.join(phases)} E1 and E2 are across the fibres; along them E3")
    return (". ".join(lines),) if lines else ()


def stress_free(
    section: str, placed: Mapping[str, load_sections.Strain | load_sections.MixedLoad], plane: str
) -> tuple[str, ...]:
    """List components that stay free of stress, always or until a waypoint names them, one line per waypoint."""
    first = load_sections.first_named(tuple(placed.values()), plane)
    words = ["", *(f"stress-free before the leg to {place}" for place in [*placed][1:]), "never named: stress-free"]
    unnamed = {k: [name for name, number in first.items() if number == k] for k in range(1, len(words))}
    return tuple(f"[{section}] {', '.join(names)}: {words[k]}" for k, names in unnamed.items() if names)


def read_interfaces(document: Mapping[str, Any], reader: TableReader) -> tuple[InterfaceSection, ...] | None:
    """Read the [interface] sections in file order; None if one is faulty or there are too many, () without any.

    `criterion` gets the name of the law; a softening branch gives missing constants. Faults go to `reader.faults`.
    """
    tables = interface_tables(document)
    if document.get("interface") == []:
        reader.faults.append("interface = []: expected a section [interface]")
    elif len(tables) > types.MOST_SECTIONS:
        reader.faults.append(f"[[interface]]: {len(tables)} sections; expected at most {types.MOST_SECTIONS}")
        return None
    interfaces: list[InterfaceSection] = []
    for label, table in labelled(tables):
        if interface := reader.read(InterfaceSection, table, label):
            named = replace(interface, criterion=interface.law or interface.criterion, law=None)
            interfaces.append(replace(named, **_of_branch(named)))
    if len(interfaces) < len(tables):
        return None
    interfaces = _held(interfaces)
    first: dict[frozenset[str], int] = {}
    for number, (label, interface) in enumerate(labelled(interfaces) if len(tables) > 1 else ()):
        if interface.between is None:
            reader.faults.append(f"[{label}] between: missing; of several [[interface]] each needs {PAIR.expected}")
            continue
        other = first.setdefault(frozenset(interface.between), number)
        if other != number:
            pair = wording.toml_value(interface.between)
            reader.faults.append(f"[{label}] between = {pair}: expected another pair than [interface {other + 1}] has")
        for name in COMMON:
            value, common = getattr(interface, name), getattr(interfaces[0], name)
            if value != common:
                expected = f"expected {_written(common)}, as of [interface 1]: all interfaces agree in it"
                word = "law" if name == "criterion" and name not in tables[number] else name
                reader.faults.append(f"[{label}] {word} = {_written(value)}: {expected}; pairs without one stay bonded")
    for (label, interface), table in zip(labelled(interfaces), tables, strict=True):
        reader.faults += [f"[{label}] {line}" for line in _faults_within(interface, table)]
    return tuple(interfaces)


def _written(value: Any) -> str:
    """Format the value of a key on which all interfaces must agree, as in TOML; "none" for None."""
    table = keys.to_table(value, {}) if isinstance(value, Scatter) else value
    return "none" if table is None else wording.toml_value(table)


def _held(interfaces: list[InterfaceSection]) -> list[InterfaceSection]:
    """Return the sections; bonds that hold, without constants, get 1e4 times the normal constants of breaking ones."""
    names = (*STIFFNESSES, *COHESIVE)
    breaking = next((bond for bond in interfaces if all(getattr(bond, name) for name in names)), None)
    if breaking is None:
        return interfaces
    held = {name: 1e4 * getattr(breaking, name.replace("tangential", "normal")) for name in names}
    return [bond if any(getattr(bond, name) for name in names) else replace(bond, **held) for bond in interfaces]


def _of_branch(interface: InterfaceSection) -> dict[str, Any]:
    """Derive missing normal stiffness, strength and toughness from a softening branch; {} without a valid branch.

    The branch begins at its peak, with opening delta_1 and traction t_1: the stiffness is t_1 / delta_1, the strength
    t_1, and the toughness the area under the elastic line and the branch.
    """
    openings, tractions = interface.openings, interface.tractions
    if BRANCH[0] not in LAWS[interface.criterion].keys:
        return {}
    if not openings or not tractions or len(openings) != len(tractions) or openings[0] == 0.0:
        return {}
    points = list(zip(openings, tractions, strict=True))
    area = sum((there[0] - here[0]) * (there[1] + here[1]) / 2 for here, there in pairwise(points))
    numbers = (tractions[0] / openings[0], tractions[0], area + openings[0] * tractions[0] / 2)
    names = ("normal_stiffness", "normal_strength", "normal_toughness")
    return {name: number for name, number in zip(names, numbers, strict=True) if getattr(interface, name) is None}


def _faults_within(interface: InterfaceSection, table: Mapping[str, Any]) -> Iterator[str]:
    """Yield the faults of an interface section, which is `table` in the file: softening, toughness and friction."""
    law, words = LAWS[interface.criterion], f"friction = {interface.friction:g}: expected 0 with"
    if law.softens:
        needed = [name for name in law.needs if name not in COHESIVE[2:] and getattr(interface, name) is None]
        line = f"law = {wording.toml_value(law.name)} needs a finite one"
        faults = [*(f"{name}: {line}" for name in needed if name in table), *_branch_faults(interface)]
        yield from faults
        for kind in () if faults or needed else ("normal", "tangential"):
            names = (f"{kind}_{name}" for name in ("stiffness", "strength", "toughness"))
            stiffness, strength, toughness = (getattr(interface, name) for name in names)
            if None in (stiffness, strength, toughness):
                continue
            # A bond stores this energy at its peak.
            least = strength**2 / (2 * stiffness)
            if toughness < least * (1.0 - SAME):
                line = f"expected at least {kind}_strength^2 / (2 {kind}_stiffness) = {least:.6g}, stored at the peak"
                yield f"{kind}_toughness = {toughness:g}: {line}"
            elif toughness > MOST_BRITTLE * least:
                line = f"expected at most {MOST_BRITTLE * stiffness * least / toughness:.6g}"
                yield f"{kind}_stiffness = {stiffness:g}: {line}; the damage of stiffer springs has no digits"
    if interface.friction == 0.0:
        return
    if not interface.contact:
        yield f"{words} contact = false: faces that overlap do not press"
    if interface.growth == "released" and "growth" in law.keys:
        yield f'{words} growth = "released"; growth = "springs" goes with it'


def unlike_strengths(
    materials: Mapping[str, material_forms.Material], interfaces: Sequence[InterfaceSection], plane: str
) -> list[str]:
    """List strengths above the stiffness of their phase or, on interfaces, of the softest phase, one per line."""
    if plane == voigt.CONDUCTION.name:  # the laws are conductivities
        return []
    stiffness = {name: float(laws.stiffness_of(material, plane).max()) for name, material in materials.items()}
    bonds = sorted(interfaces, key=lambda bond: bond.normal_strength or math.inf)[:1]  # others may hold
    tables = [
        ("interface", {name: getattr(bond, name) for name in STRENGTHS}, min(stiffness.values())) for bond in bonds
    ]
    strengths = {name: vars(material.strength) for name, material in materials.items() if material.strength}
    tables += [(f"material.{name}.strength", table, stiffness[name]) for name, table in strengths.items()]
    return [
        f"[{section}] {name} = {value:g}: above {least:g}, the stiffness of a phase: are both in one unit?"
        for section, table, least in tables
        for name, value in table.items()
        if least < (value or 0.0) < math.inf
    ]


def _branch_faults(interface: InterfaceSection) -> Iterator[str]:
    """Yield the faults of a softening branch, and numbers that contradict the branch."""
    openings, tractions = interface.openings, interface.tractions
    if openings is None or tractions is None or BRANCH[0] not in LAWS[interface.criterion].keys:
        return
    if len(openings) != len(tractions):
        yield f"openings, tractions: {len(openings)} and {len(tractions)} numbers; expected as many of both"
    elif openings[0] <= 0.0 or sorted({*openings}) != [*openings]:
        yield f"openings = {wording.toml_value(openings)}: expected a rising list of numbers above 0"
    elif tractions[0] <= 0.0 or tractions[-1] != 0.0 or sorted(tractions) != [*tractions[::-1]]:
        branch = wording.toml_value(tractions)
        yield f"tractions = {branch}: expected a softening branch, which falls from its peak to 0"
    else:
        bare = replace(interface, normal_stiffness=None, normal_strength=None, normal_toughness=None)
        for name, number in _of_branch(bare).items():
            given = getattr(interface, name)
            if not math.isclose(given, number, rel_tol=SAME):
                yield f"{name} = {given:g}: expected {number:g}, as from openings and tractions, or no value"
