"""Reading the section [envelope], and what the rest of the case must say for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from feti_homog.case.envelope_section import Envelope
from feti_homog.case.interface_section import STRENGTHS, InterfaceSection
from feti_homog.case.material_sections import missing_expansions
from feti_homog.case.selectors import ENVELOPE_ANALYSIS, GENERALIZED, PLANE
from feti_homog.materials.forms import Material
from feti_homog.materials.voigt import STRAINS, STRESSES
from feti_homog.schema.keys import Selected, TableReader
from feti_homog.schema.wording import toml_value

TYPE = ENVELOPE_ANALYSIS.in_words("")


def read_envelope(table: Any, reader: TableReader) -> Envelope | None:
    """The section [envelope]; None if it is absent or faulty."""
    if table is None:
        return None
    envelope = reader.read(Envelope, table, "envelope")
    plane = reader.selected[PLANE]
    if envelope is not None and plane is not None and plane not in GENERALIZED.values:
        reader.faults += [
            f"[envelope] plane = {toml_value(list(envelope.plane))}: {name} belongs to "
            f"{GENERALIZED.in_words('envelope')}, not {toml_value(plane)}"
            for name in envelope.plane
            if name not in (*STRESSES, *STRAINS)
        ]
    return envelope


def envelope_faults(
    envelope: Envelope | None,
    interfaces: Sequence[InterfaceSection] | None,
    materials: Mapping[str, Material] | None,
    document: Mapping[str, Any],
    selected: Selected,
) -> list[str]:
    """Faults of what an envelope needs; none of another analysis, nor of sections that are faulty themselves."""
    if selected[ENVELOPE_ANALYSIS.selector] not in ENVELOPE_ANALYSIS.values:
        return []
    faults = [] if "interface" in document else [f"[interface]: missing section; {TYPE} needs it"]
    if interfaces:
        faults += _bonding_faults(interfaces, selected)
    if envelope is not None and envelope.temperature is not None:
        faults += missing_expansions(materials or {}, "[envelope] temperature")
    return faults


def _bonding_faults(interfaces: Sequence[InterfaceSection], selected: Selected) -> list[str]:
    """Faults of bonds that nothing breaks, and of faces that may touch."""
    faults = []
    names = STRENGTHS if selected[PLANE] in GENERALIZED.values else STRENGTHS[:2]
    strengths = {getattr(interface, name) for interface in interfaces for name in names}
    if interfaces[0].criterion != "energy" and strengths <= {None, inf}:
        faults.append(f"[interface] {', '.join(names)}: missing; {TYPE} needs one")
    if interfaces[0].contact and any(interface.debonded for interface in interfaces):
        faults.append(
            f"[interface] contact: expected false with debonded arcs; {TYPE} superposes loads, which contact forbids"
        )
    return faults
