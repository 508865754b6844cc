"""Expand a sweep file into numbered cases, and check every case."""

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from feti_homog.case import Case, cases, interface_section, sections, toml_files
from feti_homog.errors import CaseError
from feti_homog.report.text import tables
from feti_homog.schema import wording
from feti_homog.studies.axes import Assignment, is_seed, read_points
from feti_homog.system.petsc import option_table

MAX_NAMED_CASES = 4  # cases that one fault names


@dataclass(frozen=True)
class SweepCase:
    """The identity and inputs of a case in a sweep.

    Attributes:
        number: number of the case, from 1.
        point: number of the sweep point, from 1.  Realisations of a point have equal inputs, except seeds.
        realisation: number of the realisation, from 1.
        inputs: values of the keys that vary, by dotted key.
        identity: digest of case and PETSc options; empty before the case is checked.
    """

    number: int
    point: int
    realisation: int
    inputs: dict[str, Any]
    identity: str

    @property
    def folder(self) -> str:
        return f"case-{self.number:04d}"

    def describe(self, stress_unit: str) -> str:
        """Return a line with the inputs of the case and their units."""
        words = {name: wording.toml_value(value) for name, value in self.inputs.items()}
        return ", ".join(f"{name} = {word} {tables.unit(name, stress_unit)}".rstrip() for name, word in words.items())


@dataclass(frozen=True)
class Sweep:
    """The cases of a sweep; `cases[k]` belongs to `entries[k]`, and a sweep read from its folder has no `cases`."""

    name: str
    stress_unit: str
    entries: tuple[SweepCase, ...]
    cases: tuple[Case, ...] = ()


def load(path: str | Path) -> Sweep:
    """Load a sweep from a file.  Raises CaseError with all faults of [sweep] or, without these, of all cases."""
    document = toml_files.read_document(path)
    if sections.SWEEP not in document:
        raise CaseError(f"{path}: [{sections.SWEEP}]: missing section; `feti-homog run` runs a single case")
    return expand(document, Path(path).parent)


def expand(values: Mapping[str, Any], folder: Path) -> Sweep:
    """Expand a document with a table "sweep" into its cases.

    All points come before the next realisation, so that more realisations add cases at the end.  File names in the
    document are relative to `folder`.  Raises CaseError like `load`.
    """
    document = toml_files.to_document(values)
    if sections.SWEEP not in document:
        raise CaseError(f"[{sections.SWEEP}]: missing section; a single case is not a sweep")
    faults: list[str] = []
    points, settings = read_points(document.pop(sections.SWEEP), faults)
    return cases_at(document, points, folder, settings.realisations, faults=faults)


def cases_at(
    document: Mapping[str, Any],
    points: Sequence[Assignment],
    folder: Path,
    realisations: int | None = None,
    *,
    section: str = sections.SWEEP,
    faults: Sequence[str] = (),
    complete: Callable[[dict[str, Any]], None] | None = None,
) -> Sweep:
    """Build and check the cases of a document at points of a sweep.

    Args:
        folder: file names in the document are relative to this folder.
        realisations: as in `case_documents`.
        section: name of the section that defines the points, for messages.
        faults: faults of the points.
        complete: function that sets further keys in the document of a case, in place.

    Raises:
        CaseError: faults of points; without them, of cases, with their numbers; or stress units that differ.
    """
    lines = [*faults]
    unchecked = case_documents(document, points, realisations, lines, section)
    if lines:
        raise CaseError(*dict.fromkeys(lines))
    name, checked, numbers_by_fault = str(document.get("name", "case")), [], dict[str, list[int]]()
    for entry, case_document in unchecked:
        if complete is not None:
            complete(case_document)
        try:
            case = cases.parse(case_document | {"name": f"{name}-{entry.number:04d}"}, folder)
            checked.append((replace(entry, identity=identity_of(case.digest(), case.petsc)), case))
        except CaseError as error:
            for fault in error.faults:
                numbers_by_fault.setdefault(fault, []).append(entry.number)
    if numbers_by_fault:
        raise CaseError(*(f"{case_names(numbers)}: {fault}" for fault, numbers in numbers_by_fault.items()))
    entries, parsed = zip(*checked, strict=True)
    if len({case.output.stress_unit for case in parsed}) > 1:
        raise CaseError("[output] stress_unit: expected the same in all cases, which share the tables")
    return Sweep(name, parsed[0].output.stress_unit, entries, parsed)


def identity_of(digest: str, petsc: Mapping[str, Any]) -> str:
    """Return the digest of a case, from its `digest` and its PETSc options except options that only print."""
    chosen = {name: value for name, value in petsc.items() if not option_table.only_prints(name)}
    return toml_files.short_digest((digest + json.dumps(chosen, sort_keys=True)).encode())


def case_names(numbers: list[int]) -> str:
    """Return a phrase with the names of the first cases in `numbers`, and the number of further cases."""
    names = ", ".join(f"case-{number:04d}" for number in numbers[:MAX_NAMED_CASES])
    rest = len(numbers) - MAX_NAMED_CASES
    return names if rest <= 0 else f"{names} and {rest} more"


def case_documents(
    base: Mapping[str, Any],
    points: Sequence[Assignment],
    realisations: int | None,
    faults: list[str],
    section: str = sections.SWEEP,
) -> list[tuple[SweepCase, dict[str, Any]]]:
    """Construct sweep cases and their unchecked documents; [] after faults, which add lines to `faults`.

    The cases run through all points; further `realisations`, if not None, follow at points with a random cell or with
    strengths that scatter, whose seeds count up.  Points that differ only in seeds become realisations of one point.
    """
    documents = [toml_files.with_values(base, point, faults, f"[{section}] ") for point in points]
    seeds = [{} if realisations is None else _seeds(document) for document in documents]
    if realisations is not None and documents and not any(seeds):
        faults.append(f"[{sections.SWEEP}] realisations: only random cells and strengths that scatter have several")
    keys = [key for path, value in next(iter(points), {}).items() for key in _inputs({path: value})]
    for key in filter(is_seed, keys if realisations is not None else ()):
        faults.append(f"[{sections.SWEEP}] realisations: excludes {key}; seeds count up from the seed of the case")
    faults += [f"[{section}] {key}: given twice" for key in dict.fromkeys(keys) if keys.count(key) > 1]
    ordered, numbers, counts = list[tuple[SweepCase, dict[str, Any]]](), dict[int | str, int](), Counter[int]()
    for realisation in range(1, (realisations or 1) + 1) if not faults else ():
        for place, (point, document) in enumerate(zip(points, documents, strict=True)):
            inputs, varied = _inputs(point), document
            group: int | str = place
            if seeds[place]:
                # A later check reports a faulty seed.
                step = {path: s + realisation - 1 if isinstance(s, int) else s for path, s in seeds[place].items()}
                varied = toml_files.with_values(document, step, faults)
                inputs |= {wording.dotted_key(path): seed for path, seed in step.items()}
            elif realisation > 1:
                continue
            elif any(map(is_seed, inputs)):
                group = repr({name: value for name, value in inputs.items() if not is_seed(name)})
            number = numbers.setdefault(group, len(numbers) + 1)
            counts[number] += 1
            ordered.append((SweepCase(len(ordered) + 1, number, counts[number], inputs, ""), varied))
    return ordered


def _seeds(document: Mapping[str, Any]) -> dict[toml_files.TomlPath, Any]:
    """Return the seeds of a random cell and of strengths that scatter, by path."""
    cell, bonds = document.get("cell"), document.get("interface")
    is_random = isinstance(cell, dict) and cell.get("geometry") == "random"
    tables = {("cell",): cell} if is_random else {}
    for number, bond in enumerate(interface_section.interface_tables(document), 1):
        above = ("interface", str(number)) if isinstance(bonds, list) else ("interface",)
        tables |= {(*above, "scatter"): bond["scatter"]} if isinstance(bond, dict) and "scatter" in bond else {}
    return {(*path, "seed"): table.get("seed", 0) for path, table in tables.items() if isinstance(table, dict)}


def _inputs(point: Assignment) -> dict[str, Any]:
    """Return the values of a point by dotted key; a value that is a table becomes an input for each entry."""
    inputs: dict[str, Any] = {}
    for path, value in point.items():
        parts = {(*path, name): part for name, part in value.items()} if isinstance(value, dict) else {path: value}
        inputs |= {wording.dotted_key(key): part for key, part in parts.items()}
    return inputs
