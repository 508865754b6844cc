"""Extract the outputs of a case, which are the numbers of result.json that fill cases.csv; describe all columns."""

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from feti_homog.analysis import result
from feti_homog.materials import engineering_constants, voigt
from feti_homog.report.text import point_tables
from feti_homog.results import landmarks, path_curves, result_json
from feti_homog.system.runtime import records
from feti_homog.typing import Document

MEASURES = ("principal", "von_mises", "hydrostatic", "utilisation")  # measures of phase stresses
CONDUCTIVITIES = tuple(f"k{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
Column = result_json.DescribedColumn


def numbers(planes: Iterable[str | None]) -> tuple[int, ...]:
    """Return the three numbers that i and j take in the columns Cij of (3, 3) stiffnesses in a sweep.

    They are 1, 2, 6 with generalized plane strain in `planes`, so that C66 is one entry in all cases; else 1, 2, 3.
    """
    return (voigt.GENERALIZED if voigt.GENERALIZED.name in planes else voigt.PLANE_STRAIN).numbers


def outputs(document: Document, numbers: Sequence[int] = voigt.PLANE_STRAIN.numbers) -> dict[str, float]:
    """Return the numbers in result.json by column name.

    Columns Cij of a (3, 3) stiffness have i, j of `numbers`.  Components that are noise at a point or path become 0.
    """
    solver = document["solver"]
    cell, fractions = document["cell"], document["cell"].get("fractions", {})
    values = {"fraction_meshed": cell["fibre_fraction"], "elements": cell["elements"], "nodes": cell["nodes"]}
    if len(fractions) > 2:  # besides matrix and fibre
        values |= {f"fraction_{phase}": fraction for phase, fraction in fractions.items()}
    if cell.get("porosity"):
        values["porosity"] = cell["porosity"]
    values |= {name: cell[name] for name in ("refine", "match_distance") if name in cell}
    values |= {name: solver[name] for name in ("ranks", "subdomains", "dofs", "multipliers")}
    values |= {"iterations": sum(solver["iterations"])} | _constants(document, numbers)
    for point in document.get("angle", ()):
        entries = (
            _entries(point["stiffness"], numbers) if "stiffness" in point else _named(voigt.STRESSES, point["stress"])
        )
        values |= {f"angle_{point['angle']:g}_{name}": value for name, value in entries.items()}
    if path := document.get("path"):  # onset, end, largest stresses and peak
        strain, stress = point_tables.columns_without_noise([p["strain"] for p in path]), path_curves.stresses(document)
        path = [p | {"strain": e, "stress": s} for p, e, s in zip(path, strain, stress, strict=True)]
        stresses = voigt.voigt_names(stress.shape[1])[1]
        if (onset := next((p for p in path if p["broke"] or p.get("softened")), None)) is not None:
            values |= {"onset_load_factor": onset["load_factor"]} | _at_point("onset", onset)
            values |= {"onset_temperature": onset["temperature"]} if "temperature" in onset else {}
        values |= _at_point("end", path[-1]) | {f"end_{state}": path[-1][state] for state in point_tables.STATES}
        values |= {name: path[-1][name] for name in ("dissipated", "friction_heat", "work") if name in path[-1]}
        largest = stress[np.abs(stress).argmax(axis=0), range(len(stresses))]
        if "event" in (peak := landmarks.peak_of({**document, "path": path})):
            values |= {f"peak_{name}": value for name, value in zip(stresses, largest.tolist(), strict=True)}
            values |= {f"peak_{peak[f'{kind}_name']}": peak[kind] for kind in ("stress", "strain")}
    if envelope := document.get("envelope"):  # first axis, least and largest factor
        first, second = document["case"]["envelope"]["plane"]
        factors = sorted(point["factor"] for point in envelope if "factor" in point)
        values |= {f"envelope_{first}": point["factor"] for point in envelope[:1] if "factor" in point}
        if factors:
            values[f"envelope_least_{first}_{second}"] = factors[0]
        if len(factors) == len(envelope):  # every direction has an onset
            values[f"envelope_largest_{first}_{second}"] = factors[-1]
    if (load := document.get("load")) is not None:
        values |= _at_point("load", load) | {f"load_{name}": load[name] for name in ("stored", *point_tables.STATES)}
    values |= _phases(document)
    values |= {f"check_{name}": error for name, error in document["checks"].items()}
    values |= {f"seconds_{stage}": seconds for stage, seconds in document["timings"].items()}
    return {name: float(value) for name, value in (values | {"memory": document["memory"]}).items()}


def _constants(document: Document, numbers: Sequence[int]) -> dict[str, float]:
    """Return stiffness entries, anisotropies and constants by column name, with their mesh errors and bounds."""
    values = _linear(document, numbers)
    if (stiffness := document.get("effective_stiffness")) is not None:
        C = np.asarray(stiffness)
        values["anisotropy_normal"] = C[0, 0] - C[1, 1]
        values["anisotropy_shear"] = C[-1, -1] - (C[0, 0] + C[1, 1] - 2 * C[0, 1]) / 4
    for section in ("moduli", "constants", "transversely_isotropic"):
        values |= {name: value for name, value in document.get(section, {}).items() if value is not None}
    if errors := document.get("mesh_error", {}):
        estimates = _linear(errors, numbers) | errors.get("constants", {})
        values |= {f"{name}_mesh_error": error for name, error in estimates.items() if name in values}
        values["energy_mesh_error"] = errors["energy"]
    if bounds := document.get("bounds"):
        values |= {f"C{i}{i}_{side}": bounds[side][k][k] for side in ("reuss", "voigt") for k, i in enumerate(numbers)}
        for modulus, (lower, upper) in (bounds.get("hashin_shtrikman") or {}).items():
            values |= {f"{modulus}_lower": lower, f"{modulus}_upper": upper}
    return values


def _linear(section: Document, numbers: Sequence[int]) -> dict[str, float]:
    """Return stiffness, conductivity, thermal stress and expansion in `section`, or their errors, by column name."""
    values = _entries(section.get("effective_stiffness", ()), numbers)
    values |= _entries(section.get("effective_stiffness_compression", ()), numbers, "_compression")
    values |= _named(CONDUCTIVITIES, np.ravel(section.get("effective_conductivity", ())).tolist())
    values |= _named(voigt.THERMAL_STRESSES, section.get("thermal_stress", ()))
    return values | _named(voigt.EXPANSIONS, section.get("thermal_expansion", ()))


def _named(names: Iterable[str], values: Iterable[float]) -> dict[str, float]:
    return dict(zip(names, point_tables.columns_without_noise([[*values]])[0].tolist(), strict=False))


def _entries(stiffness: Any, numbers: Sequence[int], suffix: str = "") -> dict[str, float]:
    """Return entries C11, C12, ... + `suffix` of a stiffness by name; {} if empty.  `numbers` label (3, 3) rows."""
    rows = range(1, 7) if len(stiffness) == len(voigt.SPATIAL_STRESSES) else numbers
    return _named((f"C{i}{j}{suffix}" for i in rows for j in rows), np.ravel(stiffness).tolist())


def _phases(document: Document) -> dict[str, float]:
    """Return the largest stresses and utilisations of each phase by column name.

    A column is for one load; in analyses of angles and paths, it has the largest value of all states.
    """
    values, is_curve = dict[str, float](), "angle" in document or "path" in document
    for phase in document.get("phase_stresses", ()):
        for measure in (name for name in MEASURES if name in phase):
            named = dict(zip(phase["state"], phase[measure], strict=True))
            columns = {"": max(named.values())} if is_curve else {f"{label}_": value for label, value in named.items()}
            values |= {f"{place}{phase['phase']}_{measure}": value for place, value in columns.items()}
    return values


def _at_point(place: str, point: Document) -> dict[str, float]:
    strains, stresses = voigt.voigt_names(len(point["strain"]))
    values = _named(strains, point["strain"]) | _named(stresses, point["stress"])
    return {f"{place}_{name}": value for name, value in values.items()}


CASE_COLUMNS = (
    Column("case", "", "number of the case, from 1"),
    Column("folder", "", "folder of the case, below the folder of the sweep"),
    Column("point", "", "number of the point, from 1"),
    Column("realisation", "", "number of the realisation of the point, from 1"),
    Column("status", "", "`done`, `not converged`, `failed`, `damaged`, `running`, `interrupted` or `waiting`"),
    Column("reason", "", "why there is no result; for an unfinished path, its points and load"),
)
INPUT_COLUMNS = (Column("SECTION.KEY", "the key's unit", "value of a key that varies"),)
MODULI = {column.name for column in result_json.columns(engineering_constants.Moduli)}
OUTPUT_COLUMNS = (
    Column("fraction_meshed", "", "area of all fibres / meshed area"),
    Column("fraction_PHASE", "", "area of a phase / meshed area, if there are phases besides matrix and fibre"),
    Column("porosity", "", "area of the voids / area of the cell, if there are voids"),
    Column("match_distance", "", "with `match`: distance of the cell from the table, in mean diameters"),
    Column("refine", "", "halvings of the mesh"),
    Column("elements", "", "triangles of the refined mesh"),
    Column("nodes", "", "nodes of the refined mesh, once for each body in each subdomain; depends on ranks"),
    Column("ranks", "", "MPI ranks"),
    Column("subdomains", "", "number of subdomains"),
    Column("dofs", "", "degrees of freedom of all subdomains"),
    Column("multipliers", "", "Lagrange multipliers of the dual problem"),
    Column("iterations", "", "Krylov iterations of all states"),
    Column("Cij", records.STRESS, "entry of L^ef; if the sweep has generalized plane strain, C66 is the shear modulus"),
    Column("kij", "conductivity", "entry of k^ef, with x3 along the fibres"),
    Column("Cij_compression", records.STRESS, "Cij under the negative unit strains, with contact"),
    Column("thermal_Sij", f"{records.STRESS} per unit of temperature", "stress per unit of temperature at zero strain"),
    Column("expansion_x1", "1 / temperature", "strain along x1 per unit of temperature at zero stress; or along x2"),
    Column("expansion_STRAIN", "1 / temperature", "shear strain per unit of temperature at zero stress"),
    Column("anisotropy_normal", records.STRESS, "C11 - C22"),
    Column("anisotropy_shear", records.STRESS, "C33 - (C11 + C22 - 2 C12) / 4; in generalized plane strain C66 - ..."),
    *result_json.columns(engineering_constants.Moduli),
    *(c for c in result_json.columns(engineering_constants.EngineeringConstants) if c.name not in MODULI),
    *result_json.columns(engineering_constants.TransverseIsotropy),
    Column("NAME_mesh_error", "that of NAME", "estimated mesh error of an entry or constant"),
    Column("energy_mesh_error", "", "largest estimated relative error of the strain energy under any strain"),
    Column("Cii_reuss", records.STRESS, "lower bound of Cii"),
    Column("Cii_voigt", records.STRESS, "upper bound of Cii"),
    Column("bulk_lower", records.STRESS, "lower bound of bulk, by Hashin and Shtrikman"),
    Column("bulk_upper", records.STRESS, "upper bound of bulk, by Hashin and Shtrikman"),
    Column("shear_lower", records.STRESS, "lower bound of shear, by Hashin and Shtrikman"),
    Column("shear_upper", records.STRESS, "upper bound of shear, by Hashin and Shtrikman"),
    Column("angle_ANGLE_Cij", records.STRESS, "entry of L^ef at an opening of ANGLE degrees"),
    Column("angle_ANGLE_Sij", records.STRESS, "macroscopic stress at an opening of ANGLE degrees"),
    Column("onset_load_factor", "", "load factor at which the first bond of a path breaks or softens"),
    Column("onset_temperature", "temperature", "change of temperature there, in generalized plane strain"),
    Column("dissipated", records.STRESS, "energy lost to all breaks of a path, per area of the cell"),
    Column("friction_heat", records.STRESS, "energy lost to friction along a path, per area of the cell"),
    Column("work", records.STRESS, "work of the loads along a path, per area of the cell"),
    Column("onset_Sij", records.STRESS, "macroscopic stress where the first bond of a path breaks or softens"),
    Column("onset_STRAIN", "", "macroscopic strain where the first bond of a path breaks or softens"),
    Column(
        "peak_Sij",
        records.STRESS,
        "largest stress of a path in magnitude, with its sign, even if the path ends before the stress falls; for the "
        "component whose strain leads, the stress of `peak`; absent, with the next, if no stress acts",
    ),
    Column("peak_STRAIN", "", "strain at the peak, for the component whose strain leads"),
    Column("end_Sij", records.STRESS, "macroscopic stress at the end of a path"),
    Column("end_STRAIN", "", "macroscopic strain at the end of a path"),
    Column("end_STATUS", "", "interface nodes that are bonded, open or closed at the end of a path"),
    Column("load_STRAIN", "", "macroscopic strain under the load of analysis `load`"),
    Column("load_Sij", records.STRESS, "macroscopic stress under this load"),
    Column("load_stored", records.STRESS, "elastic energy stored under this load, per area of the cell"),
    Column("load_STATUS", "", "interface nodes that are bonded, open or closed under this load"),
    Column("envelope_AXIS", "that of the axis", "load at onset along the first axis of an envelope"),
    Column("envelope_least_AXIS_AXIS", "that of the axes", "least load at onset of all directions"),
    Column("envelope_largest_AXIS_AXIS", "that of the axes", "largest load at onset, if every direction has an onset"),
    *(
        Column(f"PHASE_{name}", unit, f"largest {words} of a phase; LOAD_PHASE_{name} for a named load")
        for name, unit, words in (
            ("principal", records.STRESS, "principal stress"),
            ("von_mises", records.STRESS, "von Mises stress"),
            ("hydrostatic", records.STRESS, "hydrostatic stress"),
            ("utilisation", "", "utilisation of the strength"),
        )
    ),
    Column("check_LAW", "", "largest relative error of a law, as in result.json"),
    Column("seconds_STAGE", "s", "wall time of a stage, the largest over ranks"),
    Column("memory", "bytes", "peak resident memory, the largest over ranks"),
)


def named(word: str) -> list[str]:
    """Describe entries of result.json and columns of cases.csv with the name `word`; C11 names the column Cij."""
    entries = (records.descriptions(kind).get(word) for kind in result.RECORDS)
    lines = [f"result.json, {word}: {meaning}" for meaning in dict.fromkeys(e.meaning for e in entries if e)]
    for column in OUTPUT_COLUMNS:
        pattern = re.sub("i[ij]", r"\\d\\d", column.name).replace("STRAIN", r"(E|gamma)\d\d")
        if re.fullmatch(re.sub("[A-Z]{3,}", ".+", pattern), word):
            lines.append(f"cases.csv, {column.name}: {column.meaning}")
    return lines


COLUMNS = (*CASE_COLUMNS, *INPUT_COLUMNS, *OUTPUT_COLUMNS)
STATISTICS_COLUMNS = (
    Column("point", "", "number of the point, from 1"),
    *INPUT_COLUMNS,
    Column("output", "", "name of a column of cases.csv"),
    Column("unit", "", "unit of the output"),
    Column("count", "", "finished realisations of the point that have the output"),
    Column("mean", "that of the output", "mean over these realisations"),
    Column("std", "that of the output", "standard deviation over two or more realisations"),
    Column("ci95", "that of the output", "half the width of the 95 % confidence interval of the mean"),
)
