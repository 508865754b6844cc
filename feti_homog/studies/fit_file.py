"""Read a fit file: a case with unknown constants and measured values; report all its faults."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from feti_homog.case import sections, toml_files
from feti_homog.errors import CaseError
from feti_homog.materials import voigt
from feti_homog.microstructure import table_columns
from feti_homog.schema import TableReader, keys, types, wording
from feti_homog.studies.axes import Assignment
from feti_homog.studies.fit import Fit
from feti_homog.studies.predictions import Datum, data_faults

LEAST_STD = 1e-12  # relative to the value: smaller deviations are below rounding errors


def load(path: Path) -> Fit:
    """Load a fit from a file.  Raises CaseError with all faults of its tables or, if these are sound, of its cases."""
    return parse(toml_files.read_document(path), path.parent)


def parse(values: Mapping[str, Any], folder: Path) -> Fit:
    """Build a fit from a document; file names in it are relative to `folder`.  Raises CaseError like `load`."""
    document = {"name": "fit", **toml_files.to_document(values)}
    reader = FitReader(folder)
    unknowns = reader.unknowns(document.pop(sections.UNKNOWN, None))
    measured, tests = document.pop(sections.MEASURED, None), document.pop(sections.TEST, None)
    if sections.SWEEP in document:
        reader.faults.append(f"[{sections.SWEEP}]: a fit has no sweep; expected [[{sections.TEST}]] for each test")
    assignments, data = reader.tests(measured, tests, {*unknowns})
    if reader.faults:
        raise CaseError(*reader.faults)
    named = {".".join(path): unknown for path, unknown in unknowns.items()}
    fit = Fit(document, folder, named, [*unknowns], assignments, data)
    start, faults = [unknown.start for unknown in unknowns.values()], list[str]()
    if len(data) < len(unknowns):
        counts = f"{len(unknowns)} unknowns, {len(data)} measured value{'s' if len(data) > 1 else ''}"
        faults.append(f"[{sections.UNKNOWN}]: {counts}; expected at least as many values")
    cases = fit.at(start).cases
    for test, case in enumerate(cases):
        place = f"[[{sections.TEST}]] {test + 1}, {sections.MEASURED}." if len(cases) > 1 else f"[{sections.MEASURED}] "
        faults += data_faults(case, fit.data_of(test), place)
    digests = [case.digest() for case in cases]
    for k, (name, unknown) in enumerate(named.items()):
        lines, changes = list[str](), False
        for side, end in (("lower", unknown.lower), ("upper", unknown.upper)):
            try:
                changes |= [case.digest() for case in fit.at([*start[:k], end, *start[k + 1 :]]).cases] != digests
            except CaseError as error:
                lines += [f"[{sections.UNKNOWN}] {name}, {side} = {end}: {fault}" for fault in error.faults]
        if not (changes or lines):
            lines.append(f"[{sections.UNKNOWN}] {name}: no measured value depends on it")
        faults += lines
    if faults:
        raise CaseError(*dict.fromkeys(faults))
    return fit


@dataclass
class FitReader:
    """A reader of the tables in a fit file, which collects their faults; file names are relative to `folder`."""

    folder: Path
    faults: list[str] = field(default_factory=list)

    def unknowns(self, table: object) -> dict[toml_files.TomlPath, sections.Unknown]:
        """Read the table [unknown]; return the readable unknowns by key path.  Each fault adds a line to `faults`."""
        if not isinstance(table, dict) or not table:
            self.faults.append(f"[{sections.UNKNOWN}]: expected a table of SECTION.KEY = {{start, lower, upper}}")
            return {}
        unknowns = {}
        for path, value in _entries(table, keys.keys_of(sections.Unknown)):
            name = wording.dotted_key(path)
            unknown = self._read(sections.Unknown, value, sections.UNKNOWN, name, "{start, lower, upper}")
            if unknown is not None:
                unknowns[path] = unknown
                if not unknown.lower < unknown.upper or not unknown.lower <= unknown.start <= unknown.upper:
                    bounds = f"lower = {unknown.lower:g}, start = {unknown.start:g}, upper = {unknown.upper:g}"
                    expected = "expected lower <= start <= upper, lower < upper"
                    self.faults.append(f"[{sections.UNKNOWN}] {name}: {bounds}: {expected}")
        return unknowns

    def tests(
        self, measured: object, tests: object, unknowns: set[toml_files.TomlPath]
    ) -> tuple[list[Assignment], list[Datum]]:
        """Read the case changes of each test, and the readable measured values.  Each fault adds a line to `faults`."""
        if (measured is None) == (tests is None):
            several = f"[[{sections.TEST}]] for each of several, with measured"
            self.faults.append(f"expected [{sections.MEASURED}] for one test or {several}")
            return [], []
        rows = [{sections.MEASURED: measured}] if tests is None else tests
        if not isinstance(rows, list) or len(rows) > types.MOST_SECTIONS or {*map(type, rows)} - {dict}:
            words = f"expected sections [[{sections.TEST}]], at most {types.MOST_SECTIONS}"
            self.faults.append(f"{sections.TEST} = {wording.toml_value(rows)}: {words}")
            return [], []
        assignments, data = list[Assignment](), list[Datum]()
        both = {*keys.keys_of(sections.Measured), *keys.keys_of(sections.MeasuredCurve)}
        for number, row in enumerate(rows):
            place = sections.MEASURED if tests is None else f"[{sections.TEST}]] {number + 1}, [{sections.MEASURED}"
            table = row.get(sections.MEASURED)
            if not isinstance(table, dict) or not table:
                self.faults.append(f"[{place}]: expected a table of NAME = {{value, std}}")
                table = {}
            for path, value in _entries(table, both):
                name = ".".join(path)
                if path == (sections.CURVE,):
                    data += self._curve(value, number, place)
                elif (datum := self._read(sections.Measured, value, place, name, "{value, std}")) is not None:
                    data.append(Datum(number, name, datum.value, datum.std))
                    self._check_std(datum.std, datum.value, f"[{place}] {name}.std")
            of_case = {name: value for name, value in row.items() if name != sections.MEASURED}
            changes = dict(toml_files.leaves(of_case, lambda path, _: toml_files.is_key(path)))
            assignments.append(changes)
            for path in changes.keys() & unknowns:
                name = f"[[{sections.TEST}]] {number + 1}, {wording.dotted_key(path)}"
                self.faults.append(f"{name}: it is an unknown of [{sections.UNKNOWN}]")
        return assignments, data

    def _check_std(self, std: float, value: float, place: str) -> None:
        if std < LEAST_STD * abs(value):
            self.faults.append(f"{place} = {wording.toml_value(std)}: expected at least {LEAST_STD:g} of {value:g}")

    def _curve(self, value: object, test: int, place: str) -> list[Datum]:
        """Read the points of a measured curve from its file.  After a fault, adds a line to `faults` and returns []."""
        measured = self._read(sections.MeasuredCurve, value, place, sections.CURVE, "{file, std}")
        if measured is None:
            return []
        path = self.folder / measured.file
        try:
            names, rows = _curve_rows(path)
        except CaseError as error:
            reason = error.__cause__.strerror if isinstance(error.__cause__, OSError) else error
            self.faults.append(f"[{place}] {sections.CURVE}.file = {wording.toml_value(str(measured.file))}: {reason}")
            return []
        self._check_std(measured.std, max((stress for _, stress in rows), key=abs), f"[{place}] {sections.CURVE}.std")
        return [Datum(test, names[1], stress, measured.std, strain, names[0]) for strain, stress in rows]

    def _read(self, kind: type[Any], value: object, section: str, name: str, form: str) -> Any:
        """Read a table into a dataclass `kind`.  For a faulty table, adds lines to `faults` and returns None."""
        if not isinstance(value, dict):
            self.faults.append(f"[{section}] {name} = {wording.toml_value(value)}: expected a table {form}")
            return None
        return TableReader(faults=self.faults).read(kind, value, section, f"{name}.")


def _entries(table: Mapping[str, Any], keys: Collection[str]) -> Iterator[tuple[toml_files.TomlPath, Any]]:
    """Yield the path and value of each entry in a nested table; a table with one of `keys` is a value."""
    return toml_files.leaves(table, lambda path, value: bool(value.keys() & {*keys}))


def _curve_rows(path: Path) -> tuple[tuple[str, str], list[tuple[float, float]]]:
    """Read names and rows (strain, stress) of a curve from CSV.  Raises CaseError for an unreadable or faulty file."""
    lines = [(number, line) for number, line, _ in table_columns.lines_of(path) if line]
    head = lines[0][1] if lines else ""
    delimiter = table_columns.delimiter_of(head)
    heads = table_columns.cells_of(head, delimiter)
    kinds = voigt.SPATIAL_STRAINS, voigt.SPATIAL_STRESSES
    strains, stresses = ([k for k, head in enumerate(heads) if head in names] for names in kinds)
    if (len(strains), len(stresses)) != (1, 1):
        raise CaseError(f"{path}: {wording.toml_value(head)}: expected names of one strain and one stress: E11,S11")
    if not 1 < len(lines) <= types.MOST_ROWS + 1:
        raise CaseError(f"{path}: {len(lines) - 1} rows; expected at least one and at most {types.MOST_ROWS}")
    rows = list[tuple[float, float]]()
    for number, line in lines[1:]:
        cells, place = table_columns.cells_of(line, delimiter), f"{path}, line {number}"
        if fault := table_columns.row_fault(line, cells, len(heads)):
            raise CaseError(f"{place}: {fault}")
        values = list[float]()
        for k in strains + stresses:
            value = table_columns.number_of(cells[k], delimiter)
            if value is None or not types.is_number(value):
                raise CaseError(f"{place}: {heads[k]} = {wording.toml_value(cells[k])}: expected a number")
            values.append(value)
        rows.append((values[0], values[1]))
    return (heads[strains[0]], heads[stresses[0]]), rows
