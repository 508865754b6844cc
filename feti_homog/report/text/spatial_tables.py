"""The answer of generalized plane strain as blocks of lines for the printed summary: stiffness and thermal numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import floor, log10
from typing import Any

from feti_homog.materials.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES

NAME, COLUMN, DIGITS = 6, 12, 7  # columns of the names and of each number; digits of the largest of a matrix
THERMAL = {
    "thermal_stress": "stress at no strain",
    "thermal_stress_compression": "under minus one",
    "thermal_expansion": "strain at no stress",
}

Document = Mapping[str, Any]


def spatial_blocks(document: Document, unit: str) -> list[list[str]]:
    """Stiffness (6, 6), also under minus the unit strains, and what a unit of temperature does; `unit` is that of
    stresses in brackets, or empty."""
    titles = {"effective_stiffness": "Effective stiffness", "effective_stiffness_compression": "Under minus E"}
    matrices = [_matrix(f"{words}{unit}", document[key]) for key, words in titles.items() if key in document]
    return [*matrices, _thermal(document, unit)]


def _matrix(title: str, rows: Sequence[Sequence[float]]) -> list[str]:
    """All entries to the digit that is the last of the largest."""
    largest = max(abs(entry) for row in rows for entry in row)
    form = f".{DIGITS - 1 - floor(log10(largest))}f" if 1e-3 < largest < 1e6 else f".{DIGITS - 3}e"
    lines = [title, " " * NAME + "".join(f"{name:>{COLUMN}}" for name in SPATIAL_STRAINS)]
    for name, row in zip(SPATIAL_STRESSES, rows, strict=True):
        numbers = "".join(f"{_signless(number, form):>{COLUMN}}" for number in row)
        lines.append(f"  {name:<{NAME - 2}}{numbers}")
    return lines


def _thermal(document: Document, unit: str) -> list[str]:
    """A row for each component, a column for each of what is known."""
    known = {key: words for key, words in THERMAL.items() if document.get(key) is not None}
    if not known:
        return []
    lines = [f"Per unit of temperature{unit}", " " * NAME + "".join(f"{words:>22}" for words in known.values())]
    columns = [_rounded(document[key]) for key in known]
    for strain, *numbers in zip(SPATIAL_STRESSES, *columns, strict=True):
        lines.append(f"  {strain[1:]:<{NAME - 2}}" + "".join(f"{number:>22.7g}" for number in numbers))
    return lines


def _rounded(numbers: Sequence[float]) -> list[float]:
    """Zero in place of numbers that are less than the last digit of the largest."""
    least = 10.0**-DIGITS * max(map(abs, numbers))
    return [0.0 if abs(number) <= least else number for number in numbers]


def _signless(value: float, form: str) -> str:
    """The number, without the sign of a zero that it is rounded to."""
    text = f"{value:{form}}"
    return text.removeprefix("-") if float(text) == 0.0 else text
