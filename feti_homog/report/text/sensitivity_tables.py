"""Derivatives of the constants of a stiffness, and their scatter by uncertain constants of phases, as tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from feti_homog.report.text.stiffness_tables import SHORT, UNKNOWN
from feti_homog.report.text.table import Column, Table, without_noise
from feti_homog.typing import Document

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
    return [Table("Scatter by uncertain constants (std), and their shares of the variance (%)", columns, rows)]


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
