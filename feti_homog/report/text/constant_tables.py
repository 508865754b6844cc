"""Constants in the axes of the material, and derivatives and scatter of constants, as tables.

Axes 1, 2, 3 of the material, as data sheets and cards have them, are x3, along the fibres, x1, x2 of the cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from feti_homog.report.text.stiffness_tables import SHORT, UNKNOWN, abreast, with_errors
from feti_homog.report.text.table import Column, Table, in_brackets, without_noise
from feti_homog.typing import Document

TITLE = "Material axes: 1 along the fibres (x3 of the cell), 2 and 3 across (x1, x2)"
# The constants of the cell with the same value, those that only estimates of errors have, and the axes of the cell in
# whose order thermal expansions are.
IN_THE_CELL = {"E1": "E3", "E2": "E1", "E3": "E2", "G12": "G13", "G13": "G23", "G23": "G12", "nu23": "nu12"}
RATIOS = {"nu12": "nu31", "nu13": "nu32"}
ROWS = (("E1", "E2", "E3"), ("G12", "G13", "G23"), ("nu12", "nu13", "nu23"), ("alpha1", "alpha2", "alpha3"))
EXPANSIONS = {"alpha1": 2, "alpha2": 0, "alpha3": 1}


def constants(document: Document) -> dict[str, float]:
    """Return the constants, in the order of ROWS, those that follow from what the result has.

    nu_ij = -eps_j / eps_i under stress along i: nu12 = nu13' E3' / E1' of those with a dash, in the axes of the cell.
    """
    cell, expansion = document.get("constants") or {}, document.get("thermal_expansion")
    found = {name: cell[own] for name, own in IN_THE_CELL.items() if own in cell}
    for name, ratio, across in (("nu12", "nu13", "E1"), ("nu13", "nu23", "E2")):
        if {ratio, across, "E3"} <= cell.keys():
            found[name] = cell[ratio] * cell["E3"] / cell[across]
    if cell and expansion is not None:
        found |= {name: float(expansion[place]) for name, place in EXPANSIONS.items()}
    return _in_rows(found)


def errors(document: Document) -> dict[str, float]:
    """Return the estimated errors of the constants by the mesh, of those that the result has."""
    known: Document = document.get("mesh_error") or {}
    of_constants, of_expansion = known.get("constants", {}), known.get("thermal_expansion")
    places = (IN_THE_CELL | RATIOS).items()
    found = {name: float(of_constants[own]) for name, own in places if own in of_constants}
    if of_expansion is not None:
        found |= {name: float(of_expansion[place]) for name, place in EXPANSIONS.items()}
    return _in_rows(found)


def scatter(document: Document) -> dict[str, float]:
    """Return the standard deviations of the constants by uncertain constants of the case, of those that are known."""
    known = standard_deviations(document)
    places = IN_THE_CELL | {name: f"expansion.{place + 1}" for name, place in EXPANSIONS.items()}
    found = {name: known[own] for name, own in places.items() if own in known}
    return _in_rows(found)


def _in_rows(found: dict[str, float]) -> dict[str, float]:
    """Return the numbers in the order of ROWS."""
    return {name: found[name] for names in ROWS for name in names if name in found}


def standard_deviations(document: Document) -> dict[str, float]:
    """Return those of all constants of the cell, in its axes, that uncertain constants of the case cause."""
    known = document.get("uncertainty") or {"constants": (), "std": ()}
    return dict(zip(known["constants"], map(float, known["std"]), strict=True))


def table(document: Document, label: str) -> list[Table]:
    """Return the constants as a table; `label` is the unit of stresses in brackets, or empty."""
    found = constants(document)
    return [with_errors(f"{TITLE}{label}", found, errors(document))] if found else []


def lines(document: Document, label: str) -> list[str]:
    """Return the same as text, with the estimated errors of the mesh."""
    found, off = constants(document), errors(document)
    title = f"{TITLE}{label}{'; +- error of the mesh' if off else ''}"
    return [title, *abreast(ROWS, found, off, width=6)] if found else []


# Constants of which sensitivities are shown, by whether the cell is in space; all are in result.json.
SHOWN = {
    False: ("C11", "C22", "C12", "C33", "E1", "E2", "nu12", "G12"),
    True: ("E_axial", "E_transverse", "nu_axial", "nu_transverse", "G_axial", "G_transverse", "expansion.3",
           "expansion.1"),
}  # fmt: skip
# Of expansions in the axes of the cell, x3 along the fibres.
SHORT_NAMES = SHORT | {"expansion.3": "exp. axial", "expansion.1": "exp. x1"}
MOST = 9  # of other constants


def sensitivities(document: Document) -> list[Table]:
    """Elasticities d ln c / d ln p of constants c by parameters p, and derivatives dc / dp; none if not asked for."""
    if (found := document.get("sensitivities")) is None:
        return []
    constants, width = found["constants"], max(map(len, found["parameters"]), default=0) + 4
    at = [constants.index(name) for name in shown(constants)]
    slopes, shares = list[list[Any]](), list[list[Any]]()
    for j, (name, value) in enumerate(zip(found["parameters"], found["parameter_values"], strict=True)):
        row = [found["derivatives"][k][j] for k in at]
        slopes.append([name, *row])
        shares.append(
            [name, *(_share(slope * value, found["constant_values"][k]) for slope, k in zip(row, at, strict=True))]
        )
    words = "Elasticities, the relative change of a constant by that of a parameter"
    words += "; contact at fixed status" * bool(found.get("at_fixed_status"))
    names = [SHORT_NAMES.get(constants[k], constants[k]) for k in at]
    return [
        Table(title, [Column("", -width), *(Column(name, 12, form) for name in names)], rows)
        for title, form, rows in ((words, ".4f", shares), ("Derivatives by the same parameters", ".3g", slopes))
    ]


def uncertainty(document: Document) -> list[Table]:
    """Constants with their scatter by phases and error of the mesh, and shares of uncertain constants; none without."""
    if (found := document.get("uncertainty")) is None:
        return []
    names, values = found["constants"], document["sensitivities"]["constant_values"]
    errors = mesh_errors(document)
    inputs = [name.removeprefix("material.") for name in found["parameters"]]
    columns = [Column("", -16), Column("value"), Column("+- phases"), Column("+- mesh")]
    columns += [Column(name, max(12, len(name) + 2), ".1f") for name in inputs]
    rows = [
        [
            SHORT_NAMES.get(name, name),
            values[k],
            found["std"][k],
            errors.get(name, UNKNOWN),
            *(100 * share for share in found["shares"][k]),
        ]
        for k, name in ((names.index(name), name) for name in shown(names))
        if found["std"][k] > 0
    ]
    label = in_brackets(document["case"].get("output", {}).get("stress_unit", ""))
    return [Table(f"Scatter by uncertain constants{label}: std, and their shares of the variance (%)", columns, rows)]


def mesh_errors(document: Document) -> dict[str, float]:
    """Return the estimated errors of constants by the mesh, of entries and expansions by their places, too."""
    known: Document = document.get("mesh_error") or {}
    entries = np.ndenumerate(np.array(known.get("effective_stiffness", [])))
    along = enumerate(known.get("thermal_expansion", ()))
    named = {f"C{i + 1}{j + 1}": float(error) for (i, j), error in entries}
    return named | {**known.get("constants", {})} | {f"expansion.{k + 1}": float(error) for k, error in along}


def shown(names: Sequence[str]) -> list[str]:
    """Return the constants of tables; of a load, and of secants of a cell in space, the first ones."""
    return [name for name in SHOWN["E3" in names] if name in names] if "E1" in names else list(names[:MOST])


def _share(change: float, size: float) -> float | str:
    """Return a relative change, zero in place of noise; text of a constant that is zero."""
    return without_noise(change / size) if size else UNKNOWN
