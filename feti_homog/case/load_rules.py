"""Reading the sections [path] and [load], and what must hold between their keys and in the rest of the case."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from feti_homog.case.load_section import LoadPath, SingleLoad
from feti_homog.case.material_sections import missing_expansions
from feti_homog.case.mixed_load import TEMPERATURE, MixedLoad, Strain, completed, components, first_named, named
from feti_homog.case.section_values import LOAD, WAYPOINTS
from feti_homog.case.selectors import GENERALIZED, PLANE
from feti_homog.materials.forms import Material
from feti_homog.schema.keys import TableReader
from feti_homog.schema.wording import toml_value


def read_path(table: Any, reader: TableReader) -> LoadPath | None:
    """The section [path]; None if it is absent or faulty."""
    if table is None:
        return None
    path = reader.read(LoadPath, table, "path")
    given = table if isinstance(table, dict) else {}
    found = len(reader.faults)
    to = _read_load(given.get("to"), reader, "path", "to")
    waypoints = _read_waypoints(given.get("waypoints"), reader)
    if path is None or len(reader.faults) > found:
        return None
    path = dataclasses.replace(path, to=to, waypoints=waypoints)
    reader.faults += _path_faults(path, reader.selected[PLANE])
    return path


def read_load(table: Any, reader: TableReader) -> SingleLoad | None:
    """The section [load]; None if it is absent or faulty."""
    if table is None:
        return None
    load = reader.read(SingleLoad, table, "load")
    to = _read_load(table.get("to") if isinstance(table, dict) else None, reader, "load", "to")
    if load is None or to is None:
        return None
    if not any(to.named.values()):
        reader.faults.append(f"[load] to = {_in_words(to)}: expected a load other than zero")
    return SingleLoad(to=to)


def _read_waypoints(values: Any, reader: TableReader) -> tuple[Strain | MixedLoad, ...] | None:
    """The waypoints; None if there are none or one is faulty."""
    if not WAYPOINTS.accepts(values):
        return None
    is_spatial = reader.selected[PLANE] in GENERALIZED.values
    waypoints: list[Strain | MixedLoad | None] = []
    for place, value in _numbered(values):
        if isinstance(value, dict):
            waypoints.append(_read_load(value, reader, "path", place))
        elif is_spatial:
            expected = f"expected a table such as {{E11 = 0.01}} in {GENERALIZED.in_words('path')}"
            reader.faults.append(f"[path] {place} = {toml_value(value)}: {expected}")
        else:
            waypoints.append(tuple(map(float, value)))
    found = [waypoint for waypoint in waypoints if waypoint is not None]
    return tuple(found) if len(found) == len(values) else None


def _numbered(values: Sequence[Any]) -> Iterator[tuple[str, Any]]:
    return ((f"waypoints[{k}]", value) for k, value in enumerate(values))


def _read_load(value: Any, reader: TableReader, section: str, place: str) -> MixedLoad | None:
    """The load at a place of a section; None if it is absent or faulty."""
    if not LOAD.accepts(value):
        return None
    load = reader.read(MixedLoad, value, section, f"{place}.")
    both = [pair for pair in components(GENERALIZED.values[0]) if value.keys() >= set(pair)]
    reader.faults += [
        f"[{section}] {place}.{strain}, {place}.{stress}: exclude each other; give one" for strain, stress in both
    ]
    return None if both else load


def _path_faults(path: LoadPath, plane: str | None) -> list[str]:
    """Faults between the keys of a path; None is a faulty plane state."""
    faults = []
    choices = {"strain": path.strain, "to": path.to, "waypoints": path.waypoints}
    given = [name for name, value in choices.items() if value is not None]
    if not given:
        faults.append(f"[path] {', '.join(choices)}: missing; give one")
    elif len(given) > 1:
        faults.append(f"[path] {', '.join(given)}: exclude each other; give one")
    elif plane is not None:
        faults += _repeated_loads(path, plane)
    if path.increments is not None and path.increments < len(path.targets):
        faults.append(f"[path] increments = {path.increments}: expected at least one for each waypoint")
    return faults


def _repeated_loads(path: LoadPath, plane: str) -> list[str]:
    """Faults of waypoints at which the path already is."""
    placed = path.placed
    loads = completed(path.targets, plane)
    is_last = [not any(loads[0].values()), *(before == after for before, after in pairwise(loads))]
    last = ["zero, where the path begins", *placed]
    return [
        f"[path] {place} = {_in_words(load)}: expected a {_noun(load)} other than {last[k]}"
        for k, (place, load) in enumerate(placed.items())
        if is_last[k]
    ]


def _in_words(load: Strain | MixedLoad) -> str:
    return toml_value(load.named if isinstance(load, MixedLoad) else list(load))


def _noun(load: Strain | MixedLoad) -> str:
    return "load" if isinstance(load, MixedLoad) else "strain"


def expansion_faults(path: LoadPath | None, load: SingleLoad | None, materials: Mapping[str, Material]) -> list[str]:
    """Faults of phases that do not say how they expand, where a load names a temperature."""
    placed: dict[str, Strain | MixedLoad] = {} if load is None else {"[load] to": load.to}
    placed |= {} if path is None else {f"[path] {place}": each for place, each in path.placed.items()}
    place = next((place for place, load in placed.items() if TEMPERATURE in named(load)), None)
    return [] if place is None else missing_expansions(materials, f"{place}.{TEMPERATURE}")


def stress_free(section: str, placed: Mapping[str, Strain | MixedLoad], plane: str) -> tuple[str, ...]:
    """Which components are free of stress because no load of a section names them, or none so far; a line each."""
    first = first_named(tuple(placed.values()), plane)
    words = ["", *(f"stress-free until {place}" for place in [*placed][1:]), "never named: stress-free"]
    unnamed = {k: [name for name, number in first.items() if number == k] for k in range(1, len(words))}
    return tuple(f"[{section}] {', '.join(names)}: {words[k]}" for k, names in unnamed.items() if names)
