"""`feti-homog export`: write the material card of a result folder, for another program or as a table.

Abaqus Keywords Guide, *ELASTIC and *EXPANSION: engineering constants are E1, E2, E3, nu12, nu13, nu23, G12, G13 and, on
the next line, G23, where nu_ij is the strain along j under stress along i; TYPE=ANISOTROPIC takes the 21 entries
D_ijkl of `ABAQUS_ENTRIES`, eight to a line.  TYPE=ANISO takes alpha11, alpha22, alpha33, alpha12, alpha13, alpha23,
thermal strains per unit of temperature as Abaqus stores strains: with engineering shears (Conventions).

CalculiX CrunchiX user's manual, *ELASTIC and *EXPANSION; fields of 20 characters are read.  Its alpha12, alpha13,
alpha23 are the tensor's shears, half the engineering shears.

ANSYS Material Reference, linear elasticity: PRXY, PRYZ, PRXZ are the major Poisson's ratios, PRXY = -eps_y/eps_x under
stress along x; TB,ANEL takes the lower triangle of the stiffness (TBOPT = 0) by columns, in the order [x, y, z, xy, yz,
xz] with engineering shears.  ALPX, ALPY, ALPZ are secant coefficients; shears have none.

MOOSE: ComputeElasticityTensor takes C_ijkl: for `symmetric9` in the order 1111 1122 1133 2222 2233 3333 2323 1313 1212,
for `symmetric21` the upper triangle by rows in the order [11, 22, 33, 23, 13, 12].  ComputeEigenstrain takes the
components 11, 22, 33, 23, 13, 12 of a tensor, with half the engineering shears.
"""

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.materials import engineering_constants, voigt
from feti_homog.report.cards import effective_material
from feti_homog.results import output_folder, result_json
from feti_homog.typing import Document, Float

FIELDS = 8  # numbers in a line of Abaqus
ENGINEERING_SHEARS, TENSOR_SHEARS = np.ones(6), np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5])
ABAQUS_ORDER = [voigt.SPATIAL_STRESSES.index(name) for name in ("S11", "S22", "S33", "S12", "S13", "S23")]
"""The indices in [11, 22, 33, 23, 13, 12] of the components in Abaqus' order."""
ABAQUS_ENTRIES = tuple((ABAQUS_ORDER[row], ABAQUS_ORDER[column]) for column in range(6) for row in range(column + 1))
"""Rows and columns of D1111, D1122, D2222, D1133, ..., D2323: the upper triangle by columns."""
ANSYS_ORDER = [voigt.SPATIAL_STRESSES.index(name) for name in ("S11", "S22", "S33", "S12", "S23", "S13")]
"""The indices in [11, 22, 33, 23, 13, 12] of the components in ANSYS' order [x, y, z, xy, yz, xz]."""
ANSYS_ENTRIES = tuple((ANSYS_ORDER[row], ANSYS_ORDER[column]) for column in range(6) for row in range(column, 6))
"""Rows and columns of D11, D21, ..., D61, D22, ..., D66."""
ANSYS_LABELS = {
    "EX": "E1", "EY": "E2", "EZ": "E3", "PRXY": "nu12", "PRYZ": "nu23", "PRXZ": "nu13",
    "GXY": "G12", "GYZ": "G23", "GXZ": "G13",
}  # fmt: skip
SYMMETRIC21 = tuple((row, column) for row in range(6) for column in range(row, 6))
SYMMETRIC9 = tuple((row, column) for row, column in SYMMETRIC21 if column < 3 or row == column)
CSV_COLUMNS = ("name", "value", "unit", "meaning")
FIBRE_AXES = ("the fibre (x3 of the cell)", "x1 of the cell", "x2 of the cell")
COMPONENTS = ("11", "22", "33", "gamma23", "gamma13", "gamma12")


def abaqus(
    material: effective_material.EffectiveMaterial, anisotropic: str = "ANISOTROPIC", shears: Float = ENGINEERING_SHEARS
) -> str:
    """Return the Abaqus card, with the keywords *MATERIAL, *ELASTIC and *EXPANSION.

    An anisotropic material has TYPE=`anisotropic` and 21 entries, an expansion with shears TYPE=ANISO.  `shears` (6,)
    are factors from engineering shears to the shears of the card.
    """
    lines = effective_material.comments(material, "**")
    lines.append(f"*MATERIAL, NAME={effective_material.identifier(material.name)}")
    if material.is_orthotropic:
        lines += ["*ELASTIC, TYPE=ENGINEERING CONSTANTS"]
        lines += ["** E1, E2, E3, nu12, nu13, nu23, G12, G13, and on the next line G23"]
        lines += _data_lines(material.constants.values())
    else:
        C, pairs = material.stiffness, effective_material.PAIRS
        names = ["D" + "".join(str(axis + 1) for axis in (*pairs[i], *pairs[j])) for i, j in ABAQUS_ENTRIES]
        lines += [f"*ELASTIC, TYPE={anisotropic}"]
        lines += [f"** {', '.join(names[k : k + FIELDS])}" for k in range(0, len(names), FIELDS)]
        lines += _data_lines(C[i, j] for i, j in ABAQUS_ENTRIES)
    if (alpha := material.expansion) is not None:
        has_shears, kind = alpha[3:].any(), "the tensor's" if shears is TENSOR_SHEARS else "engineering"
        lines += [f"*EXPANSION, TYPE={'ANISO' if has_shears else 'ORTHO'}"]
        if has_shears:
            lines += [f"** alpha11, alpha22, alpha33, alpha12, alpha13, alpha23; {kind} shears"]
        lines += _data_lines((alpha * shears)[ABAQUS_ORDER] if has_shears else alpha[:3])
    return "\n".join(lines)


def calculix(material: effective_material.EffectiveMaterial) -> str:
    """Return the CalculiX card: as for Abaqus, but with ANISO for ANISOTROPIC, and the tensor's shears of expansion."""
    return abaqus(material, "ANISO", TENSOR_SHEARS)


def _data_lines(values: Iterable[float]) -> list[str]:
    """Write the values as card lines of eight numbers, separated by commas."""
    fields = [*map(effective_material.number, values)]
    return [", ".join(fields[k : k + FIELDS]) for k in range(0, len(fields), FIELDS)]


def ansys(material: effective_material.EffectiveMaterial) -> str:
    """Return the ANSYS card.  Raises CaseError for an expansion with shears."""
    if material.expansion is not None and material.expansion[3:].any():
        raise CaseError("its thermal expansion has shears in its axes, which ANSYS lacks; use --transversely-isotropic")
    lines = effective_material.comments(material, "!")
    lines.append("! Material 1; x, y, z are axes 1, 2, 3. To be read in /PREP7.")
    if material.is_orthotropic:
        constants = {label: effective_material.number(material.constants[name]) for label, name in ANSYS_LABELS.items()}
        lines += [f"MP,{label},1,{constant}" for label, constant in constants.items()]
    else:
        C = material.stiffness
        values = [effective_material.number(C[i, j]) for i, j in ANSYS_ENTRIES]
        lines += ["! Stiffness in the order x, y, z, xy, yz, xz: D11, D21, D31, D41, D51, D61, D22, ..., D66"]
        lines += ["TB,ANEL,1,1,21,0"]
        lines += [f"TBDATA,{k + 1},{','.join(values[k : k + 6])}" for k in range(0, len(values), 6)]
    if (alpha := material.expansion) is not None:
        lines += [f"MP,ALP{axis},1,{effective_material.number(alpha[i])}" for i, axis in enumerate("XYZ")]
    return "\n".join(lines)


def moose(material: effective_material.EffectiveMaterial) -> str:
    """Return the MOOSE card, a block [Materials]."""
    name, C = effective_material.identifier(material.name), material.stiffness
    method, entries = ("symmetric9", SYMMETRIC9) if material.is_orthotropic else ("symmetric21", SYMMETRIC21)
    lines = [*effective_material.comments(material, "#"), "[Materials]"]
    lines += _block(
        f"{name}_elasticity",
        type="ComputeElasticityTensor",
        fill_method=method,
        C_ijkl=_quoted(C[i, j] for i, j in entries),
    )
    if material.expansion is not None:
        lines += ["  # The name of the expansion belongs in eigenstrain_names of the strain."]
        lines += _block(
            f"{name}_temperature_rise",
            type="ParsedMaterial",
            property_name=f"{name}_temperature_rise",
            coupled_variables="'temperature'",
            constant_names="'stress_free_temperature'",
            constant_expressions="'0'",
            expression="'temperature - stress_free_temperature'",
        )
        lines += _block(
            f"{name}_expansion",
            type="ComputeEigenstrain",
            eigen_base=_quoted(material.expansion * TENSOR_SHEARS),
            prefactor=f"{name}_temperature_rise",
            eigenstrain_name=f"{name}_expansion",
        )
    return "\n".join([*lines, "[]"])


def _block(name: str, **parameters: str) -> list[str]:
    return [f"  [{name}]", *(f"    {key} = {value}" for key, value in parameters.items()), "  []"]


def _quoted(values: Iterable[float]) -> str:
    return f"'{' '.join(effective_material.number(value) for value in values)}'"


def csv_table(material: effective_material.EffectiveMaterial) -> str:
    """Write the material as a table in CSV format.

    The rows are engineering constants, expansions, and the stiffness in the order [11, 22, 33, 23, 13, 12].
    """
    rows, unit, C = list[tuple[str, float, str, str]](), material.stress_unit, material.stiffness
    for name, value in material.constants.items():
        axes = [int(digit) for digit in name if digit.isdigit()]
        where = " and ".join(f"axis {axis}, {FIBRE_AXES[axis - 1]}" for axis in axes)
        meanings = {"E": f"Young's modulus along {where}", "G": f"shear modulus between {where}"}
        meanings["n"] = f"-eps_{axes[-1]}/eps_{axes[0]} under stress along axis {axes[0]}: {where}"
        rows.append((name, value, "" if name.startswith("nu") else unit, meanings[name[0]]))
    strains: list[float] = [] if material.expansion is None else material.expansion.tolist()
    for name, component, value in zip(engineering_constants.MATERIAL_EXPANSIONS, COMPONENTS, strains, strict=False):
        rows.append((name, value, "1 / temperature", f"thermal strain {component} per unit of temperature"))
    for i, j in SYMMETRIC21:
        digits = "".join(str(axis + 1) for axis in effective_material.PAIRS[i])
        meaning = f"stiffness: stress {digits} under the unit strain {COMPONENTS[j]}"
        rows.append((f"C{i + 1}{j + 1}", C[i, j], unit, meaning))
    texts = [(name, effective_material.number(value), *words) for name, value, *words in rows]
    return result_json.csv_text([CSV_COLUMNS, *texts]).removesuffix("\n")


FORMATS: dict[str, Callable[[effective_material.EffectiveMaterial], str]] = {
    "abaqus": abaqus, "calculix": calculix, "ansys": ansys, "moose": moose, "csv": csv_table,
}  # fmt: skip
SYMMETRIES: dict[str, Callable[[Document], effective_material.EffectiveMaterial]] = {
    "orthotropic": effective_material.in_axes_of_the_cell,
    "transversely isotropic": effective_material.nearest_transversely_isotropic,
}


def card_of(document: Document, form: str, symmetry: str = "orthotropic") -> str:
    """Return the card of a stiffness or conductivity.  Raises like the functions in `SYMMETRIES` and `FORMATS`."""
    if document.get("effective_conductivity") is not None:
        return effective_material.conductor_card(document, form, symmetry)
    return FORMATS[form](SYMMETRIES[symmetry](document))


def card(directory: Path, form: str, symmetry: str) -> str:
    """Return the material card of a result folder.

    `form` is a key of `FORMATS`, `symmetry` a key of `SYMMETRIES`.

    Raises:
        CaseError: the format or the result does not exist, or the result is damaged or has no material that the
            format can carry.
        FetiHomogError: result.json has no read permission.
    """
    if form not in FORMATS:
        raise CaseError(f"--format {form}".rstrip() + f": expected one of {', '.join(FORMATS)}")
    output_folder.refuse_begun(directory)
    document = result_json.read(directory)
    path = directory / result_json.NAME
    try:
        return card_of(document, form, symmetry)
    except CaseError as error:
        raise CaseError(*(f"cannot export {path}: {fault}" for fault in error.faults)) from error
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        place = f"{type(error).__name__}: {error}"
        raise CaseError(f"{path}: it is damaged, or no result of this program ({place})") from error
