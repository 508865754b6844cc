"""Write the tables of a result as text for a terminal or as HTML, and find the units of table columns."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Any

from feti_homog.typing import Document

STRESSES = ("young", "stiffness", "normal_strength", "tangential_strength", "axial_strength", "tractions",
           "dissipated", "dissipated_strain_controlled", "friction_heat", "work", "load_stored")  # fmt: skip
MODULI = re.compile(
    r"E[123]|G\d\d|[EGK]_(axial|transverse)|(C\d\d|S\d\d|bulk|shear)(_\w+)?|anisotropy_\w+|\w+_(C|S)\d\d"
    r"|(.+_)?(principal|von_mises|hydrostatic)|((axial|transverse)_)?(tension|compression)|(axial|transverse)_shear"
)
FIXED = {"angle": "degrees", "centre": "degrees", "values": "degrees", "memory": "bytes"}
ERROR = ".1e"
SAME_IN_HTML = re.compile(rf"\.\d+f|{re.escape(ERROR)}")
WIDTH = 79  # characters in a line of text
NOISE = 1e-12  # relative size of a zero with solver noise
UNKNOWN = "-"


def unit(name: str, stress_unit: str) -> str:
    """Return the unit of a dotted case key or a sweep column; empty without one."""
    last = name.rpartition(".")[2].removesuffix("_mesh_error")
    if last.startswith("seconds_"):
        return "s"
    if last in STRESSES or MODULI.fullmatch(last):
        return stress_unit
    return FIXED.get(last, "")


def with_unit(name: str, stress_unit: str) -> str:
    """Append the unit of a name, if any, in brackets."""
    return name + in_brackets(unit(name, stress_unit))


def in_brackets(unit: str) -> str:
    """Put a unit in brackets, after a space; empty without a unit."""
    return f" ({with_micro(unit)})" if unit else ""


def with_micro(unit: str) -> str:
    """Replace the letter u of "um" in a unit by the micro sign."""
    return re.sub(r"\bum(?![A-Za-z])", "\N{MICRO SIGN}m", unit)


def stress_label(document: Document) -> str:
    """Return the stress unit of a result, in brackets; empty without a unit."""
    return in_brackets(document["case"].get("output", {}).get("stress_unit", ""))


def toughness_label(document: Document) -> str:
    """Return the unit of energy release rates, in brackets; empty unless the case labels stresses and lengths."""
    output = document["case"].get("output", {})
    stress, length = output.get("stress_unit", ""), output.get("length_unit", "")
    return in_brackets(f"{stress} {length}") if stress and length else ""


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        name: the head of the column.
        width: characters in text; negative for strings, which are aligned left.
        form: format of numbers in text.
        indent: spaces before left-aligned strings.
    """

    name: str
    width: int = 12
    form: str = ".5g"
    indent: int = 2

    @property
    def head(self) -> str:
        """Return the column head for text tables."""
        return f"{self.name:<{-self.width}}" if self.width < 0 else f"{self.name:>{self.width}}"

    def cell(self, value: Any) -> str:
        """Write a cell as text: strings unchanged, numbers in column format."""
        if self.width < 0:
            return f"{' ' * self.indent + value:<{-self.width}}"
        return f" {number(value, self.form):>{self.width - 1}}"


@dataclass(frozen=True)
class Table:
    """A table of strings and numbers.  Rows are as long as `columns` or shorter.

    Attributes:
        above, below: lines of the text before the heads, and after the rows; notes in HTML.
        title_in_head: in text, the title replaces the head of the first column.
        abreast: rows per line of text, without heads; 0 for one row per line with heads.
        most_columns: largest number of columns after the first; others form blocks below.  Blocks omit rows of UNKNOWN.
    """

    title: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Any]]
    above: Sequence[str] = ()
    below: Sequence[str] = ()
    title_in_head: bool = False
    abreast: int = 0
    most_columns: int = 100

    @property
    def blocks(self) -> list[tuple[Sequence[Column], Sequence[Sequence[Any]]]]:
        """Return the columns and rows of each block, without rows of UNKNOWN."""
        parts = [slice(k, k + self.most_columns) for k in range(1, len(self.columns), self.most_columns)]
        rows = ([[*row[:1], *row[part]] for row in self.rows] for part in parts)
        known = [[row for row in block if set(row[1:]) != {UNKNOWN}] for block in rows]
        return [([self.columns[0], *self.columns[part]], block) for part, block in zip(parts, known, strict=True)]

    @property
    def lines(self) -> list[str]:
        """Return the lines of the table as text."""
        title, blocks = [self.title, *self.above], list[str]()
        for columns, rows in self.blocks:
            head = "".join(column.head for column in columns)
            texts = ["".join(column.cell(v) for column, v in zip(columns, row, strict=False)) for row in rows]
            if self.abreast:
                groups = (texts[k : k + self.abreast] for k in range(0, len(texts), self.abreast))
                blocks += ["  " + "    ".join(group) for group in groups]
            elif self.title_in_head:
                width = -self.columns[0].width
                title, blocks = [], [f"{self.title:<{width}}{head[width:]}", *texts]
            else:
                blocks += [head, *texts]
        return [line.rstrip() for line in (*title, *blocks, *self.below)]

    @property
    def cells(self) -> list[list[str]]:
        """Return the rows as strings for HTML.  Numbers have the column decimals, or seven digits."""
        forms = [column.form if SAME_IN_HTML.fullmatch(column.form) else ".7g" for column in self.columns]

        def cell(value: Any, form: str) -> str:
            value = value if form == ERROR else without_noise(value)  # even small errors stay unchanged
            return number(value, "d" if isinstance(value, int) else form)

        return [[cell(value, form) for value, form in zip(row, forms, strict=False)] for row in self.rows]

    @property
    def html(self) -> str:
        """Return the table as HTML, each block as a separate table."""
        notes = "".join(f"<small>{escape(line)}</small>" for line in (*self.above, *self.below))
        text = f"<table><caption>{escape(self.title)}{notes}</caption>"
        for number, (columns, part) in enumerate(self.blocks):
            head = _row((column.name for column in columns), "col", 'th scope="col"')
            rows = "\n".join(_row(row, "row", "td") for row in replace(self, columns=columns, rows=part).cells)
            text += ("</table>\n<table>" if number else "") + f"<thead>{head}</thead>\n<tbody>\n{rows}\n</tbody>"
        return f"{text}</table>"


def number(value: Any, form: str) -> str:
    """Format a number, without the sign of a rounded zero; strings stay unchanged."""
    if isinstance(value, str):
        return value
    text = format(value, form)
    return text.removeprefix("-") if float(text) == 0.0 else text


def without_noise(value: Any, size: float = 1.0) -> Any:
    """Return zero for a float that is solver noise relative to `size`, else the value unchanged."""
    return 0.0 if isinstance(value, float) and abs(value) <= NOISE * size else value


def _row(cells: Iterable[str], scope: str, tag: str) -> str:
    first, *more = cells
    rest = "".join(f"<{tag}>{escape(cell)}</{tag.partition(' ')[0]}>" for cell in more)
    return f'<tr><th scope="{scope}">{escape(first)}</th>{rest}</tr>'
