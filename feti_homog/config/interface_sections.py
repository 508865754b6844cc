"""The sections of imperfect bonding, [interface], [angle] and [path], and what must hold between their keys."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from feti_homog.config.schema import NOWHERE, accepted, read, shown
from feti_homog.config.sections import ARCS, CIRCULAR, Angle, Arc, InterfaceSection, LoadPath

TYPE = "[analysis] type"


def read_bonding(
    document: Mapping[str, Any],
    geometry: str | None,
    analysis: str | None,
    faults: list[str],
    owners: Mapping[str, str] = NOWHERE,
) -> dict[str, Any]:
    """The dataclasses of "interface", "angle" and "path", None where a section is absent or faulty.

    `geometry` and the type of `analysis` are None if they are faulty: then what depends on them is not checked.
    """
    for section in ("angle", "path"):
        if section not in document and section == analysis:
            faults.append(f'[{section}]: missing section; {TYPE} = "{section}" needs it')
        elif section in document and analysis not in (section, None):
            faults.append(f'[{section}]: belongs to {TYPE} = "{section}", not {shown(analysis)}')
    return {
        "interface": _read_interface(document.get("interface"), geometry, analysis, faults, owners),
        "angle": _read_angle(document.get("angle"), faults, owners),
        "path": _read_path(document.get("path"), faults, owners),
    }


def _read_interface(
    table: Any, geometry: str | None, analysis: str | None, faults: list[str], owners: Mapping[str, str]
) -> InterfaceSection | None:
    debonded = table.get("debonded", []) if isinstance(table, dict) else []
    if analysis == "angle" and debonded == []:
        faults.append(f'[interface] debonded: missing; {TYPE} = "angle" needs {ARCS.expected}')
    if table is None:
        return None
    # An empty list says that it is meant; of a user's mesh a curve may be debonded.
    if analysis == "stiffness" and geometry in CIRCULAR and isinstance(table, dict) and "debonded" not in table:
        faults.append(f"[interface] debonded: missing; expected {ARCS.expected}, or []: nothing else can open")
    interface = read(InterfaceSection, table, "interface", faults, TYPE, analysis, owners)
    arcs = [
        read(Arc, arc, "interface", faults, TYPE, analysis, owners, f"debonded[{k}].")
        for k, arc in enumerate(debonded if ARCS.accepts(debonded) else [])
    ]
    return interface and dataclasses.replace(interface, debonded=tuple(arc for arc in arcs if arc is not None))


def _read_angle(table: Any, faults: list[str], owners: Mapping[str, str]) -> Angle | None:
    if table is None:
        return None
    angle = read(Angle, table, "angle", faults, owners=owners)
    if angle is not None and angle.strain is not None and not any(angle.strain):
        faults.append("[angle] strain: expected a strain other than zero")
    return angle


def _read_path(table: Any, faults: list[str], owners: Mapping[str, str]) -> LoadPath | None:
    if table is None:
        return None
    path = read(LoadPath, table, "path", faults, "method", accepted(LoadPath, table, "method"), owners)
    if path is None:
        return None
    if (path.strain is None) == (path.waypoints is None):
        state = "missing; give one" if path.strain is None else "exclude each other; give one"
        faults.append(f"[path] strain, waypoints: {state}")
    elif path.strain is not None and not any(path.strain):
        faults.append("[path] strain: expected a strain other than zero, where the path begins")
    elif path.waypoints is not None:
        for k, (before, after) in enumerate(pairwise([(0.0, 0.0, 0.0), *path.waypoints])):
            if before == after:
                place = f"waypoints[{k - 1}]" if k else "zero, where the path begins"
                faults.append(f"[path] waypoints[{k}] = {shown(list(after))}: expected a strain other than {place}")
    if path.increments is not None and path.increments < len(path.targets):
        faults.append(f"[path] increments = {path.increments}: expected at least one for each waypoint")
    return path
