"""Build tables of stiffness, thermal constants, moduli, engineering constants, bounds, estimates and derivatives.

Material axes 1, 2, 3, as in data sheets and cards, are the cell axes x3 (the fibres), x1, x2.
"""

from collections.abc import Mapping, Sequence
from itertools import zip_longest
from math import floor, log10
from typing import Any

import numpy as np

from feti_homog.materials import engineering_constants, voigt
from feti_homog.microstructure import phase_names
from feti_homog.report.text.point_tables import columns_without_noise
from feti_homog.report.text.tables import UNKNOWN, Column, Table, number, stress_label, without_noise
from feti_homog.typing import Document

NAMES = Column("", -28)
STIFF = ("C11", "C22", "C33 (gamma12)")
STRESS_MODULI = ("E1", "E2", "G12", "bulk", "shear")  # in the stress unit; other moduli are ratios
ENGINEERING = ("E1", "E2", "E3", "G12", "G13", "G23", "nu12", "nu13", "nu23")
THERMAL = {
    "thermal_stress": "thermal stress",
    "thermal_stress_compression": "under minus one",
    "thermal_expansion": "thermal expansion",
}
THIS_CELL, ITS_ERROR, LOWER, UPPER = "this cell", "error of its mesh", "lower bound", "upper bound"
MESH_ERROR = "Mesh error,"
PAIRS = 2  # constants per line of text
# Constants whose sensitivities are shown, in the plane and in space; result.json has all.
SHOWN_IN_PLANE = ("C11", "C22", "C12", "C33", "E1", "E2", "nu12", "G12", "k11", "k22", "k33")
SHOWN_IN_SPACE = tuple(name for name in engineering_constants.ABOUT_FIBRES if name != "K_transverse")
MOST = 9  # number of other constants that are shown


def stiffnesses(document: Document) -> list[Table]:
    """Return tables of the effective stiffness and its mesh errors; with contact, also under negative unit strains."""
    titles = {"effective_stiffness": "Effective stiffness", "effective_stiffness_compression": "Under minus E"}
    tables, errors, label = list[Table](), _errors(document), stress_label(document)
    for key, title in titles.items():
        if document.get(key) is not None:
            axes = "" if len(document[key]) == len(voigt.STRAINS) else f", {engineering_constants.CELL_AXES}"
            tables.append(_matrix(f"{title}{axes}{label}", document[key]))
        if errors.get(key) is not None:
            tables.append(_matrix(f"{MESH_ERROR} stiffness{label}", errors[key], ".1e"))
    return tables


def conductivity(document: Document) -> list[Table]:
    """Return tables of the effective conductivity, its mesh errors, and its bounds and estimates."""
    names, k = ("x1", "x2", "x3"), document["effective_conductivity"]
    computed, errors = f"Effective conductivity, {engineering_constants.CELL_AXES}", _errors(document)
    matrices = (computed, k, ".8g"), (f"{MESH_ERROR} conductivity", errors.get("effective_conductivity"), ".1e")
    tables = [
        Table(title, [Column("", -6), *(Column(name, 16, form) for name in names)],
              [[name, *row] for name, row in zip(names, np.array(matrix).tolist(), strict=True)])
        for title, matrix, form in matrices if matrix is not None
    ]  # fmt: skip
    if (forms := document.get("conductivity_estimates")) is not None:
        rows = [["along: mean", UNKNOWN, k[2][2], UNKNOWN, forms["axial"]]]
        for label, key in (("Wiener", "wiener"), ("isotropic Hashin-Shtr.", "hashin_shtrikman")):
            lower, upper = forms.get(key) or (None, None)
            rows += [[f"{name} {label}", lower, k[i][i], upper, UNKNOWN] for i, name in enumerate(names[:2]) if lower]
        if forms.get("maxwell") and not forms.get("hashin_shtrikman"):  # for bonded fibres, one of these bounds
            rows.append(["across: Maxwell", UNKNOWN, (k[0][0] + k[1][1]) / 2, UNKNOWN, forms["maxwell"]])
        columns = [NAMES, *(Column(name, 14, ".7g") for name in ("lower", "computed", "upper", "estimate"))]
        tables.append(Table("Bounds and estimates", columns, rows, title_in_head=True))
    return tables


def _errors(document: Document) -> Document:
    """Return the mesh errors of a result; empty without estimates."""
    estimated: Document = document.get("mesh_error") or {}
    return estimated


def with_errors(title: str, values: Mapping[str, float], errors: Mapping[str, float], abreast: int) -> Table:
    """Return a table of constants and, unless `errors` is empty, of mesh errors, `abreast` per line.

    Errors have two digits, and constants as many decimals as their errors.  Without a visible error, constants have
    seven digits; ratios in tables with `PAIRS` per line have six decimals.
    """
    rows, count = [], 3 if errors else 2  # the third column has the errors
    for name, value in values.items():
        form, error_form = ".6f" if abreast == PAIRS and name not in STRESS_MODULI else ".7g", ".1e"
        error = errors.get(name)
        # Other errors are below the digits printed without them, or their constants have extreme sizes.
        if error is not None and error > 1e-7 * abs(value) and 1e-4 < abs(value) < 1e8:
            form = error_form = f".{max(0, 1 - floor(log10(error)))}f"
        texts = [name, number(value, form), "" if error is None else f"+- {error:{error_form}}"]
        rows.append(texts[:count])
    width = max((len(name) for name in values), default=0) + 2
    columns = [Column("", -width, indent=0), Column("computed", 13), Column("mesh error", -13, indent=1)]
    return Table(title, columns[:count], rows, abreast=abreast)


def _matrix(title: str, rows: Sequence[Sequence[float]], fixed: str = "") -> Table:
    strains, stresses = voigt.voigt_names(len(rows))
    in_plane = len(rows) == len(voigt.STRAINS)
    names, width, digits, limit, short = (NAMES, 16, 8, 1e8, ".7e") if in_plane else (Column("", -6), 12, 7, 1e6, ".4e")
    largest = max(abs(entry) for row in rows for entry in row)
    fits = 10.0 ** (4 - digits) < largest < limit
    form = fixed or (f".{digits - 1 - floor(log10(largest))}f" if fits else short)
    named = [[name, *row] for name, row in zip(stresses, rows, strict=True)]
    return Table(title, [names, *(Column(name, width, form) for name in strains)], named, title_in_head=in_plane)


def thermal(document: Document) -> list[Table]:
    """Return a list with the table of thermal constants; [] without any.  Rows are components, columns quantities."""
    present = {key: title for key, title in THERMAL.items() if document.get(key) is not None}
    columns, entries = [Column("", -6)], [[stress[1:] for stress in voigt.SPATIAL_STRESSES]]
    for key, title in present.items():
        values = np.array(document[key], float)
        columns.append(Column(title, 22, ".7g"))
        entries.append(np.where(np.abs(values) > 10.0**-7 * np.abs(values).max(), values, 0.0).tolist())
        if _errors(document).get(key) is not None:
            columns.append(Column("mesh error", 14, ".1e"))
            entries.append(_errors(document)[key])
    unit = f"; stresses{label}" if (label := stress_label(document)) else ""
    title = f"Per unit of temperature, {engineering_constants.CELL_AXES}{unit}"
    return [Table(title, columns, [*zip(*entries, strict=True)])] if present else []


def moduli(document: Document) -> Table:
    """Return a table of the moduli in the plane, in text two per line: moduli at the left, ratios at the right."""
    values, errors = document["moduli"], _errors(document).get("constants", {})
    sides = [name for name in values if name in STRESS_MODULI], [name for name in values if name not in STRESS_MODULI]
    names = [name for pair in zip_longest(*sides) for name in pair if name is not None]
    title = f"Engineering moduli{stress_label(document)}"
    return with_errors(title, {name: values[name] for name in names}, errors, PAIRS)


def bounds(document: Document) -> Table:
    """Return a table of constants between bounds, with Reuss-Voigt violations marked; without bounds, only a title."""
    if not document.get("bounds"):
        return Table("Bounds: none for cells with voids", [], [])
    limits, computed, rows = document["bounds"], document["effective_stiffness"], []
    for i, name in enumerate(STIFF):
        lower, value, upper = limits["reuss"][i][i], computed[i][i], limits["voigt"][i][i]
        rows.append([f"{name} Reuss, Voigt", lower, value, upper])
        if not max(lower - value, value - upper) <= document.get("check_tolerance", 0.0) * abs(value):
            rows[-1].append("outside")
    # These bounds hold for isotropic cells only, so a value outside is no fault.
    for name, (lower, upper) in (limits["hashin_shtrikman"] or {}).items():
        rows.append([f"{name} Hashin-Shtr.", lower, document["moduli"][name], upper])
    columns = [NAMES, *(Column(name, 14, ".7g") for name in ("lower", "computed", "upper"))]
    columns += [Column("", 9)] if any(len(row) > len(columns) for row in rows) else []
    return Table(f"Bounds{stress_label(document)}", columns, rows, title_in_head=True)


def cell_constants(document: Document) -> list[Table]:
    """Return tables of constants in generalized plane strain; [] without constants.

    Constants about the fibre axis appear with estimates and bounds.
    """
    tables, values = list[Table](), document.get("constants")
    errors, label = _errors(document).get("constants", {}), stress_label(document)
    if values is not None:
        title = f"Engineering constants, {engineering_constants.CELL_AXES}{label}"
        tables.append(with_errors(title, {name: values[name] for name in ENGINEERING if name in values}, errors, 3))
    if (cell := document.get("transversely_isotropic")) is None:
        return tables
    # A row for each source, a column for each constant known to at least one source.
    limits, estimates = _known(document.get("fibre_bounds") or {}), document.get("estimates")
    sources: dict[str, Document] = {THIS_CELL: cell, ITS_ERROR: errors}
    sources |= {name.replace("_", " "): row for name, row in (estimates or {}).items()}
    sources |= {name: {key: limits[key][k] for key in limits} for k, name in enumerate((LOWER, UPPER))}
    about = engineering_constants.ABOUT_FIBRES
    numbers = {title: _known({name: row.get(name) for name in about}) for title, row in sources.items()}
    names = [name for name in about if any(name in row for row in numbers.values())]
    rows = [
        [title, *(_short(row.get(name), ".1e" if title == ITS_ERROR else ".5g") for name in names)]
        for title, row in numbers.items()
        if row
    ]
    columns = [Column("", -22), *(Column(name, max(13, len(name) + 2)) for name in names)]
    below = [f"  {UNKNOWN}: not available from this method"] if any(UNKNOWN in row for row in rows) else []
    if estimates is None:
        below.append(f"  closed-form estimates exist for {_with_estimates(document)} only")
    title = f"Along the fibres and across them{label}; {100 * cell['deviation']:.2g} % from transversely isotropic"
    above = [f"  over all directions across: {ranges}"] if (ranges := ranges_across(document)) else []
    return [*tables, Table(title, columns, rows, above, below, most_columns=5)]


def ranges_across(document: Document) -> str:
    """Return, as text, the ranges of Young's (E) and shear modulus (G) over directions across the fibres, or ""."""
    across = document.get("transverse_moduli") or {}
    ranges = (f"{n} from {_short(across[f'{n}_least'])} to {_short(across[f'{n}_largest'])}" for n in ("E", "G"))
    return ", ".join(ranges) if across else ""


def _with_estimates(document: Document) -> str:
    """Name the composites that have estimates, by a property that this cell lacks, as in "cells without voids"."""
    case, cell = document.get("case", {}), document.get("cell", {})
    if len(cell.get("fractions", ())) == 1:
        return "composites"
    if cell.get("porosity"):
        return "cells without voids"
    if phase_names.COATING in case.get("material", {}):
        return "fibres without coatings"
    return "round fibres that are bonded, all alike" if case.get("interface") else "round fibres"


def _known(row: Document) -> dict[str, Any]:
    return {name: value for name, value in row.items() if value is not None}


def _short(value: float | None, form: str = ".5g") -> str:
    return UNKNOWN if value is None else f"{value:{form}}"


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
    """Rename constants from cell axes to material axes.  Normal expansions keep their names; others are dropped."""
    places = {name: engineering_constants.OF_THE_CELL[name] for name in ENGINEERING}
    places |= {name: name for name in engineering_constants.MATERIAL_EXPANSIONS[:3]}
    return {name: numbers[constant] for name, constant in places.items() if constant in numbers}


def table(document: Document) -> Table:
    """Return the table of constants in material axes, with mesh errors."""
    errors = in_material_axes(mesh_errors(document))
    title = f"{engineering_constants.MATERIAL_AXES}{stress_label(document)}{'; +- error of the mesh' if errors else ''}"
    computed = constants(document)
    return with_errors(title, {name: computed[name] for name in ENGINEERING if name in computed}, errors, 3)


def sensitivities(document: Document) -> list[Table]:
    """Return tables of d ln c / d ln p and dc / dp for constants c (columns) and parameters p (rows), or []."""
    if (section := document.get("sensitivities")) is None:
        return []
    constants, width = section["constants"], max(map(len, section["parameters"]), default=0) + 4
    at = [constants.index(name) for name in shown(constants)]
    exact = dict(zip(constants, section["constant_values"], strict=True))
    if (point := document.get("load")) is not None:  # components that are zero by symmetry have no elasticity
        for components, key in zip(voigt.voigt_names(len(point["strain"])), ("strain", "stress"), strict=True):
            exact |= zip(components, columns_without_noise([point[key]])[0].tolist(), strict=True)
    values, slopes, shares = [exact[constants[k]] for k in at], list[list[Any]](), list[list[Any]]()
    for j, (name, parameter) in enumerate(zip(section["parameters"], section["parameter_values"], strict=True)):
        row = [section["derivatives"][k][j] for k in at]
        changes = [without_noise(slope * parameter / c) if c else UNKNOWN for slope, c in zip(row, values, strict=True)]
        is_zero = [parameter and not change for change in changes]
        slopes.append([name, *(f"{0.0 if zero else slope:.3g}" for slope, zero in zip(row, is_zero, strict=True))])
        shares.append([name, *changes])
    text = "Elasticities, the relative change of a constant by that of a parameter"
    text += "; contact at fixed status" if section.get("at_fixed_status") else ""
    names = [STIFF[2] if constants[k] == "C33" and "C66" not in constants else constants[k] for k in at]
    heads = [(name, max(12, len(name) + 2)) for name in names]
    return [
        Table(title, [Column("", -width), *(Column(*head, form) for head in heads)], rows)
        for title, form, rows in ((text, ".4f", shares), ("Derivatives by the same parameters", ".3g", slopes))
    ]


def mesh_errors(document: Document) -> dict[str, float]:
    """Return estimated mesh errors by name: constants, C11, ..., k11, ..., and normal expansions."""
    numbers = _errors(document)
    tensors = {"C": numbers.get("effective_stiffness"), "k": numbers.get("effective_conductivity")}
    strains = dict(zip(voigt.EXPANSIONS[:3], map(float, numbers.get("thermal_expansion", ())), strict=False))
    named = {
        f"{symbol}{i + 1}{j + 1}": float(error)
        for symbol, tensor in tensors.items()
        for (i, j), error in np.ndenumerate([] if tensor is None else tensor)
    }
    return named | {**numbers.get("constants", {})} | strains


def shown(names: Sequence[str]) -> list[str]:
    """Select names for tables: of SHOWN_* if E1 or k11 is among them, else MOST at most, off-diagonal entries last."""
    if {"E1", "k11"} & {*names}:
        return [name for name in (SHOWN_IN_SPACE if "E3" in names else SHOWN_IN_PLANE) if name in names]
    return sorted(names, key=lambda name: name.startswith("C") and name[1] != name[2])[:MOST]
