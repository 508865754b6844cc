"""Read the [material.PHASE] sections, and find the material of each mesh phase."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from feti_homog.case.cell_section import CIRCULAR, GEOMETRY, Cell
from feti_homog.case.section_values import FRACTIONS
from feti_homog.materials import laws, material_forms, voigt
from feti_homog.microstructure import phase_names
from feti_homog.schema import TableReader, keys, wording

SUGGESTED = (phase_names.MATRIX, phase_names.FIBRE, phase_names.COATING, "fibre:2")  # phases may have any name
FORMS_OF = {
    name: [form for form, constants in material_forms.MATERIAL_FORMS.items() if name in keys.keys_of(constants)]
    for contents in material_forms.MATERIAL_FORMS.values()
    for name in keys.keys_of(contents)
}
"""The material forms that have a constant, by the name of the constant."""
DATA_SHEET = {
    **dict.fromkeys(("e1", "e11", "el"), "E_axial"),
    **dict.fromkeys(("e2", "e22", "et"), "E_transverse"),
    **dict.fromkeys(("nu12", "nu13", "nult", "v12", "v13"), "nu_axial"),
    **dict.fromkeys(("nu23", "nutt", "nut", "v23"), "nu_transverse"),
    **dict.fromkeys(("g12", "g13", "glt"), "G_axial"),
    **dict.fromkeys(("g23", "gtt", "gt"), "G_transverse"),
    **dict.fromkeys(("alpha1", "alpha11", "alphal", "cte1", "cte11", "ctel"), "expansion_axial"),
    **dict.fromkeys(("alpha2", "alpha22", "alphat", "cte2", "cte22", "ctet"), "expansion_transverse"),
}
"""Keys of this program by the names of constants on data sheets, whose axis 1 is along the fibres."""


def read_materials(
    document: Mapping[str, Any], plane: str | None, reader: TableReader
) -> dict[str, material_forms.Material]:
    """Read the valid materials by phase, and report faults to the reader.

    A faulty geometry, mix or plane state turns off the checks that depend on it. Without a section [material] the
    result is empty: another check reports the missing section.
    """
    if "material" not in document:
        return {}
    table = document["material"]
    if not isinstance(table, dict):
        expected = "expected sections [material.matrix], [material.fibre]"
        reader.faults.append(f"material = {wording.toml_value(table)}: {expected}")
        return {}
    geometry = reader.selected[GEOMETRY]
    fibres = fibre_phases(document.get("cell")) if geometry in CIRCULAR else None
    known = None if fibres is None else (phase_names.MATRIX, *fibres, phase_names.COATING)
    materials = {}
    for phase, constants in table.items():
        section = f"material.{wording.toml_key(phase)}"
        is_unknown = known is not None and ":" not in phase and phase not in known
        if is_unknown or not phase_names.PHASE.fullmatch(phase) or phase in FORMS_OF:
            owners = {} if phase == phase_names.FIBRE else reader.owners
            reader.faults.append(f"[{section}]: unknown phase; {wording.suggestion(phase, known or SUGGESTED, owners)}")
        elif ":" in phase and geometry in CIRCULAR:
            reader.faults.append(f'[{section}]: belongs to geometry = "mesh", not {wording.toml_value(geometry)}')
        elif (material := _read_material(constants, section, plane, reader)) is not None:
            materials[phase] = material
    needed = () if geometry == "mesh" and table else (phase_names.MATRIX, *(fibres or ()))  # a mesh lists its names
    reader.faults += [f"[material.{phase}]: missing section" for phase in needed if phase not in table]
    return materials


def fibre_phases(cell: object) -> tuple[str, ...] | None:
    """Return the fibre phases of a [cell] table without a file; None if its mix is faulty."""
    mix = cell.get("mix") if isinstance(cell, dict) else None
    if mix is None:
        return (phase_names.FIBRE,)
    return tuple(mix) if FRACTIONS.accepts(mix) else None


def coating_faults(cell: Cell | None, materials: object) -> list[str]:
    """List coatings without a material, or the material without coatings; [] for faulty sections and user meshes."""
    if cell is None or cell.has_own_mesh or not isinstance(materials, dict):
        return []
    has_coatings = cell.coating is not None if cell.table is None else bool((cell.table.coating > 0).any())
    no_coating = "no fibre has a coating; expected [cell] coating, or a column of a table"
    fault = "missing section; [cell] has coatings" if has_coatings else no_coating
    return [f"[material.{phase_names.COATING}]: {fault}"] * (has_coatings != (phase_names.COATING in materials))


def _read_material(
    table: object, section: str, plane: str | None, reader: TableReader
) -> material_forms.Material | None:
    """Read a material in the form that its keys select; None for faulty keys.  Faults go to the reader."""
    names, given = (list(table) if isinstance(table, dict) else list[str]()), dict[str, list[str]]()
    sheet = {name: key for name in names if (key := DATA_SHEET.get(name.lower().replace("_", "")))}
    if isinstance(table, dict) and not sheet.keys() <= FORMS_OF.keys():
        axes = f"{', '.join(sheet)}: axis 1 of a data sheet is along the fibres, which are along x3 here"
        reader.faults.append(f"[{section}] {axes}: give {', '.join(sheet.values())}")
        table = {sheet.get(name, name): value for name, value in table.items()}  # for its other faults
        names = [*table]
    for name, (form, *further) in FORMS_OF.items():
        if name in names and not further:
            given.setdefault(form, []).append(name)
    conducts = "conductivity" in names or plane == voigt.CONDUCTION.name
    forms = list(given) or ["conductor" if conducts else "isotropic"]
    if len(forms) > 1:
        groups = " and ".join(f"{', '.join(keys)} ({form})" for form, keys in given.items())
        way = laws.OF_DATA_SHEETS if "orthotropic" in forms else "a material is of one kind"
        reader.faults.append(f"[{section}] {groups}: exclude each other; {way}")
        return None
    kind = material_forms.MATERIAL_FORMS[forms[0]]
    material: material_forms.Material | None = reader.read(kind, table, section)
    missing = laws.missing_constants(kind, names, plane) if plane and plane != voigt.CONDUCTION.name else []
    reader.faults += [f"[{section}] {fault}" for fault in missing]
    if material is not None and not missing:
        checks: list[Callable[[Any], object]] = [] if plane is None else [partial(laws.stiffness_of, plane=plane)]
        if material.strength is not None and plane != voigt.CONDUCTION.name:
            checks += [lambda m: material_forms.criterion(m.strength), partial(_known_stress, plane=plane)]
        for check in (*checks, laws.expansion):
            try:
                check(material)
            except ValueError as error:
                reader.faults += {f"[{section}] {error}"}.difference(reader.faults)
    return material


def _known_stress(material: material_forms.Material, plane: str | None) -> None:
    """Raise ValueError if constants leave S33, which a strength needs, open in the plane state (None: no check)."""
    is_plane = plane is not None and not voigt.PLANE_STATES[plane].is_spatial
    if is_plane and np.isnan(laws.out_of_plane(material, str(plane))[0]).any():
        raise ValueError("strength: needs S33, which the constants do not give; set a 6x6 stiffness or more constants")


def missing_expansions(tables: object, needed_by: str) -> list[str]:
    """List material tables without the thermal expansion that `needed_by`, a key or a result, requires.

    Tables with unknown keys, which may be misspelt expansions, are skipped.
    """
    faults, pair = [], f"{', '.join(material_forms.EXPANSION_PAIR)}, or one expansion"
    for phase, table in tables.items() if isinstance(tables, dict) else ():
        names = table.keys() if isinstance(table, dict) else {"expansion"}
        if names <= FORMS_OF.keys() and not {"expansion", *material_forms.EXPANSION_PAIR} & names:
            name = pair if {"E_axial", "E_transverse"} & names else "expansion"
            faults.append(f"[material.{wording.toml_key(phase)}] {name}: missing; {needed_by} needs it")
    return faults


def unlike_units(materials: Mapping[str, material_forms.Material]) -> list[str]:
    """List moduli that seem to have different units, and expansions above 1 % per degree, one per line.

    Suspect are a ratio of 1000 (GPa / MPa) in one phase, and fibres softer or over 1000 times stiffer than the matrix.
    """
    lines, largest, gpa_to_mpa = list[str](), dict[str, float](), 1e3
    for phase, material in materials.items():
        section, named = f"[material.{wording.toml_key(phase)}]", vars(material).items()
        for name, value in named:
            if name.startswith("expansion") and value is not None and np.abs(value).max() > 1e-2:
                lines.append(f"{section} {name} = {wording.toml_value(value)}: is it in units of 1e-6?")
        moduli = {name: value for name, value in named if value and name.startswith(("young", "E", "G"))}
        if moduli and max(moduli.values()) >= gpa_to_mpa * min(moduli.values()):
            high, low = max(moduli, key=moduli.__getitem__), min(moduli, key=moduli.__getitem__)
            lines.append(f"{section} {high} {moduli[high]:g}, {low} {moduli[low]:g}: are both in one unit?")
        largest[phase] = float(np.max([*moduli.values(), *np.ravel(vars(material).get("stiffness", 0.0))]))
    matrix = largest.pop(phase_names.MATRIX, 0.0)
    return lines + [
        f"[material.{wording.toml_key(phase)}] modulus {value:g}, [material.matrix] {matrix:g}: are both in one unit?"
        for phase, value in largest.items()
        if phase != phase_names.COATING and value * matrix and not matrix <= value <= gpa_to_mpa * matrix
    ]


def provider(phase: str, materials: Mapping[str, material_forms.Material]) -> str:
    """Return the phase that provides the material: the phase itself or, for "fibre:2" without a table, "fibre"."""
    return phase if phase in materials else phase.partition(":")[0]
