"""Constants of a material in space, and what closed estimates say of them, as blocks of lines for the summary."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from feti_homog.case.phase_names import COATING

NAME, COLUMN, ABREAST = 22, 12, 5  # columns of the names and of each number; constants beside each other
THIS_CELL, LOWER, UPPER, UNKNOWN = "this cell", "lower bound", "upper bound", "-"
SHORT = {
    "E_axial": "E axial",
    "E_transverse": "E transv.",
    "nu_axial": "nu axial",
    "nu_transverse": "nu transv.",
    "G_axial": "G axial",
    "G_transverse": "G transv.",
    "K_transverse": "K transv.",
    "expansion_axial": "exp. axial",
    "expansion_transverse": "exp. transv.",
}
Document = Mapping[str, Any]


def constants_blocks(document: Document, unit: str) -> list[list[str]]:
    """Engineering constants in the axes of the cell; those of the nearest transversely isotropic material beside
    estimates and bounds; `unit` is that of stresses in brackets, or empty.  Nothing where they are not told."""
    return [_constants(document.get("constants"), unit), _estimates(document, unit)]


def _constants(constants: Document | None, unit: str) -> list[str]:
    if constants is None:
        return []
    lines = [f"Engineering constants in the axes of the cell{unit}"]
    for names in (("E1", "E2", "E3"), ("G12", "G13", "G23"), ("nu12", "nu13", "nu23")):
        lines.append("  " + "    ".join(f"{name:<5}{constants[name]:>13.7g}" for name in names))
    return lines


def _estimates(document: Document, unit: str) -> list[str]:
    """A row for each source that tells a constant, a column for each constant that one of them tells; of many constants
    one table below the other."""
    cell = document.get("transversely_isotropic")
    if cell is None:
        return []
    names, rows = comparison(document)
    lines = [f"Along the fibres and across them{unit}; {100 * cell['deviation']:.2g} % from transversely isotropic"]
    if (across := document.get("transverse_moduli")) is not None:
        lines.append(f"  over all directions across: {_range('E', across)}, {_range('G', across)}")
    for first in range(0, len(names), ABREAST):
        part = slice(first, first + ABREAST)
        lines.append(" " * NAME + "".join(f"{SHORT[name]:>{COLUMN + 1}}" for name in names[part]))
        told = [(title, numbers[part]) for title, numbers in rows if set(numbers[part]) != {UNKNOWN}]
        for title, numbers in told:
            lines.append(f"  {title:<{NAME - 2}}" + "".join(f"{number:>{COLUMN + 1}}" for number in numbers))
    if any(UNKNOWN in numbers for _, numbers in rows):
        lines.append(f"  {UNKNOWN}: the method, or bounds of fibres of any section, say nothing of it")
    why = _why_no_estimates(document)
    return [*lines, *([f"  no closed estimates, which are of {why}"] if why else [])]


def _why_no_estimates(document: Document) -> str:
    """Of what cells there are estimates, where there are none of this one; empty if there are."""
    case, cell = document.get("case", {}), document.get("cell", {})
    if document.get("estimates") is not None:
        return ""
    if len(cell.get("fractions", ())) == 1:
        return "composites"
    if cell.get("porosity"):
        return "cells without voids"
    if COATING in case.get("material", {}):
        return "fibres without coatings"
    return "round fibres that are bonded, all alike" if case.get("interface") else "round fibres"


def comparison(document: Document) -> tuple[list[str], list[tuple[str, list[str]]]]:
    """The constants that some source tells, and each source with its numbers."""
    rows = {title: _known(row) for title, row in _sources(document).items()}
    names = [name for name in SHORT if any(name in row for row in rows.values())]
    return names, [(title, [_number(row.get(name)) for name in names]) for title, row in rows.items() if row]


def _sources(document: Document) -> dict[str, Document]:
    """The constants of this cell, by each method, and the bounds."""
    bounds = _known(document.get("fibre_bounds") or {})
    sources = {THIS_CELL: document["transversely_isotropic"]}
    sources |= {name.replace("_", " "): row for name, row in (document.get("estimates") or {}).items()}
    return sources | {word: {name: bounds[name][k] for name in bounds} for k, word in enumerate((LOWER, UPPER))}


def _range(modulus: str, across: Document) -> str:
    return f"{modulus} from {_number(across[f'{modulus}_least'])} to {_number(across[f'{modulus}_largest'])}"


def _known(row: Document) -> dict[str, Any]:
    return {name: value for name, value in row.items() if value is not None}


def _number(value: float | None) -> str:
    return UNKNOWN if value is None else f"{value:.5g}"
