"""Reading of the tables of a fit: its unknowns, its tests and what was measured in them, with all their faults."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from feti_homog.case.document import TomlPath
from feti_homog.case.sections import CURVE, MEASURED, TEST, UNKNOWN, Measured, MeasuredCurve, Unknown
from feti_homog.materials.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES
from feti_homog.schema.keys import TableReader, keys_of
from feti_homog.schema.values import is_number
from feti_homog.schema.wording import dotted_key, toml_value
from feti_homog.studies.fit.predictions import Datum
from feti_homog.studies.sweep.points import Assignment
from feti_homog.system.runtime import input_files

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
        except (OSError, ValueError, csv.Error) as error:
            words = error.strerror if isinstance(error, OSError) else error
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
