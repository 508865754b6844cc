"""Read a fibre table, for example measured in a micrograph: a row per fibre, with columns x, y, radius and others."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.errors import MOST_FAULTS, CaseError
from feti_homog.microstructure import table_columns
from feti_homog.microstructure.phase_names import MATRIX, PHASE, VOID
from feti_homog.microstructure.shapes import Outlines
from feti_homog.microstructure.shapes.outlines import Columns
from feti_homog.microstructure.shapes.shapes import REPLACING, outlines_of
from feti_homog.schema import types, wording
from feti_homog.typing import Bool, Float, Int

FIRST_COLUMNS = ("x", "y", "radius", "phase")
COLUMNS = (*FIRST_COLUMNS, *(name for name in table_columns.NUMBERS if name not in FIRST_COLUMNS))
SIZES = ("width", "height", "left", "bottom")
"""Names in comment lines about the cell: its size, and the coordinates of its lower left corner."""
OF_FIBRES = ("coating", "inner_radius")
# Error of centres and radii in tables, relative to the radius: closer rows are one fibre, and smaller overlaps can be
# repaired.
SAME_FIBRE = 0.01
LENGTH = rf"([^\s;=:]+?)(?:\s*({table_columns.UNITS})\b)?"
SIZE = re.compile(rf"\b(width|height|left|bottom)\s*[=:]\s*{LENGTH}(?=,?\s|,?$|;|,[a-z])")


@dataclass(frozen=True)
class FibreTable:
    """A table of N fibres in one length unit; a row may list any periodic image of its fibre.

    Attributes:
        name: name of the file or list, for messages.
        row: (N,) line in the file or position in the list, from 1, for messages and results.
        columns: name -> numbers (N,), for every name in `table_columns.NUMBERS`.
        given: names of the columns in the table.
        phase: N names, "fibre" by default, "void" for voids.
        width, height, left, bottom: size of the cell, and its lower left corner; None if the table lacks them.
        remarks: lines for the user on unused parts of the table.
    """

    name: str
    row: Int
    columns: Columns
    given: frozenset[str]
    phase: tuple[str, ...]
    width: float | None
    height: float | None
    left: float | None
    bottom: float | None
    remarks: tuple[str, ...] = ()

    @cached_property
    def outlines(self) -> Outlines:
        """The N outlines in the unit of the table, coatings excluded; the table must have no faults."""
        return outlines_of(self.columns)

    @property
    def radius(self) -> Float:
        """The radii (N,) of discs with the areas of the outlines, without coatings."""
        return self.outlines.radii

    @property
    def coating(self) -> Float:
        """The ratios (N,) of coating thickness to radius, 0 without coating."""
        return self.columns["coating"]

    @property
    def inner_radius(self) -> Float:
        """The radii (N,) of the voids within hollow fibres, 0 for other fibres."""
        return self.columns["inner_radius"]

    @property
    def strength(self) -> Float:
        """The bond strengths (N,) of the fibres relative to the bond strength of the case, 1 by default."""
        return self.columns["strength"]

    @property
    def centres(self) -> Float:
        """The centres (N, 2) of the fibres in the coordinates of the table."""
        return np.column_stack([self.columns["x"], self.columns["y"]])

    @property
    def size(self) -> Float:
        """The width and height (2,) of the cell, NaN if the table lacks them."""
        return np.array([self.width, self.height], float)

    @property
    def places(self) -> Float:
        """The centres (N, 2) of the fibres, relative to the lower left corner of the cell."""
        return self.centres - self.corner

    @property
    def corner(self) -> Float:
        """The lower left corner (2,) of the cell, by default the least coordinates of the centres."""
        given = np.array([self.left, self.bottom], float)
        return np.where(np.isnan(given), self.centres.min(axis=0), given)

    @property
    def is_void(self) -> Bool:
        """The mask (N,) of voids."""
        return np.array([name == VOID for name in self.phase], bool)

    def rows(self, kept: Int) -> FibreTable:
        """Restrict the table to the rows with indices `kept` (k,)."""
        columns = {name: values[kept] for name, values in self.columns.items()}
        return replace(self, row=self.row[kept], columns=columns, phase=tuple(self.phase[k] for k in kept.tolist()))

    @property
    def outer_radius(self) -> Float:
        """The radii (N,) of the fibres, plus the thickness of their coatings."""
        return self.radius * (1 + self.coating)


def read_table(path: Path, columns: Sequence[str] | None = None) -> FibreTable:
    """Read a fibre table from a text file.  Fibres may overlap.

    The first line, or `columns`, lists the column names: x, y, radius (or a, b), phase, coating, angle and other names
    that `understood` accepts. A line of units may follow, then a line per fibre. Commas, semicolons, tabs or else
    spaces separate columns; commas may be decimal marks if other characters separate columns. "#" begins a comment;
    "# width = 120, height = 80" gives the cell size, and "left" and "bottom" give the lower left corner.

    Raises:
        CaseError: the table is faulty; one line per fault, with the line number in the file.
    """
    name, faults = path.name, _Faults(path.name)
    sizes, units = dict[str, float](), set[str]()
    lines = list[tuple[int, str]]()
    for number, contents, comment in table_columns.lines_of(path):
        for key, word, unit in SIZE.findall(comment):
            units |= {unit} - {""}
            value = table_columns.number_of(word, ";")
            if value is None or not types.is_number(value) or (value <= 0 and key in SIZES[:2]):
                expected = "a number above 0" if key in SIZES[:2] else "a number"
                faults.add(number, f"{key} = {word}: expected {expected}")
            elif sizes.setdefault(key, value) != value:
                faults.add(number, f"{key} = {word}: an earlier line has {sizes[key]:g}")
        if contents:
            lines.append((number, contents))
    if not lines:
        raise CaseError(*faults.lines, f"{name}: no rows; expected a line of names such as x, y, radius, then fibres")
    if len(lines) > 2 * types.MOST_FIBRES:
        raise CaseError(f"{name}: {len(lines)} lines; expected at most {2 * types.MOST_FIBRES}")
    delimiter = table_columns.delimiter_of(lines[0][1])
    head = [table_columns.cells_of(line, delimiter) for _, line in lines[:2]]
    words = head[0] if columns is None else list(columns)
    read, unread = table_columns.understood(words, COLUMNS)
    for row in (words, *filter(table_columns.are_units, head[1:])):
        units |= table_columns.units_of(row, read)
    _check_names(words, read, unread, units, lines[0][0], faults)
    faults.throw()
    rows: dict[int, dict[str, Any]] = {}
    # The first line has names, or no numbers, and units may follow.
    if columns is None or all(table_columns.number_of(word, delimiter) is None for word in head[0]):
        lines = lines[2:] if any(map(table_columns.are_units, head[1:])) else lines[1:]
    for number, line in lines:
        cells = table_columns.cells_of(line, delimiter)
        if fault := table_columns.row_fault(line, cells, len(words)):
            faults.add(number, fault)
        else:
            rows[number] = {c.name: c.read(cells[c.place], delimiter) for c in read if cells[c.place]}
    remarks = _remarks(name, words, unread)
    return replace(_table(name, rows, {column.name for column in read}, sizes, faults), remarks=remarks)


def table_of(entries: Sequence[Mapping[str, Any]], name: str) -> FibreTable:
    """Build a table from fibres {column: value}; rows are numbered from 1.  Raises CaseError, one line per fault."""
    faults = _Faults(name)
    for number, entry in enumerate(entries, 1):
        for key in entry.keys() - set(COLUMNS):
            hint = wording.suggestion(key, COLUMNS, {}) if len(faults.lines) < MOST_FAULTS else ""
            faults.add(number, f"{key} = {wording.toml_value(entry[key])}: unknown key; {hint}")
    return _table(name, dict(enumerate(entries, 1)), {key for entry in entries for key in entry}, {}, faults)


class _Faults:
    """The faults of a table so far, one line each, with row numbers."""

    def __init__(self, name: str) -> None:
        self.lines: list[str] = []
        self._name = name

    def add(self, row: int, words: str) -> None:
        self.lines.append(f"{self._name}: row {row}: {words}")

    def throw(self) -> None:
        """Raise a CaseError with all faults, if any."""
        if self.lines:
            raise CaseError(*self.lines)


def _check_names(
    words: Sequence[str],
    read: Sequence[table_columns.SourceColumn],
    unread: Sequence[str],
    units: set[str],
    row: int,
    faults: _Faults,
) -> None:
    """Add faults of column names: repeated, misspelt, missing, `units` mixed; CaseError if no name is known."""
    names = [column.name for column in read]
    if not names:
        given = wording.toml_value(", ".join(words))
        ways = 'in [cell] columns = ["x", "y", "radius"]'
        faults.add(row, f"{given}: expected names of columns, such as x, y, radius, here or {ways}")
        faults.throw()
    for name in dict.fromkeys(name for name in names if names.count(name) > 1):
        faults.add(row, f"column {name}: the name is there twice")
    for word in unread:
        if meant := table_columns.misspelt(word, [name for name in COLUMNS if name not in names]):
            faults.add(row, f"column {wording.toml_value(word)}: unknown; did you mean {meant}?")
    units = {re.sub("[µμ]", "u", unit.lower()) for unit in units}  # both letters stand for micro
    if len(units) > 1:
        faults.add(row, f"lengths in {' and '.join(sorted(units))}: expected one unit")
    ignored = f"; not read: {', '.join(map(wording.toml_value, unread))}" if unread else ""
    # The radius, or the sizes of a shape that replace it.
    sizes = next((sizes for sizes in (("radius",), *REPLACING) if not set(names).isdisjoint(sizes)), ("radius",))
    for name in ("x", "y", *sizes):
        if name not in names:
            faults.add(row, f"column {name}: missing{ignored}")


def _remarks(name: str, words: Sequence[str], unread: Sequence[str]) -> tuple[str, ...]:
    """Return remarks on unread columns, and on a table where y points down."""
    remarks = list[str]()
    if unread:
        remarks.append(f"[cell] {name}: not read: {', '.join(map(wording.toml_value, unread))}")
    if table_columns.points_down(words):
        signs = "terms that couple a normal and a shear component, such as C13, change sign"
        remarks.append(f"[cell] {name}: the cell mirrors the picture, in which y points down; {signs}")
    return tuple(remarks)


def _table(
    name: str, rows: Mapping[int, Mapping[str, Any]], names: set[str], sizes: Mapping[str, float], faults: _Faults
) -> FibreTable:
    """Build a table from `rows` {row number: {column: value}} and `sizes`; CaseError with all `faults`, old and new."""
    for row, cells in rows.items():
        has_size = any(set(replacing) <= cells.keys() for replacing in REPLACING)
        for key in ("x", "y") if has_size else ("x", "y", "radius"):
            if key not in cells:
                faults.add(row, f"{key}: no value; expected a number")
        for key in table_columns.NUMBERS:
            if complaint := table_columns.FIBRE_CELLS[key].complaint(cells.get(key, 1.0)):
                faults.add(row, f"{key} = {wording.toml_value(cells[key])}: {complaint}")
        phase = cells.get("phase", "fibre")
        for key in OF_FIBRES:
            if phase == VOID and cells.get(key):
                faults.add(row, f"{key} = {wording.toml_value(cells[key])}: a void has none")
        if not isinstance(phase, str) or not (phase == VOID or PHASE.fullmatch(phase)) or phase == MATRIX:
            words = f"phase = {wording.toml_value(phase)}: expected a name of letters, digits, _, - and :"
            faults.add(row, f'{words}, but not "matrix", which is around the fibres')
    if not rows and not faults.lines:
        faults.lines.append(f"{name}: no fibres; expected a row for each")
    faults.throw()
    columns = {
        key: np.array([cells.get(key, column.empty) for cells in rows.values()], float)
        for key, column in table_columns.NUMBERS.items()
    }
    return FibreTable(
        name=name,
        row=np.fromiter(rows, np.intp),
        columns=columns,
        given=frozenset(names),
        phase=tuple(cells.get("phase", "fibre") for cells in rows.values()),
        width=sizes.get("width"),
        height=sizes.get("height"),
        left=sizes.get("left"),
        bottom=sizes.get("bottom"),
    )
