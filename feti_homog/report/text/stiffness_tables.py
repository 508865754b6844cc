"""Stiffness, what a unit of temperature does, moduli and constants beside their bounds and estimates, as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from math import floor, log10
from typing import Any

from feti_homog.materials.constants import ABOUT_FIBRES, CELL_AXES
from feti_homog.materials.voigt import SPATIAL_STRESSES, STRAINS, voigt_names
from feti_homog.microstructure.phase_names import COATING
from feti_homog.report.text.table import Column, Table, number, with_unit
from feti_homog.typing import Document

NAMES = Column("", -28)
STIFF = ("C11", "C22", "C33")
STRESS_MODULI = ("E1", "E2", "G12", "bulk", "shear")  # in the unit of the stresses; the others are ratios
ENGINEERING = (("E1", "E2", "E3"), ("G12", "G13", "G23"), ("nu12", "nu13", "nu23"))
THERMAL = {
    "thermal_stress": "thermal stress",
    "thermal_stress_compression": "under minus one",
    "thermal_expansion": "thermal expansion",
}
THERMAL_DIGITS = 7  # below the last of the largest there is zero
THIS_CELL, ITS_ERROR, LOWER, UPPER, UNKNOWN = "this cell", "error of its mesh", "lower bound", "upper bound", "-"
MESH_ERROR = "Mesh error, estimated"
# Of a value by which an error is below the digits that are printed without it.
NO_ERROR = 1e-7
LEAST_DECIMAL, MOST_DECIMAL = 1e-4, 1e8  # numbers between these are printed to the digits of their errors
ABREAST = 5  # constants beside each other in text


def stiffnesses(document: Document, label: str, under_minus: str = "Under minus E") -> list[Table]:
    """L^ef, also under minus the unit strains, to the digit that is the last of its largest entry.

    `label` is the unit of stresses in brackets, or empty.
    """
    titles = {"effective_stiffness": "Effective stiffness", "effective_stiffness_compression": under_minus}
    found, errors = list[Table](), _errors(document)
    for key, title in titles.items():
        if document.get(key) is not None:
            axes = "" if len(document[key]) == len(STRAINS) else f", {CELL_AXES}"
            found.append(_matrix(f"{title}{axes}{label}", document[key]))
        if errors.get(key) is not None:
            found.append(_matrix(f"{MESH_ERROR}{label}", errors[key], ".1e"))
    return found


def _errors(document: Document) -> Document:
    """Return the estimated errors of the mesh, empty of a result without."""
    found: Document = document.get("mesh_error") or {}
    return found


def value_and_error(value: float, error: float | None, form: str) -> tuple[str, str]:
    """Return a constant and its error.

    The error has two digits, which give the number of those of the constant; in this format and empty without an error.
    """
    if error is None:
        return number(value, form), ""
    if not error > NO_ERROR * abs(value) or not LEAST_DECIMAL < abs(value) < MOST_DECIMAL:
        return number(value, form), f"{error:.1e}"
    decimals = max(0, 1 - floor(log10(error)))
    return f"{value:.{decimals}f}", f"{error:.{decimals}f}"


def with_errors(title: str, values: Mapping[str, float], errors: Mapping[str, float], unit: str = "") -> Table:
    """Return constants, stresses among them with their unit, and a column of errors, if any is known."""
    rows = [
        [with_unit(name, unit), *(text for text in value_and_error(value, errors.get(name), ".7g") if text)]
        for name, value in values.items()
    ]
    return Table(title, [NAMES, Column("computed"), *([Column("mesh error", 12, ".1e")] if errors else [])], rows)


def abreast(
    rows: Sequence[Sequence[str]], values: Mapping[str, float], errors: Mapping[str, float], width: int
) -> list[str]:
    """Return lines of those constants of each row that are known, with their errors; names take so many columns."""
    words = {}
    for name, computed in values.items():
        value, error = value_and_error(computed, errors.get(name), ".7g")
        words[name] = f"{name:<{width}}{value:>13}{_beside(error)}"
    known = ([words[name] for name in names if name in words] for names in rows)
    return [f"  {'    '.join(row)}".rstrip() for row in known if row]


def _beside(error: str) -> str:
    """Return an error as it stands behind its value."""
    return f" +- {error:<9}" if error else ""


def _matrix(title: str, rows: Sequence[Sequence[float]], given: str = "") -> Table:
    strains, stresses = voigt_names(len(rows))
    in_plane = len(rows) == len(STRAINS)
    names, width, digits, most, short = (NAMES, 16, 8, 1e8, ".7e") if in_plane else (Column("", -6), 12, 7, 1e6, ".4e")
    largest = max(abs(entry) for row in rows for entry in row)
    form = f".{digits - 1 - floor(log10(largest))}f" if 10.0 ** (4 - digits) < largest < most else short
    form = given or form
    named = [[name, *row] for name, row in zip(stresses, rows, strict=True)]
    return Table(title, [names, *(Column(name, width, form) for name in strains)], named, title_in_head=in_plane)


def thermal(document: Document, label: str) -> list[Table]:
    """Return the table of thermal constants: a row per component, a column per known quantity."""
    known = {key: title for key, title in THERMAL.items() if document.get(key) is not None}
    names = [stress[1:] for stress in SPATIAL_STRESSES]
    errors = {key: _errors(document)[key] for key in known if _errors(document).get(key) is not None}
    rows = list(zip(names, *(_rounded(document[key]) for key in known), *errors.values(), strict=True))
    columns = [Column("", -6), *(Column(title, 22, ".7g") for title in known.values())]
    columns += [Column(f"{key.rpartition('_')[2]}: error", 18, ".1e") for key in errors]
    return [Table(f"Per unit of temperature, {CELL_AXES}{label}", columns, rows)] if known else []


def _rounded(numbers: Sequence[float]) -> list[float]:
    least = 10.0**-THERMAL_DIGITS * max(map(abs, numbers))
    return [0.0 if abs(entry) <= least else entry for entry in numbers]


def moduli(document: Document, unit: str) -> list[Table]:
    """Engineering moduli of the plane state, each with its unit."""
    values, errors = document.get("moduli") or {}, _errors(document).get("constants", {})
    return [with_errors("Engineering moduli", values, errors, unit)] if values else []


def moduli_lines(document: Document, label: str) -> list[str]:
    """Return the same as text: moduli on the left, ratios on the right."""
    left, right = list[str](), list[str]()
    for name, modulus in document["moduli"].items():
        form, width, column = (".7g", 6, left) if name in STRESS_MODULI else (".6f", 11, right)
        value, error = value_and_error(modulus, _errors(document).get("constants", {}).get(name), form)
        column.append(f"{name:<{width}}{value:>13}{_beside(error)}")
    pairs = zip_longest(left, right, fillvalue="")
    return [f"Engineering moduli{label}", *(f"  {modulus:<34}{ratio}".rstrip() for modulus, ratio in pairs)]


def bounds(document: Document, label: str) -> list[Table]:
    """Lower bound, computed value and upper bound; those outside are marked."""
    if not document.get("bounds"):
        return []
    found, here, rows = document["bounds"], document["effective_stiffness"], []
    for i, name in enumerate(STIFF):
        lower, value, upper = found["reuss"][i][i], here[i][i], found["voigt"][i][i]
        inside = lower - 1e-9 * abs(lower) <= value <= upper + 1e-9 * abs(upper)
        rows.append([f"{name} Reuss, Voigt", lower, value, upper, *([] if inside else ["outside"])])
    # These hold for isotropic cells only, so a value outside is no fault.
    for name, (lower, upper) in (found["hashin_shtrikman"] or {}).items():
        rows.append([f"{name} Hashin-Shtr.", lower, document["moduli"][name], upper])
    columns = [NAMES, *(Column(name, 14, ".7g") for name in ("lower", "computed", "upper"))]
    columns += [Column("", 9)] if any(len(row) > len(columns) for row in rows) else []
    return [Table(f"Bounds{label}", columns, rows, title_in_head=True)]


def constants(document: Document, label: str) -> list[Table]:
    """Engineering constants in space, their range across the fibres, and closed estimates and bounds beside them."""
    found, errors = list[Table](), _errors(document).get("constants", {})
    if (values := document.get("constants")) is not None:
        found.append(with_errors(f"Engineering constants, {CELL_AXES}{label}", values, errors))
    if (across := document.get("transverse_moduli")) is not None:
        ends = ("least", "largest")
        rows = [[name, *(across[f"{name}_{end}"] for end in ends)] for name in ("E", "G")]
        title = f"Over all directions across the fibres{label}"
        found.append(Table(title, [NAMES, *map(Column, ends)], rows))
    return [*found, *estimates(document, label)]


def constants_lines(document: Document, label: str) -> list[list[str]]:
    """Return the same as blocks of text; empty blocks where nothing is known."""
    values, block = document.get("constants"), list[str]()
    if values is not None:
        rows = abreast(ENGINEERING, values, _errors(document).get("constants", {}), width=5)
        block = [f"Engineering constants, {CELL_AXES}{label}", *rows]
    return [block, *(_estimates_lines(document, table) for table in estimates(document, label))]


def estimates(document: Document, label: str) -> list[Table]:
    """Constants along the fibres and across them.

    A row for each source that has one, a column for each constant that some source has.
    """
    if document.get("transversely_isotropic") is None:
        return []
    rows = {title: _known(row) for title, row in _sources(document).items()}
    names = [name for name in ABOUT_FIBRES if any(name in row for row in rows.values())]
    forms = {ITS_ERROR: ".1e"}
    cells = [
        [title, *(_short(row.get(name), forms.get(title, ".5g")) for name in names)]
        for title, row in rows.items()
        if row
    ]
    columns = [Column("", -22), *(Column(name, max(13, len(name) + 2)) for name in names)]
    return [Table(f"Along the fibres and across them{label}", columns, cells)]


def _sources(document: Document) -> dict[str, Document]:
    """Return the constants of this cell, by each method, and the bounds."""
    limits = _known(document.get("fibre_bounds") or {})
    errors, sources = _errors(document).get("constants", {}), {THIS_CELL: document["transversely_isotropic"]}
    sources |= {ITS_ERROR: {name: errors[name] for name in ABOUT_FIBRES if name in errors}} if errors else {}
    sources |= {name.replace("_", " "): row for name, row in (document.get("estimates") or {}).items()}
    return sources | {name: {key: limits[key][k] for key in limits} for k, name in enumerate((LOWER, UPPER))}


def _estimates_lines(document: Document, table: Table) -> list[str]:
    """Return a few constants beside each other, the others below them."""
    cell, across = document["transversely_isotropic"], document.get("transverse_moduli")
    lines = [f"{table.title}; {100 * cell['deviation']:.2g} % from transversely isotropic"]
    if across is not None:
        ranges = (f"{n} from {_short(across[f'{n}_least'])} to {_short(across[f'{n}_largest'])}" for n in ("E", "G"))
        lines.append(f"  over all directions across: {', '.join(ranges)}")
    for first in range(1, len(table.columns), ABREAST):
        part = [0, *range(first, min(first + ABREAST, len(table.columns)))]
        rows = [[row[k] for k in part] for row in table.rows]
        known = [row for row in rows if set(row[1:]) != {UNKNOWN}]
        lines += replace(table, columns=[table.columns[k] for k in part], rows=known).lines[1:]
    if any(UNKNOWN in row for row in table.rows):
        lines.append(f"  {UNKNOWN}: not available from this method")
    why = _why_no_estimates(document)
    return [*lines, *([f"  no closed estimates, which are of {why}"] if why else [])]


def _why_no_estimates(document: Document) -> str:
    """Return the cells of which there are estimates, where there are none of this one; empty if there are."""
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


def _known(row: Document) -> dict[str, Any]:
    return {name: value for name, value in row.items() if value is not None}


def _short(value: float | None, form: str = ".5g") -> str:
    return UNKNOWN if value is None else f"{value:{form}}"
