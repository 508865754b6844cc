"""Reading the sections of imperfect bonding, [interface] and [angle], and what must hold between their keys."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from feti_homog.case.cell_section import GEOMETRY, MESHED
from feti_homog.case.interface_section import STIFFNESSES, STRENGTHS, Arc, InterfaceSection
from feti_homog.case.section_values import ARCS, PAIR
from feti_homog.case.sections import SECTIONS_OF_AN_ANALYSIS, Angle
from feti_homog.case.selectors import ANALYSIS_TYPE, GENERALIZED, PLANE
from feti_homog.schema.keys import Selected, TableReader
from feti_homog.schema.wording import toml_value

COMMON = ("contact", "criterion", "growth")
"""The keys in which all sections [[interface]] agree."""


def misplaced_sections(document: Mapping[str, Any], analysis: str | None) -> list[str]:
    """Faults of sections that are missing or belong to another type of analysis (None: faulty)."""
    faults = []
    for section, condition in SECTIONS_OF_AN_ANALYSIS.items():
        words = condition.in_words(section)
        if section not in document and analysis in condition.values:
            faults.append(f"[{section}]: missing section; {words} needs it")
        elif section in document and analysis not in (*condition.values, None):
            faults.append(f"[{section}]: belongs to {words}, not {toml_value(analysis)}")
    return faults


def interface_tables(document: Mapping[str, Any]) -> list[Any]:
    """The section [interface], or all of several sections [[interface]]; none if there is none."""
    given = document.get("interface", [])
    return given if isinstance(given, list) else [given]


def interface_label(number: int, count: int) -> str:
    """What faults call an interface of so many; the numbers are from 0, the labels from 1."""
    return "interface" if count == 1 else f"interface {number + 1}"


def read_interfaces(document: Mapping[str, Any], reader: TableReader) -> tuple[InterfaceSection, ...] | None:
    """The sections of interfaces with their arcs, in the order of the file; None if one is faulty."""
    tables = interface_tables(document)
    reader.faults += _missing_arcs(tables, reader.selected)
    if document.get("interface") == []:
        reader.faults.append("interface = []: expected a section [interface]")
    read = [_read_interface(table, reader, interface_label(n, len(tables))) for n, table in enumerate(tables)]
    interfaces = tuple(interface for interface in read if interface is not None)
    if len(interfaces) < len(tables):
        return None
    reader.faults += _faults_between(interfaces)
    return interfaces


def _read_interface(table: Any, reader: TableReader, label: str) -> InterfaceSection | None:
    """One section of interfaces; None if it is faulty."""
    interface = reader.read(InterfaceSection, table, label)
    debonded = table.get("debonded", []) if isinstance(table, dict) else []
    given = debonded if ARCS.accepts(debonded) else []
    arcs = [reader.read(Arc, arc, label, f"debonded[{k}].") for k, arc in enumerate(given)]
    if interface is not None and interface.criterion == "energy":
        reader.faults += _energy_faults(interface, label)
    if interface is not None:
        reader.faults += _axial_faults(interface, reader.selected[PLANE], label)
    return interface and dataclasses.replace(interface, debonded=tuple(arc for arc in arcs if arc is not None))


def _faults_between(interfaces: tuple[InterfaceSection, ...]) -> list[str]:
    """Faults of several sections: pairs that are missing or named twice, and keys that must agree."""
    faults: list[str] = []
    first: dict[frozenset[str], int] = {}
    for number, interface in enumerate(interfaces[: None if len(interfaces) > 1 else 0]):
        label = interface_label(number, len(interfaces))
        if interface.between is None:
            faults.append(f"[{label}] between: missing; of several [[interface]] each needs {PAIR.expected}")
            continue
        other = first.setdefault(frozenset(interface.between), number)
        if other != number:
            pair = toml_value(list(interface.between))
            faults.append(f"[{label}] between = {pair}: expected another pair than [interface {other + 1}] has")
        for name in COMMON:
            value, common = getattr(interface, name), getattr(interfaces[0], name)
            if value != common:
                expected = f"expected {toml_value(common)}, as of [interface 1]"
                faults.append(f"[{label}] {name} = {toml_value(value)}: {expected}: all interfaces agree in it")
    return faults


def _energy_faults(interface: InterfaceSection, label: str) -> list[str]:
    """Faults of a criterion of energy: springs have some, glue has none; and strengths belong to the others."""
    faults = [
        f'[{label}] {name}: missing; criterion = "energy" needs it'
        for name in STIFFNESSES
        if getattr(interface, name) is None
    ]
    return faults + [
        f'[{label}] {name}: belongs to criterion = "max" or "quadratic", not "energy"'
        for name in STRENGTHS
        if getattr(interface, name) is not None
    ]


def _axial_faults(interface: InterfaceSection, plane: str | None, label: str) -> list[str]:
    """The fault of a strength along the fibre where there is no traction along it."""
    if interface.axial_strength is None or plane in (*GENERALIZED.values, None):
        return []
    belongs = f"belongs to {GENERALIZED.in_words('interface')}, not {toml_value(plane)}"
    return [f"[{label}] axial_strength = {toml_value(interface.axial_strength)}: {belongs}"]


def _missing_arcs(given: list[Any], selected: Selected) -> list[str]:
    """The fault that nothing can debond, nor give way."""
    analysis, tables = selected[ANALYSIS_TYPE], [table for table in given if isinstance(table, dict)]
    if analysis == "angle" and all(table.get("debonded") in (None, []) for table in tables):
        return [f'[interface] debonded: missing; [analysis] type = "angle" needs {ARCS.expected}']
    # An empty list says that it is meant; of a user's mesh a curve may be debonded.
    keys = {"debonded", *STIFFNESSES, "axial_stiffness"}
    is_bare = bool(tables) and not any(table.keys() & keys for table in tables)
    if analysis in ("stiffness", "load") and selected[GEOMETRY] in MESHED.values and is_bare:
        return [f"[interface] debonded: missing; expected {ARCS.expected}, or []: nothing else can open"]
    return []


def read_angle(table: Any, reader: TableReader) -> Angle | None:
    """The section [angle]; None if it is absent or faulty."""
    if table is None:
        return None
    angle = reader.read(Angle, table, "angle")
    if angle is not None and angle.strain is not None and not any(angle.strain):
        reader.faults.append("[angle] strain: expected a strain other than zero")
    return angle
