"""A fit file: cases with unknown constants, and what was measured of them."""

from __future__ import annotations

import csv
import hashlib
import io
import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from feti_homog.case.case import Case
from feti_homog.case.document import TomlPath, read_document, to_document
from feti_homog.case.fit_sections import CURVE, MEASURED, TEST, UNKNOWN, Measured, MeasuredCurve, Unknown
from feti_homog.case.sections import SWEEP
from feti_homog.errors import CaseError
from feti_homog.fit.predictions import Datum, available
from feti_homog.materials.plane_state import PLANE_STATES
from feti_homog.materials.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES, voigt_names
from feti_homog.runtime import input_files
from feti_homog.schema.keys import TableReader, keys_of
from feti_homog.schema.values import is_number
from feti_homog.schema.wording import dotted_key, suggestion, toml_key, toml_value
from feti_homog.sweep import plan
from feti_homog.sweep.plan import Sweep
from feti_homog.sweep.points import Assignment

DIGITS = 12  # of a value of an unknown, so that a repeated fit makes the same cases
MOST_ROWS = 10_000
SILENT = {"fields": False, "pictures": False, "report": False}


@dataclass(frozen=True)
class Fit:
    """The unknowns of a fit, by dotted key, its tests as changes of one document, and the data of all tests."""

    name: str
    document: Mapping[str, Any]
    folder: Path
    unknowns: Mapping[str, Unknown]
    paths: Sequence[TomlPath]
    tests: Sequence[Assignment]
    data: Sequence[Datum]

    def at(self, x: Sequence[float]) -> Sweep:
        """Return the cases of all tests where the unknowns are x (n,). Raises CaseError as `cases`."""
        return self.cases([(test, x) for test in range(len(self.tests))])

    def cases(self, wanted: Sequence[tuple[int, Sequence[float]]]) -> Sweep:
        """Return the cases of tests at values of the unknowns.

        Raises:
            CaseError: with the faults of all of them.
        """
        points = [
            self.tests[test] | {path: float(f"{v:.{DIGITS}g}") for path, v in zip(self.paths, x, strict=True)}
            for test, x in wanted
        ]
        faults: list[str] = []
        documents = plan.case_documents(self.document, points, None, faults, UNKNOWN)
        if faults:
            raise CaseError(*dict.fromkeys(faults))
        for each in documents:
            given = each.document.get("output", {})
            if isinstance(given, dict):
                each.document["output"] = {"mesh_error": False} | given | SILENT | {"sensitivities": _is_linear(each)}
        return plan.checked(self.name, documents, self.folder)

    def data_of(self, test: int) -> list[Datum]:
        """Return the data of a test."""
        return [datum for datum in self.data if datum.test == test]

    def rows_of(self, test: int) -> slice:
        """Return the place of the data of a test among all."""
        first = next(k for k, datum in enumerate(self.data) if datum.test == test)
        return slice(first, first + len(self.data_of(test)))

    def digest(self) -> str:
        """Short name of the fit: the same for the same cases, unknowns and data."""
        start = self.at([each.start for each in self.unknowns.values()])
        content = {
            "cases": [entry.identity for entry in start.entries],
            "unknowns": {name: asdict(each) for name, each in self.unknowns.items()},
            "data": [asdict(each) for each in self.data],
        }
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]


def _is_linear(case: plan.CaseDocument) -> bool:
    """Return whether a case has exact derivatives: a stiffness without contact of debonded faces."""
    analysis, interfaces = case.document.get("analysis"), case.document.get("interface", [])
    sections = interfaces if isinstance(interfaces, list) else [interfaces]
    touching = [each for each in sections if isinstance(each, dict) and each.get("debonded")]
    is_stiffness = isinstance(analysis, dict) and analysis.get("type") == "stiffness"
    return is_stiffness and all(each.get("contact") is False for each in touching)


def load(path: Path) -> Fit:
    """Return the fit in a file. Raises CaseError with all faults of its tables, or else of its cases."""
    return parse(read_document(path), path.parent)


def parse(values: Mapping[str, Any], folder: Path) -> Fit:
    """Return the fit of nested dictionaries; its files are relative to `folder`. Raises CaseError as `load`."""
    document = to_document(values)
    reader = FitReader(folder)
    unknowns = reader.unknowns(document.pop(UNKNOWN, None))
    measured, tests = document.pop(MEASURED, None), document.pop(TEST, None)
    if SWEEP in document:
        reader.faults.append(f"[{SWEEP}]: a fit has no sweep; expected [[{TEST}]] for each test")
    assignments, data = reader.tests(measured, tests, {*unknowns})
    if unknowns and len(data) < len(unknowns) and not reader.faults:
        reader.faults.append(
            f"[{UNKNOWN}]: {len(unknowns)} unknowns, {len(data)} measured values; expected at least as many values"
        )
    if reader.faults:
        raise CaseError(*reader.faults)
    own = {".".join(path): value for path, value in unknowns.items()}
    fit = Fit(str(document.get("name", "fit")), document, folder, own, [*unknowns], assignments, data)
    faults = [*_case_faults(fit)]
    if faults:
        raise CaseError(*dict.fromkeys(faults))
    return fit


def _case_faults(fit: Fit) -> Iterator[str]:
    """Yield what is wrong with the cases at the start and at the bounds, and with the names of the data."""
    start = [each.start for each in fit.unknowns.values()]
    cases = fit.at(start).cases
    for test, case in enumerate(cases):
        place = f"[[{TEST}]] {test + 1}, {MEASURED}." if len(cases) > 1 else f"[{MEASURED}] "
        yield from _name_faults(place, case, fit.data_of(test))
    digests = [case.digest() for case in cases]
    for k, (name, unknown) in enumerate(fit.unknowns.items()):
        ends = {"lower": unknown.lower, "upper": unknown.upper}
        lines, changed = list[str](), False
        for word, end in ends.items():
            try:
                changed |= [case.digest() for case in fit.at([*start[:k], end, *start[k + 1 :]]).cases] != digests
            except CaseError as error:
                lines += [f"[{UNKNOWN}] {name}, {word} = {end}: {fault}" for fault in error.faults]
        yield from lines if changed or lines else [f"[{UNKNOWN}] {name}: no measured value depends on it"]


def _name_faults(place: str, case: Case, data: Sequence[Datum]) -> Iterator[str]:
    """Yield what the analysis of a test does not give."""
    known = available(case)
    if not known:
        yield f'[analysis] type = "{case.analysis.type}": a fit takes "stiffness" and "path"'
        return
    yield from _curve_faults(place, case, [each for each in data if each.strain is not None])
    for name in dict.fromkeys(each.name for each in data if each.strain is None):
        if name not in known:
            yield f"{place}{toml_key(name)}: the analysis does not give it; {suggestion(name, known, {})}"


def _curve_faults(place: str, case: Case, points: Sequence[Datum]) -> Iterator[str]:
    """Yield what the analysis of a test does not give of the points of a measured curve."""
    if points and case.analysis.type != "path":
        yield f"{place}{CURVE}: expected an analysis of type path"
    known = voigt_names(6 if PLANE_STATES[case.analysis.plane].is_spatial else 3)
    for name in sorted({name for each in points for name in (each.strain_name, each.name)}.difference(*known)):
        yield f'{place}{CURVE}: plane = "{case.analysis.plane}" has no {name}'


@dataclass
class FitReader:
    """Reads the tables of a fit and gathers what is wrong with them, a line each."""

    folder: Path
    faults: list[str] = field(default_factory=list)

    def unknowns(self, table: object) -> dict[TomlPath, Unknown]:
        """Return the unknowns by key."""
        if not isinstance(table, dict) or not table:
            self.faults.append(f"[{UNKNOWN}]: expected a table of SECTION.KEY = {{start, lower, upper}}")
            return {}
        found = {}
        for path, value in leaves(table, keys_of(Unknown)):
            name = dotted_key(path)
            if not isinstance(value, dict):
                words = f"[{UNKNOWN}] {name} = {toml_value(value)}: expected a table {{start, lower, upper}}"
                self.faults.append(words)
            elif (unknown := self._read(Unknown, value, UNKNOWN, f"{name}.")) is not None:
                found[path] = unknown
                if not unknown.lower < unknown.upper or not unknown.lower <= unknown.start <= unknown.upper:
                    words = f"lower = {unknown.lower:g}, start = {unknown.start:g}, upper = {unknown.upper:g}"
                    self.faults.append(f"[{UNKNOWN}] {name}: {words}: expected lower <= start <= upper, lower < upper")
        return found

    def tests(self, measured: object, tests: object, unknowns: set[TomlPath]) -> tuple[list[Assignment], list[Datum]]:
        """Return the changes of each test and the data of all."""
        if (measured is None) == (tests is None):
            self.faults.append(f"expected [{MEASURED}] for one test or [[{TEST}]] for each of several, with measured")
            return [], []
        rows = [{MEASURED: measured}] if tests is None else tests
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            self.faults.append(f"{TEST} = {toml_value(rows)}: expected sections [[{TEST}]]")
            return [], []
        assignments, data = list[Assignment](), list[Datum]()
        for number, row in enumerate(rows):
            place = MEASURED if tests is None else f"[{TEST}]] {number + 1}, [{MEASURED}"
            data += self._data(row.get(MEASURED), number, place)
            own = dict(leaves({name: value for name, value in row.items() if name != MEASURED}, ()))
            assignments.append(own)
            for path in own.keys() & unknowns:
                self.faults.append(f"[[{TEST}]] {number + 1}, {dotted_key(path)}: it is an unknown of [{UNKNOWN}]")
        return assignments, data

    def _data(self, table: object, test: int, place: str) -> list[Datum]:
        """Return the data of one test."""
        if not isinstance(table, dict) or not table:
            self.faults.append(f"[{place}]: expected a table of NAME = {{value, std}}")
            return []
        found = []
        for path, value in leaves(table, {*keys_of(Measured), *keys_of(MeasuredCurve)}):
            name = ".".join(path)
            if path == (CURVE,):
                found += self._curve(value, test, place)
            elif not isinstance(value, dict):
                self.faults.append(f"[{place}] {name} = {toml_value(value)}: expected a table {{value, std}}")
            elif (own := self._read(Measured, value, place, f"{name}.")) is not None:
                found.append(Datum(test, name, own.value, own.std))
        return found

    def _curve(self, value: object, test: int, place: str) -> list[Datum]:
        """Return the points of a measured curve."""
        if not isinstance(value, dict):
            self.faults.append(f"[{place}] {CURVE} = {toml_value(value)}: expected a table {{file, std}}")
            return []
        own = self._read(MeasuredCurve, value, place, f"{CURVE}.")
        if own is None:
            return []
        path = self.folder / own.file
        try:
            names, rows = _curve_rows(path)
        except (OSError, ValueError, csv.Error) as error:
            words = error.strerror if isinstance(error, OSError) else error
            self.faults.append(f"[{place}] {CURVE}.file = {toml_value(str(own.file))}: {words}")
            return []
        return [Datum(test, names[1], stress, own.std, strain, names[0]) for strain, stress in rows]

    def _read(self, kind: type[Any], table: object, section: str, prefix: str) -> Any:
        reader = TableReader()
        found = reader.read(kind, table, section, prefix)
        self.faults += reader.faults
        return found


def leaves(table: Mapping[str, Any], keys: Collection[str], above: TomlPath = ()) -> Iterator[tuple[TomlPath, Any]]:
    """Yield the paths and values of a nested table; a table with one of the keys is a value, and so is an empty one."""
    for name, value in table.items():
        path = (*above, *name.split("."))
        if isinstance(value, dict) and value and not value.keys() & set(keys):
            yield from leaves(value, keys, path)
        else:
            yield path, value


def _curve_rows(path: Path) -> tuple[tuple[str, str], list[tuple[float, float]]]:
    """Return the names of strain and stress, and the rows, of a table of a curve. Raises OSError, ValueError."""
    reader = csv.DictReader(io.StringIO(input_files.read(path).decode("utf-8-sig")), skipinitialspace=True)
    reader.fieldnames = named = [word.strip() for word in reader.fieldnames or ()]
    strains, stresses = ([n for n in named if n in known] for known in (SPATIAL_STRAINS, SPATIAL_STRESSES))
    if len(strains) != 1 or len(stresses) != 1:
        raise ValueError(f"{path}: expected one column of a strain, as E11, and one of a stress, as S11")
    names = strains[0], stresses[0]
    rows = [_numbers(f"{path}, line {line}", row, names) for line, row in enumerate(reader, start=2)]
    if not 0 < len(rows) <= MOST_ROWS:
        raise ValueError(f"{path}: {len(rows)} rows; expected at least one and at most {MOST_ROWS}")
    return names, rows


def _numbers(place: str, row: Mapping[str, Any], names: tuple[str, str]) -> tuple[float, float]:
    """Return strain and stress of a row. Raises ValueError."""
    try:
        found = float(row[names[0]]), float(row[names[1]])
    except (TypeError, ValueError):
        raise ValueError(f"{place}: expected two numbers") from None
    if not all(map(is_number, found)):
        raise ValueError(f"{place}: expected finite numbers")
    return found
