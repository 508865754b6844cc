"""A sweep file expanded: its numbered cases, all of them checked."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feti_homog.case import case as cases
from feti_homog.case.case import Case
from feti_homog.case.document import read_document, to_document
from feti_homog.case.sweep_section import SWEEP
from feti_homog.errors import CaseError
from feti_homog.report.text.units import unit
from feti_homog.schema.wording import toml_value
from feti_homog.sweep.case_documents import CaseDocument, case_documents
from feti_homog.sweep.points import read_points

MAX_NAMED_CASES = 4  # in one fault


@dataclass(frozen=True)
class SweepCase:
    """Which case of a sweep one is.

    Attributes:
        number: of the case, from 1.
        point: which values, from 1: all realisations of a point have the same.
        realisation: from 1.
        inputs: what varies, by dotted key.
        identity: short name of what the case computes.
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
        """The inputs in one line, with their units."""
        values = [(f"{name} = {toml_value(value)}", unit(name, stress_unit)) for name, value in self.inputs.items()]
        return ", ".join(f"{text} {own}".rstrip() for text, own in values)


@dataclass(frozen=True)
class Sweep:
    """The cases of a sweep file; `cases[k]` is that of `entries[k]`."""

    name: str
    entries: tuple[SweepCase, ...]
    cases: tuple[Case, ...]

    @property
    def stress_unit(self) -> str:
        return self.cases[0].output.stress_unit


def load(path: str | Path) -> Sweep:
    """The sweep in a file.  Raises CaseError with all faults of the table [sweep], or else of all its cases."""
    document = read_document(path)
    if SWEEP not in document:
        raise CaseError(f"{path}: [{SWEEP}]: missing section; `feti-homog run` runs a single case")
    return expand(document, Path(path).parent)


def expand(values: Mapping[str, Any], folder: Path) -> Sweep:
    """The sweep of nested dictionaries with a table "sweep"; its files are relative to `folder`.

    All points come once before any comes in its next realisation, so that more realisations add cases at the end.
    Raises CaseError as `load` does.
    """
    document = to_document(values)
    if SWEEP not in document:
        raise CaseError(f"[{SWEEP}]: missing section; a single case is not a sweep")
    table = document.pop(SWEEP)
    if not isinstance(table, dict):
        raise CaseError(f"{SWEEP} = {toml_value(table)}: expected a section [{SWEEP}]")
    faults: list[str] = []
    points, settings = read_points(table, faults)
    unchecked = case_documents(document, points, settings.realisations, faults)
    if faults:
        raise CaseError(*dict.fromkeys(faults))
    return _checked(str(document.get("name", "case")), unchecked, folder)


def _checked(name: str, unchecked: Sequence[CaseDocument], folder: Path) -> Sweep:
    """The sweep of its documents.  Raises CaseError with the faults of all cases, each with the cases that have it."""
    found, numbers_by_fault = [], dict[str, list[int]]()
    for number, each in enumerate(unchecked, start=1):
        try:
            case = cases.parse(each.document | {"name": f"{name}-{number:04d}"}, folder)
            found.append((SweepCase(number, each.point, each.realisation, each.inputs, _identity(case)), case))
        except CaseError as error:
            for fault in error.faults:
                numbers_by_fault.setdefault(fault, []).append(number)
    if numbers_by_fault:
        raise CaseError(*(f"{case_names(numbers)}: {fault}" for fault, numbers in numbers_by_fault.items()))
    entries, checked = zip(*found, strict=True)
    return Sweep(name, entries, checked)


def identity_of(digest: str, petsc: Mapping[str, Any]) -> str:
    """Short name of what is computed, and with which options."""
    return hashlib.sha256((digest + json.dumps(dict(petsc), sort_keys=True)).encode()).hexdigest()[:16]


def _identity(case: Case) -> str:
    return identity_of(case.digest(), case.petsc)


def case_names(numbers: list[int]) -> str:
    """Which cases, in words."""
    names = ", ".join(f"case-{number:04d}" for number in numbers[:MAX_NAMED_CASES])
    rest = len(numbers) - MAX_NAMED_CASES
    return names if rest <= 0 else f"{names} and {rest} more"
