"""Reading the sections of imperfect bonding, [interface] and [angle], and what must hold between their keys."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from feti_homog.config.cell_section import GEOMETRY, MESHED
from feti_homog.config.interface_section import STIFFNESSES, STRENGTHS, Arc, InterfaceSection
from feti_homog.config.schema import Selected, TableReader
from feti_homog.config.section_values import ARCS
from feti_homog.config.sections import SECTIONS_OF_AN_ANALYSIS, Angle
from feti_homog.config.selectors import ANALYSIS_TYPE, GENERALIZED, PLANE
from feti_homog.config.wording import toml_value


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


def read_interface(table: Any, reader: TableReader) -> InterfaceSection | None:
    """The section [interface] with its arcs; None if it is absent or faulty."""
    reader.faults += _missing_arcs(table, reader.selected)
    if table is None:
        return None
    interface = reader.read(InterfaceSection, table, "interface")
    debonded = table.get("debonded", []) if isinstance(table, dict) else []
    given = debonded if ARCS.accepts(debonded) else []
    arcs = [reader.read(Arc, arc, "interface", f"debonded[{k}].") for k, arc in enumerate(given)]
    if interface is not None and interface.criterion == "energy":
        reader.faults += _energy_faults(interface)
    if interface is not None:
        reader.faults += _axial_faults(interface, reader.selected[PLANE])
    return interface and dataclasses.replace(interface, debonded=tuple(arc for arc in arcs if arc is not None))


def _energy_faults(interface: InterfaceSection) -> list[str]:
    """Faults of a criterion of energy: springs have some, glue has none; and strengths belong to the others."""
    faults = [
        f'[interface] {name}: missing; criterion = "energy" needs it'
        for name in STIFFNESSES
        if getattr(interface, name) is None
    ]
    return faults + [
        f'[interface] {name}: belongs to criterion = "max" or "quadratic", not "energy"'
        for name in STRENGTHS
        if getattr(interface, name) is not None
    ]


def _axial_faults(interface: InterfaceSection, plane: str | None) -> list[str]:
    """The fault of a strength along the fibre where there is no traction along it."""
    if interface.axial_strength is None or plane in (*GENERALIZED.values, None):
        return []
    belongs = f"belongs to {GENERALIZED.in_words('interface')}, not {toml_value(plane)}"
    return [f"[interface] axial_strength = {toml_value(interface.axial_strength)}: {belongs}"]


def _missing_arcs(table: Any, selected: Selected) -> list[str]:
    """The fault that nothing can debond, nor give way."""
    analysis, debonded = selected[ANALYSIS_TYPE], table.get("debonded") if isinstance(table, dict) else None
    if analysis == "angle" and debonded in (None, []):
        return [f'[interface] debonded: missing; [analysis] type = "angle" needs {ARCS.expected}']
    # An empty list says that it is meant; of a user's mesh a curve may be debonded.
    is_bare = isinstance(table, dict) and not table.keys() & {"debonded", *STIFFNESSES, "axial_stiffness"}
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
