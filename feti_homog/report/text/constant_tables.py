"""Constants in the axes of the material, and derivatives of constants, as tables.

Material axes 1, 2, 3, as in data sheets and cards, are the cell axes x3 (the fibres), x1, x2.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.materials import engineering_constants, voigt
from feti_homog.report.text.stiffness_tables import ENGINEERING, with_errors
from feti_homog.report.text.tables import UNKNOWN, Column, Table, stress_label, without_noise
from feti_homog.typing import Document


def constants(document: Document) -> dict[str, float]:
    """Return the constants in material axes that a result determines, in the order of ENGINEERING.

    nu_ij = -eps_j / eps_i under stress along i: nu12 = nu13' E3' / E1' with primed constants in cell axes.
    """
    cell: dict[str, float] = dict(document.get("constants") or {})
    for name, ratio, across in (("nu31", "nu13", "E1"), ("nu32", "nu23", "E2")):
        if {ratio, across, "E3"} <= cell.keys():
            cell[name] = cell[ratio] * cell["E3"] / cell[across]
    return in_material_axes(cell)


def in_material_axes(numbers: Mapping[str, float]) -> dict[str, float]:
    """Rename numbers from cell axes to material axes; expansions keep their names."""
    places = {name: engineering_constants.OF_THE_CELL[name] for name in ENGINEERING}
    places |= {name: name for name in engineering_constants.MATERIAL_EXPANSIONS[:3]}
    return {name: numbers[constant] for name, constant in places.items() if constant in numbers}


def table(document: Document) -> Table:
    """Return the table of constants in material axes, with mesh errors."""
    errors = in_material_axes(mesh_errors(document))
    title = f"{engineering_constants.MATERIAL_AXES}{stress_label(document)}{'; +- error of the mesh' if errors else ''}"
    computed = constants(document)
    return with_errors(title, {name: computed[name] for name in ENGINEERING if name in computed}, errors, 3)


# Constants of which sensitivities are shown, by whether the cell is in space; all are in result.json.
SHOWN = {
    False: ("C11", "C22", "C12", "C33", "E1", "E2", "nu12", "G12", "k11", "k22", "k33"),
    True: tuple(name for name in engineering_constants.ABOUT_FIBRES if name != "K_transverse"),
}
MOST = 9  # of other constants


def sensitivities(document: Document) -> list[Table]:
    """Return tables of elasticities d ln c / d ln p and derivatives dc / dp; none without sensitivities."""
    if (section := document.get("sensitivities")) is None:
        return []
    constants, width = section["constants"], max(map(len, section["parameters"]), default=0) + 4
    at = [constants.index(name) for name in shown(constants)]
    values, slopes, shares = [section["constant_values"][k] for k in at], list[list[Any]](), list[list[Any]]()
    for j, (name, number) in enumerate(zip(section["parameters"], section["parameter_values"], strict=True)):
        row = [section["derivatives"][k][j] for k in at]
        pairs = zip(row, values, strict=True)
        slopes.append([name, *row])
        shares.append([name, *(without_noise(slope * number / c) if c else UNKNOWN for slope, c in pairs)])
    text = "Elasticities, the relative change of a constant by that of a parameter"
    text += "; contact at fixed status" * bool(section.get("at_fixed_status"))
    heads = [(constants[k], max(12, len(constants[k]) + 2)) for k in at]
    return [
        Table(title, [Column("", -width), *(Column(*head, form) for head in heads)], rows)
        for title, form, rows in ((text, ".4f", shares), ("Derivatives by the same parameters", ".3g", slopes))
    ]


def mesh_errors(document: Document) -> dict[str, float]:
    """Return estimated mesh errors of constants, stiffness (C11, ...) and conductivity (k11, ...), by name."""
    numbers: Document = document.get("mesh_error") or {}
    tensors = {"C": numbers.get("effective_stiffness"), "k": numbers.get("effective_conductivity")}
    strains = dict(zip(voigt.EXPANSIONS[:3], map(float, numbers.get("thermal_expansion", ())), strict=False))
    named = {
        f"{symbol}{i + 1}{j + 1}": float(error)
        for symbol, tensor in tensors.items()
        for (i, j), error in np.ndenumerate([] if tensor is None else tensor)
    }
    return named | {**numbers.get("constants", {})} | strains


def shown(names: Sequence[str]) -> list[str]:
    """Return the constants that tables show; the first MOST for a load or secants in space."""
    return [name for name in SHOWN["E3" in names] if name in names] if {"E1", "k11"} & {*names} else list(names[:MOST])
