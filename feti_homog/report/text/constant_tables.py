"""Constants in the axes of the material, and derivatives of constants, as tables.

Axes 1, 2, 3 of the material, as data sheets and cards have them, are x3, along the fibres, x1, x2 of the cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.materials.constant_names import (
    ABOUT_FIBRES,
    MATERIAL_AXES,
    MATERIAL_EXPANSIONS,
    OF_THE_CELL,
)
from feti_homog.materials.voigt import EXPANSIONS
from feti_homog.report.text.stiffness_tables import UNKNOWN, abreast, with_errors
from feti_homog.report.text.table import Column, Table, without_noise
from feti_homog.typing import Document

ROWS = (("E1", "E2", "E3"), ("G12", "G13", "G23"), ("nu12", "nu13", "nu23"))


def constants(document: Document) -> dict[str, float]:
    """Return the constants in material axes, in the order of ROWS, those that follow from what the result has.

    nu_ij = -eps_j / eps_i under stress along i: nu12 = nu13' E3' / E1' of those with a dash, in the axes of the cell.
    """
    cell: dict[str, float] = dict(document.get("constants") or {})
    for name, ratio, across in (("nu31", "nu13", "E1"), ("nu32", "nu23", "E2")):
        if {ratio, across, "E3"} <= cell.keys():
            cell[name] = cell[ratio] * cell["E3"] / cell[across]
    return in_material_axes(cell)


def in_material_axes(known: Mapping[str, float]) -> dict[str, float]:
    """Return numbers of constants of the cell by their names in material axes, in which expansions keep theirs."""
    places = {name: OF_THE_CELL[name] for names in ROWS for name in names}
    places |= {name: name for name in MATERIAL_EXPANSIONS[:3]}
    return {name: known[own] for name, own in places.items() if own in known}


def table(document: Document, label: str) -> list[Table]:
    """Return the constants as a table; `label` is the unit of stresses in brackets, or empty."""
    found, off = constants(document), in_material_axes(mesh_errors(document))
    return [with_errors(f"{MATERIAL_AXES}{label}", found, off)] if found else []


def lines(document: Document, label: str) -> list[str]:
    """Return the same as text, with the estimated errors of the mesh."""
    found, off = constants(document), in_material_axes(mesh_errors(document))
    title = f"{MATERIAL_AXES}{label}{'; +- error of the mesh' if off else ''}"
    return [title, *abreast(ROWS, found, off, width=6)] if found else []


# Constants of which sensitivities are shown, by whether the cell is in space; all are in result.json.
SHOWN = {
    False: ("C11", "C22", "C12", "C33", "E1", "E2", "nu12", "G12"),
    True: tuple(name for name in ABOUT_FIBRES if name != "K_transverse"),
}
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
    heads = [(constants[k], max(12, len(constants[k]) + 2)) for k in at]
    return [
        Table(title, [Column("", -width), *(Column(*head, form) for head in heads)], rows)
        for title, form, rows in ((words, ".4f", shares), ("Derivatives by the same parameters", ".3g", slopes))
    ]


def mesh_errors(document: Document) -> dict[str, float]:
    """Return the estimated errors of constants by the mesh, of entries and expansions by their places, too."""
    known: Document = document.get("mesh_error") or {}
    entries = np.ndenumerate(np.array(known.get("effective_stiffness", [])))
    strains = dict(zip(EXPANSIONS[:3], map(float, known.get("thermal_expansion", ())), strict=False))
    named = {f"C{i + 1}{j + 1}": float(error) for (i, j), error in entries}
    return named | {**known.get("constants", {})} | strains


def shown(names: Sequence[str]) -> list[str]:
    """Return the constants of tables; of a load, and of secants of a cell in space, the first ones."""
    return [name for name in SHOWN["E3" in names] if name in names] if "E1" in names else list(names[:MOST])


def _share(change: float, size: float) -> float | str:
    """Return a relative change, zero in place of noise; text of a constant that is zero."""
    return without_noise(change / size) if size else UNKNOWN
