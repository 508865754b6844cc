"""Read the lines and column names of fibre tables that spreadsheets and image programs write.

Column names may end with units in brackets; diameters, areas and axes of ellipses may replace radii.
"""

import difflib
import math
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from feti_homog.errors import CaseError
from feti_homog.microstructure.shapes.outlines import ColumnRange
from feti_homog.microstructure.shapes.shapes import SHAPES
from feti_homog.schema import types
from feti_homog.system.runtime import input_files

# Numeric columns, each with the value of an empty cell and bounds.
NUMBERS = {
    "x": ColumnRange(math.nan),
    "y": ColumnRange(math.nan),
    "radius": ColumnRange(math.nan, above=0.0),
    "coating": ColumnRange(0.0, least=0.0),
    "inner_radius": ColumnRange(0.0, least=0.0),
    "strength": ColumnRange(1.0, above=0.0),
} | {name: column for shape in SHAPES for name, column in shape.columns.items()}
FIBRE_CELLS: Mapping[str, types.ValueType] = {
    name: types.real(least=column.least, above=column.above) for name, column in NUMBERS.items()
}
"""The types of the numbers of a fibre, by column."""

MAX_BYTES = 1 << 26
EMPTY = " \t\r,;"
"""Characters of a line without cells, as Excel writes them below a table."""
SEPARATOR = re.compile(r"sep=[,;\t]?")
"""A first line that tells Excel the separator."""
UNITS_OF_EXCEL = bytes.maketrans(b"\xb5\xb0\xb2", b"uo2")
"""Letters for the signs of micro, degree and square in Excel's Western European code pages."""


def lines_of(path: Path) -> Iterator[tuple[int, str, str]]:
    """Yield number, content and comment of each line in a text file.

    Numbers begin at 1; the content is "" for lines without cells, and for a first line such as "sep=;"; the comment is
    the text behind "#".  Raises CaseError if the file cannot be read, or is not text.
    """
    try:
        content = input_files.read(path, MAX_BYTES)
    except OSError as error:
        raise CaseError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        text = content.decode("utf-16" if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else "utf-8-sig")
    except UnicodeDecodeError as error:
        try:
            text = content.translate(UNITS_OF_EXCEL).decode()
        except UnicodeDecodeError as other:
            row = content.count(b"\n", 0, error.start) + 1
            raise CaseError(f"{path.name}: expected text in UTF-8; line {row} has other bytes") from other
    if "\0" in text:
        raise CaseError(f"{path.name}: expected text; it has null characters, like UTF-16 without a byte order mark")
    has_begun = False
    for number, line in enumerate(text.splitlines(), 1):
        contents, _, comment = line.partition("#")
        is_empty = not contents.strip(EMPTY) or (not has_begun and SEPARATOR.fullmatch(contents.strip()) is not None)
        has_begun = has_begun or not is_empty
        yield number, "" if is_empty else contents, comment


def delimiter_of(line: str) -> str | None:
    """Return the delimiter of columns in the first line of a table: semicolon, tab or comma; None for spaces."""
    return next((mark for mark in ";\t," if mark in line), None)


def cells_of(line: str, delimiter: str | None) -> list[str]:
    """Split a row into cells, and strip blanks and quotation marks."""
    return [word.strip().strip('"').strip() for word in line.split(delimiter)]


def row_fault(line: str, cells: Sequence[str], count: int) -> str:
    """Return the fault of a row: an open quotation mark, or a cell count other than `count`; else an empty string."""
    if line.count('"') % 2:
        return "a quotation mark is not closed"
    return "" if len(cells) == count else f"expected {count} columns, one for each name; it has {len(cells)}"


UNITS = "nm|um|µm|μm|mm|cm|m|px|pixels?|deg|degrees?"
UNIT = re.compile(rf"([\[(/_\s]({UNITS})(\^?[2²])?[\])]?|\[[^][]*\]|\([^()]*\)|/[^/]+)$", re.IGNORECASE)
ROW_UNIT = re.compile(rf"[\[(]?({UNITS}|°|-)[\])]?", re.IGNORECASE)
"""A cell in a line of units."""
MATLABS_AXIS = "majoraxislength"
SCIKITS_AXES = ("axis_major_length", "major_axis_length")
AXES_OF_PICTURES = {"major", MATLABS_AXIS}
"""Names of major axes in tables where y points down, but angles are counter-clockwise in the picture."""
POINTING_DOWN = AXES_OF_PICTURES | {*SCIKITS_AXES, "row", "centroid-0", "centroid_2"}
"""Names of columns in tables where y points down."""
CENTRES = ("{}c", "{}_c", "c{}", "center_{}", "centre_{}", "centroid_{}", "{}_center", "{}_centre")
EQUIVALENT_DIAMETERS = ("equivdiameter", "equivalent_diameter", "equivalent_diameter_area")


# Other names of a column (earlier entries take precedence), the column, and the conversion of values. Major and Minor,
# ImageJ's axes, make an area superfluous; MATLAB's Centroid_1 is x, centroid-0 of scikit-image is the row, y.
OTHERS: tuple[tuple[tuple[str, ...], str, Callable[[float], float]], ...] = (
    (("xm", *(word.format("x") for word in CENTRES), "centroid_1", "centroid-1", "col", "column"), "x", float),
    (("ym", *(word.format("y") for word in CENTRES), "centroid_2", "centroid-0", "row"), "y", float),
    (("major", MATLABS_AXIS, *SCIKITS_AXES), "a", lambda d: d / 2),
    (("minor", "minoraxislength", "axis_minor_length", "minor_axis_length"), "b", lambda d: d / 2),
    (("r", "rad", "fibre_radius", "fiber_radius", "radii"), "radius", float),
    (("diameter", "diam", "d", "fibre_diameter", "fiber_diameter", *EQUIVALENT_DIAMETERS), "radius", lambda d: d / 2),
    (("area",), "radius", lambda area: math.copysign(math.sqrt(abs(area) / math.pi), area)),
    (("material", "type"), "phase", float),
)


INSTEAD = {"radius": "a"}
"""Columns that are not derived if another column is present."""


@dataclass(frozen=True)
class SourceColumn:
    """A column of a file: place in each row, name (a key of `NUMBERS` or "phase"), conversion of numbers."""

    place: int
    name: str
    value: Callable[[float], float]

    def read(self, word: str, delimiter: str | None) -> float | str:
        """Convert a numeric entry of a table with this delimiter; return any other entry, or a phase, unchanged."""
        number = None if self.name == "phase" else number_of(word, delimiter)
        return word if number is None else self.value(number)


def _bare(word: str) -> str:
    """Strip the unit from a column name; return it in lower case, with _ for blanks."""
    return UNIT.sub("", word.strip()).strip().lower().replace(" ", "_")


def understood(words: Sequence[str], known: Sequence[str]) -> tuple[list[SourceColumn], list[str]]:
    """Recognize columns by names in `known` or OTHERS; capitals do not matter.  Returns columns and unread names."""
    bare = list(map(_bare, words))
    values: dict[str, Callable[[float], float]] = {}
    if not AXES_OF_PICTURES.isdisjoint(bare):
        # Where y points down, angles are still counter-clockwise in the picture.
        values["angle"] = lambda value: -value
    elif "orientation" in bare and not set(SCIKITS_AXES).isdisjoint(bare):
        values["angle"] = lambda value: 90.0 - math.degrees(value)  # radians from the direction of the rows
    if values and "major" not in bare:
        # The orientations of other programs may be from another axis.
        bare = ["angle" if name == "orientation" else name for name in bare]
    columns = [SourceColumn(place, name, values.get(name, float)) for place, name in enumerate(bare) if name in known]
    for others, name, value in OTHERS:
        given = {column.name for column in columns}
        if {name, INSTEAD.get(name, name)}.isdisjoint(given):
            other = next((other for other in others if other in bare), None)
            if other is not None:
                columns.append(SourceColumn(bare.index(other), name, value))
    read = {column.place for column in columns}
    return columns, [word for place, word in enumerate(words) if place not in read]


def points_down(words: Sequence[str]) -> bool:
    """Return whether the column names `words` are from a program whose y axis points down, as in pictures."""
    return not POINTING_DOWN.isdisjoint(map(_bare, words))


def are_units(words: Sequence[str]) -> bool:
    """Return whether a line has only units, which some programs write below the names."""
    return bool(set(words) - {"", "-"}) and all(ROW_UNIT.fullmatch(word) for word in words if word)


def units_of(words: Sequence[str], columns: Sequence[SourceColumn]) -> set[str]:
    """Return the units of length that names, or cells in a line of units, of columns end with."""
    cells = (f" {words[column.place]}" for column in columns if column.name != "angle" and column.place < len(words))
    return {ending[2] for cell in cells if (ending := UNIT.search(cell.rstrip())) and ending[2]}


def misspelt(word: str, missing: Sequence[str]) -> str:
    """Return the column among `missing` with a name similar to `word`; "" without such a column."""
    near = difflib.get_close_matches(_bare(word), missing, n=1, cutoff=0.75)
    return near[0] if near else ""


def number_of(word: str, delimiter: str | None) -> float | None:
    """Convert a word to a finite number, or return None.  Commas are decimal marks unless they are the delimiter."""
    try:
        value = float(word if delimiter == "," else word.replace(",", "."))
    except ValueError:
        return None
    return value if math.isfinite(value) and "_" not in word else None
