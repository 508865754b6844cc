"""Reading of the tables of a fit: its unknowns, its tests and what was measured in them, with all their faults."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from feti_homog.case.document import TomlPath
from feti_homog.case.sections import CURVE, MEASURED, TEST, UNKNOWN, Measured, MeasuredCurve, Unknown
from feti_homog.errors import CaseError
from feti_homog.materials.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES
from feti_homog.microstructure.table_columns import cells_of, delimiter_of, lines_of, number_of, row_fault
from feti_homog.schema.keys import TableReader, keys_of
from feti_homog.schema.values import is_number
from feti_homog.schema.wording import dotted_key, toml_value
from feti_homog.studies.fit.predictions import Datum
from feti_homog.studies.sweep.points import Assignment

MOST_ROWS = 10_000
LEAST_STD = 1e-12  # of the value: below it are the roundings of what is computed


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
                self._check_std(own.std, own.value, f"[{place}] {name}.std")
        return found

    def _check_std(self, std: float, value: float, place: str) -> None:
        if std < LEAST_STD * abs(value):
            self.faults.append(f"{place} = {toml_value(std)}: expected at least {LEAST_STD:g} of {value:g}")

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
        except CaseError as error:
            words = error.__cause__.strerror if isinstance(error.__cause__, OSError) else error
            self.faults.append(f"[{place}] {CURVE}.file = {toml_value(str(own.file))}: {words}")
            return []
        self._check_std(own.std, max((stress for _, stress in rows), key=abs), f"[{place}] {CURVE}.std")
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
    """Return the names of strain and stress, and the rows, of a table of a curve. Raises CaseError."""
    lines = [(number, line) for number, line, _ in lines_of(path) if line]
    head = lines[0][1] if lines else ""
    delimiter = delimiter_of(head)
    named = cells_of(head, delimiter)
    strains, stresses = ([k for k, n in enumerate(named) if n in own] for own in (SPATIAL_STRAINS, SPATIAL_STRESSES))
    if (len(strains), len(stresses)) != (1, 1):
        raise CaseError(f"{path}: expected one column of a strain, as E11, and one of a stress, as S11")
    if not 1 < len(lines) <= MOST_ROWS + 1:
        raise CaseError(f"{path}: {len(lines) - 1} rows; expected at least one and at most {MOST_ROWS}")
    rows = list[tuple[float, float]]()
    for number, line in lines[1:]:
        cells, place = cells_of(line, delimiter), f"{path}, line {number}"
        if fault := row_fault(line, cells, len(named)):
            raise CaseError(f"{place}: {fault}")
        strain, stress = (_number(cells[k], delimiter, f"{place}: {named[k]}") for k in strains + stresses)
        rows.append((strain, stress))
    return (named[strains[0]], named[stresses[0]]), rows


def _number(word: str, delimiter: str | None, place: str) -> float:
    """Return the number that a cell is. Raises CaseError."""
    value = number_of(word, delimiter)
    if value is None or not is_number(value):
        raise CaseError(f"{place} = {toml_value(word)}: expected a number")
    return value
