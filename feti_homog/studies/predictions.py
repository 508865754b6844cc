"""Check measured values against a case; find computed values and their exact derivatives in result.json."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from feti_homog.case import Case, bond_laws, interface_section, load_sections, sections
from feti_homog.errors import CaseError
from feti_homog.materials import engineering_constants, laws, voigt
from feti_homog.report.text import point_tables
from feti_homog.results import landmarks, path_curves
from feti_homog.schema import wording
from feti_homog.studies.outputs import CONDUCTIVITIES, outputs
from feti_homog.typing import Float

TOUGHNESS = "toughness"


@dataclass(frozen=True)
class Datum:
    """One measured value.

    Attributes:
        test: number of the test, from 0.
        name: name of the value, or of the stress component of a curve.
        value: the measurement, in the unit of the computed value.
        std: standard deviation of the measurement.
        strain: strain at a point of a curve, else None.
        strain_name: component of this strain, else "".
    """

    test: int
    name: str
    value: float
    std: float
    strain: float | None = None
    strain_name: str = ""


def data_faults(case: Case, data: Sequence[Datum], place: str) -> Iterator[str]:
    """Yield the reasons why a case cannot compute measured values; a reason about one value begins with `place`."""
    state, kind = voigt.PLANE_STATES[case.analysis.plane], case.analysis.type
    strains, stresses = voigt.voigt_names(6 if state.is_spatial else 3)
    if kind == "stiffness":
        is_heated = state.is_spatial and all(laws.expansion(each) is not None for each in case.materials.values())
        names = [*engineering_constants.constants(np.eye(len(strains)), np.zeros(6) if is_heated else None)]
    elif kind == "path":
        names = [f"{mark}_{name}" for mark in ("onset", "peak", "end") for name in (*stresses, *strains)]
        names = ["onset_load_factor", *names, "dissipated", "work"]
    elif kind == "conductivity":
        names = [*CONDUCTIVITIES]
    else:
        yield f'[analysis] type = "{kind}": a fit takes "stiffness", "path" and "conductivity"'
        return
    if points := [datum for datum in data if datum.strain is not None]:
        yield from (f"{place}{sections.CURVE}: {fault}" for fault in _curve_faults(case, points))
    for name in dict.fromkeys(datum.name for datum in data if datum.strain is None):
        if name in engineering_constants.FORMER:
            yield f"{place}{wording.toml_key(name)}: its name is {engineering_constants.FORMER[name]}"
        elif name not in names:
            hint = wording.suggestion(name, names, {})
            yield f"{place}{wording.toml_key(name)}: the analysis does not give it; {hint}"


def _curve_faults(case: Case, points: Sequence[Datum]) -> Iterator[str]:
    """Yield the conflicts between a measured curve and the analysis of its test.

    The curve must be over the rising strain of the leg: the largest prescribed or, under one stress, its conjugate.
    """
    state = voigt.PLANE_STATES[case.analysis.plane]
    names = {name for datum in points for name in (datum.strain_name, datum.name)}
    unknown = sorted(names.difference(*state.components))
    for name in unknown:
        yield f'plane = "{case.analysis.plane}" has no {name}'
    if case.analysis.type != "path" or len(case.targets) != 1:
        yield "expected an analysis of type path, of one leg"
        return
    target = case.targets[0]
    strain_of = {name: strain for strain, stress in state.components for name in (strain, stress)}
    loads = [(strain, name, target[name]) for name, strain in strain_of.items() if target.get(name)]
    is_strain = bool(loads) and all(name == strain for strain, name, _ in loads)
    if unknown or not (is_strain or len(loads) == 1):
        return
    rising, _, end = max(loads, key=lambda load: abs(load[2]))
    yield from [f"{name} is prescribed as 0" for name in {datum.name for datum in points} if target.get(name) == 0.0]
    if not is_strain and target.get(load_sections.TEMPERATURE):
        end = 0.0  # a temperature may reverse the sign of the strain
    values = np.array([datum.strain or 0.0 for datum in points])
    sizes = np.abs(values)
    turns = landmarks.turning_points(sizes, landmarks.LEAST_DROP * sizes.max())
    falls = [f"from {sizes[a]:g} to {sizes[b]:g}" for a, b in pairwise(turns) if sizes[a] > sizes[b]]
    yield from [f"expected strains that rise, without unloading {fall}" for fall in falls[:1]]
    if rising != points[0].strain_name:
        yield f"expected the strain that rises along the path, {rising}"
    elif (values * end < 0).any():
        yield f"expected strains of the sign of the path, which ends at {end:g}"
    elif is_strain and (largest := sizes.max()) > abs(end) * (1 + path_curves.SAME_LOAD):
        hint = "; in per cent?" if 5.0 <= largest / abs(end) <= 200.0 else ""
        yield f"a strain of {largest:g} is beyond the end of the path at {abs(end):g}{hint}"


def responses(document: path_curves.Document) -> dict[str, float]:
    """Return, by name, the numbers of a result for which a study reports scatter.

    They are constants of a stiffness, entries of a conductivity, onset and peak of a path, columns of other analyses.
    """
    values, kind = _values(document), document["case"]["analysis"]["type"]
    if kind == "conductivity":
        k, errors = np.abs(document["effective_conductivity"]), document.get("mesh_error")
        least = np.max(errors["effective_conductivity"]) if errors else 0.0  # couplings below it are of the mesh
        return {name: values[name] for name, size in zip(CONDUCTIVITIES, k.ravel(), strict=True) if size > least}
    if kind == "stiffness" or "sensitivities" in document:
        return values
    starts = ("onset_", "peak_") if kind == "path" else (f"{kind}_",)
    return {name: values[name] for name in values if name.startswith(starts) and not name.endswith(point_tables.STATES)}


def _values(document: path_curves.Document) -> dict[str, float]:
    """Return the numbers of a result by the names that a fit file uses."""
    if "sensitivities" in document:
        sensitivities = document["sensitivities"]
        return dict(zip(sensitivities["constants"], sensitivities["constant_values"], strict=True))
    if document["case"]["analysis"]["type"] == "stiffness":
        thermal = document.get("thermal_stress")
        heat = None if thermal is None else np.array(thermal)
        constants = engineering_constants.constants(np.array(document["effective_stiffness"]), heat)
        return {name: float(value) for name, value in constants.items()}
    return outputs(document)


def predicted(document: path_curves.Document, data: Sequence[Datum]) -> Float:
    """Return the values (m,) computed for m data.  Raises CaseError if a value, or a strain of a curve, is missing."""
    values, ways = _values(document), {"onset": "; no bond breaks"}
    if "path" in document and "stress_left" not in landmarks.peak_of(document):
        values = {name: value for name, value in values.items() if not name.startswith("peak_")}
        ways["peak"] = "; the path ends before its stress falls: load it further"
    missing = [datum.name for datum in data if datum.strain is None and datum.name not in values]
    if missing:
        reasons = [(name, ways.get(name.partition("_")[0], "")) for name in missing]
        raise CaseError(*(f"[measured] {name}: this result has no such value{reason}" for name, reason in reasons))
    return np.array([values[d.name] if d.strain is None else _on_curve(document, d) for d in data])


def exact_derivatives(document: path_curves.Document, data: Sequence[Datum], name: str) -> Float | None:
    """Return exact derivatives (m,) of computed values by the unknown `name`; None if the result lacks them.

    Elastic constants do not depend on strengths, nor, in a plane, on expansions.  If all loads grow in proportion up to
    the onset, without a previous temperature, loads at breaks of a single interface are homogeneous: of degree 1 in the
    only strength, or of degree 1/2 in the toughness of springs that do not soften.  Other derivatives must be in
    `sensitivities` of result.json.
    """
    tables = interface_section.interface_tables(document["case"])
    name = name.replace("interface.1.", "interface.") if len(tables) == 1 else name
    if (sensitivities := document.get("sensitivities")) is not None:
        if name in sensitivities["parameters"]:
            values = np.array(sensitivities["derivatives"])[:, sensitivities["parameters"].index(name)]
            column = dict(zip(sensitivities["constants"], values, strict=True))
            return np.array([column[datum.name] for datum in data])
        section, idle = name.partition(".")[0], ("strength", "toughness")
        is_idle = {"material": ".expansion" in name, "interface": name.endswith(idle)}
        return np.zeros(len(data)) if is_idle.get(section) else None
    key, case = name.removeprefix("interface."), document["case"]
    is_alike = case["analysis"]["type"] == "path" and path_curves.is_proportional(document)
    is_alike |= case["analysis"]["type"] == "envelope" and case["envelope"].get("temperature") is None
    if name == key or len(tables) != 1 or not is_alike:
        return None
    law = bond_laws.LAWS[tables[0].get("criterion", bond_laws.DEFAULT)]
    strengths = [name for name in law.limits if math.isfinite(float(tables[0].get(name) or "inf"))]
    is_toughness = key == TOUGHNESS and key in law.keys and not law.softens
    if not is_toughness and strengths != [key]:
        return None
    # Stress S, strain E, strength R: S(E; s R) = s S(E / s; R), unless a value depends on the final load.  Between the
    # jumps of a curve, this derivative is zero and tells nothing.
    relative = (0.5 if is_toughness else 1.0) / float(tables[0][key])
    numbers, derivatives = _values(document), list[float]()
    for datum in data:
        mark, _, component = datum.name.partition("_")
        is_peak = mark == "peak" and numbers[datum.name] != numbers[f"end_{component}"]
        if datum.strain is not None or not (mark in ("onset", "envelope") or is_peak):
            return None
        derivatives.append(numbers[datum.name] * relative)
    return np.array(derivatives)


def _on_curve(document: path_curves.Document, datum: Datum) -> float:
    """Interpolate a path's stress at the strain of a datum.

    Raises CaseError if another strain component rises along the path, the path ends below E, or the signs differ.
    """
    curve = path_curves.rising_strain(document)
    strains, stresses = voigt.voigt_names(len(document["path"][0]["stress"]))
    leading = strains[path_curves.leading_component(document)]
    place = f"[measured] curve: {datum.strain_name} = {datum.strain:g}"
    if curve is None or datum.strain_name != leading:
        raise CaseError(f"{place}: expected the strain that rises along a path of one leg, {leading}")
    strain, stress = curve[:, -1], curve[:, stresses.index(datum.name)]
    at, end = abs(datum.strain or 0.0), document["path"][-1]["strain"][strains.index(leading)]
    if (datum.strain or 0.0) * end < 0.0:
        raise CaseError(f"{place}: expected the sign of the strain of the path, which ends at {end:g}")
    if at > strain[-1] * (1 + path_curves.SAME_LOAD):
        raise CaseError(f"{place}: beyond the end of the path at {strain[-1]:g}")
    return float(np.interp(at, strain, stress))
