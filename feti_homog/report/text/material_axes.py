"""Engineering constants in the axes of the material, as data sheets and cards have them: 1 is along the fibres.

Axes 1, 2, 3 of the material are x3, x1, x2 of the cell.
"""

from __future__ import annotations

from feti_homog.report.text.stiffness_tables import abreast, with_errors
from feti_homog.report.text.table import Table
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
