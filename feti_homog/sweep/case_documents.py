"""The documents of a sweep's cases: the base with the values of each point, once for every realisation."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from feti_homog.case.sweep_section import SWEEP
from feti_homog.schema.wording import dotted_key, toml_value
from feti_homog.sweep.points import Assignment


@dataclass(frozen=True)
class CaseDocument:
    """The document of a case that is not checked yet: its point and realisation, from 1, and what varies."""

    point: int
    realisation: int
    inputs: dict[str, Any]
    document: dict[str, Any]


def case_documents(
    base: Mapping[str, Any], points: Sequence[Assignment], realisations: int | None, faults: list[str]
) -> list[CaseDocument]:
    """The cases in their order: all points, then the next realisation of those with a random cell.

    What is wrong with the points and their number of realisations is added to `faults`.
    """
    documents = [_with_values(base, point, faults) for point in points]
    if realisations is not None:
        faults += _realisation_faults(documents, points)
    faults += _repeated(points[0]) if points else []
    return [] if faults else list(_ordered(points, documents, realisations))


def _ordered(
    points: Sequence[Assignment], documents: Sequence[dict[str, Any]], realisations: int | None
) -> Iterator[CaseDocument]:
    for realisation in range(1, (realisations or 1) + 1):
        for point, (assignment, document) in enumerate(zip(points, documents, strict=True), start=1):
            inputs = _inputs(assignment)
            if realisations is not None and _is_random(document):
                seed = _seed(document, realisation)
                cell = document["cell"] | {"seed": seed}
                yield CaseDocument(point, realisation, inputs | {"cell.seed": seed}, document | {"cell": cell})
            elif realisation == 1:
                yield CaseDocument(point, realisation, inputs, document)


def _seed(document: Mapping[str, Any], realisation: int) -> Any:
    """The seed of a realisation: that of [cell] and those after it; a faulty one stays as it is."""
    first = document["cell"].get("seed", 0)
    return first + realisation - 1 if isinstance(first, int) else first


def _with_values(base: Mapping[str, Any], point: Assignment, faults: list[str]) -> dict[str, Any]:
    """The base with the values of a point; a table is merged into the section that it is a value of."""
    document = copy.deepcopy(dict(base))
    for path, value in point.items():
        table = document
        for name in path[:-1]:
            table = _entry(table, name)
            if table is None:
                faults.append(f"[{SWEEP}] {dotted_key(path)}: {toml_value(name)} is no section")
                return document
        if isinstance(table, list):
            faults.append(f"[{SWEEP}] {dotted_key(path)}: {_several(path, table)}")
            return document
        last = path[-1]
        if isinstance(value, dict) and isinstance(table.get(last, {}), dict):
            table[last] = table.get(last, {}) | value
        else:
            table[last] = value
    return document


def _entry(table: Any, name: str) -> Any:
    """The table or the list of tables of this name, a new one if there is none, and of a list the table of this number,
    from 1; None if there is something else."""
    if isinstance(table, list):
        is_one = name.isdecimal() and 0 < int(name) <= len(table)
        found = table[int(name) - 1] if is_one else None
    else:
        found = table.setdefault(name, {})
    return found if isinstance(found, dict | list) else None


def _several(path: Sequence[str], tables: Sequence[Any]) -> str:
    """What is wrong with a key of several sections of one name."""
    section, key = dotted_key(path[:-1]), path[-1]
    return f"there are {len(tables)} sections [[{section}]]; expected {section}.1.{key} or the like"


def _realisation_faults(documents: Sequence[dict[str, Any]], points: Sequence[Assignment]) -> list[str]:
    line = f"[{SWEEP}] realisations: "
    faults = []
    if not any(map(_is_random, documents)):
        faults.append(f'{line}only cells with geometry = "random" have several')
    if any("cell.seed" in _inputs(point) for point in points):
        faults.append(f"{line}excludes cell.seed, the first of which is that of [cell]")
    return faults


def _repeated(point: Assignment) -> list[str]:
    """Faults of keys that vary by themselves and within a table too."""
    given = [key for path, value in point.items() for key in _inputs({path: value})]
    return [f"[{SWEEP}] {key}: given twice" for key in dict.fromkeys(given) if given.count(key) > 1]


def _is_random(document: Mapping[str, Any]) -> bool:
    cell = document.get("cell")
    return isinstance(cell, dict) and cell.get("geometry") == "random"


def _inputs(point: Assignment) -> dict[str, Any]:
    """The values of a point by dotted key, tables taken apart."""
    inputs: dict[str, Any] = {}
    for path, value in point.items():
        parts = {(*path, name): part for name, part in value.items()} if isinstance(value, dict) else {path: value}
        inputs |= {dotted_key(key): part for key, part in parts.items()}
    return inputs
