"""Measured values, and what a result.json has in their place, with its derivatives where they are exact."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.case.bond_laws import DEFAULT, LAWS
from feti_homog.case.case import Case
from feti_homog.errors import CaseError
from feti_homog.materials.derivatives import composite_constants
from feti_homog.materials.laws import expansion
from feti_homog.materials.plane_state import PLANE_STATES
from feti_homog.materials.voigt import voigt_names
from feti_homog.report.text.point_tables import STATES
from feti_homog.results import path_curves
from feti_homog.results.path_curves import Document
from feti_homog.studies.outputs import outputs
from feti_homog.typing import Float

TOUGHNESS = "toughness"
OF_PATHS = ("onset", "peak", "end")


@dataclass(frozen=True)
class Datum:
    """A measured value.

    Attributes:
        test: number of its test, from 0.
        name: of the value; of a point of a curve that of the stress.
        strain: of a point of a curve its strain, else None.
        strain_name: of a point of a curve the component.
    """

    test: int
    name: str
    value: float
    std: float
    strain: float | None = None
    strain_name: str = ""


def available(case: Case) -> list[str]:
    """Return the names of values that a result of the case has; none of analyses that no fit takes."""
    spatial = PLANE_STATES[case.analysis.plane].is_spatial
    size = 6 if spatial else 3
    if case.analysis.type == "stiffness":
        is_heated = spatial and all(expansion(material) is not None for material in case.materials.values())
        return [*composite_constants(np.eye(size), np.zeros(6) if is_heated else None)]
    if case.analysis.type == "path":
        strains, stresses = voigt_names(size)
        places = [f"{place}_{name}" for place in OF_PATHS for name in (*stresses, *strains)]
        return ["onset_load_factor", *places, "dissipated", "work"]
    return []


def responses(document: Document) -> dict[str, float]:
    """Return the numbers of a result whose scatter is of interest: constants, or those of its loads and onsets."""
    found, kind = _values(document), document["case"]["analysis"]["type"]
    if kind == "stiffness" or "sensitivities" in document:
        return found
    starts = ("onset_", "peak_") if kind == "path" else (f"{kind}_",)
    return {name: found[name] for name in found if name.startswith(starts) and not name.endswith(STATES)}


def predicted(document: Document, data: Sequence[Datum]) -> Float:
    """(m,) values of a result in place of the data.

    Raises:
        CaseError: the result has no such value.
    """
    found = _values(document)
    missing = [datum for datum in data if datum.strain is None and datum.name not in found]
    if missing:
        without = {True: "this result has no such value; no bond breaks", False: "this result has no such value"}
        raise CaseError(*(f"[measured] {d.name}: {without[d.name.startswith('onset_')]}" for d in missing))
    return np.array([found[each.name] if each.strain is None else _on_curve(document, each)[0] for each in data])


def exact_derivatives(document: Document, data: Sequence[Datum], name: str) -> Float | None:
    """(m,) derivatives of the values by an unknown; None where the result does not give them."""
    sections = path_curves.interface_sections(document)
    name = name.replace("interface.1.", "interface.") if len(sections) == 1 else name
    if "sensitivities" in document:
        return _of_stiffness(document["sensitivities"], data, name)
    key = name.removeprefix("interface.")
    exponent = _exponent(document, key) if name != key else None
    return None if exponent is None else _by_scaling(document, data, exponent / float(sections[0][key]))


def _exponent(document: Document, key: str) -> float | None:
    """Return the degree in which loads at which bonds break are homogeneous in a key of the one interface.

    It is 1/2 in the toughness of springs that it does not change, and 1 in the only strength; None of others.
    """
    sections = path_curves.interface_sections(document)
    if len(sections) != 1 or not _is_homogeneous(document):
        return None
    law = LAWS[sections[0].get("criterion", DEFAULT)]
    if key == TOUGHNESS and key in law.keys and not law.softens:
        return 0.5
    strengths = [each for each in law.limits if math.isfinite(float(sections[0].get(each) or "inf"))]
    return 1.0 if strengths == [key] else None


def _is_homogeneous(document: Document) -> bool:
    """Return whether all loads up to the onset grow alike; a temperature that comes before them does not."""
    case = document["case"]
    if case["analysis"]["type"] == "envelope":
        return case["envelope"].get("temperature") is None
    return case["analysis"]["type"] == "path" and path_curves.is_proportional(document)


def _values(document: Document) -> dict[str, float]:
    if "sensitivities" in document:
        own = document["sensitivities"]
        return dict(zip(own["constants"], own["constant_values"], strict=True))
    if document["case"]["analysis"]["type"] == "stiffness":
        thermal = document.get("thermal_stress")
        heat = None if thermal is None else np.array(thermal)
        return {k: float(v) for k, v in composite_constants(np.array(document["effective_stiffness"]), heat).items()}
    return outputs(document)


def _of_stiffness(own: Mapping[str, Any], data: Sequence[Datum], name: str) -> Float | None:
    """Return the derivatives of constants: zero by strengths, and by expansions in a plane; None of what is unknown."""
    if name in own["parameters"]:
        values = np.array(own["derivatives"])[:, own["parameters"].index(name)]
        column = dict(zip(own["constants"], values, strict=True))
        return np.array([column[each.name] for each in data])
    section, idle = name.partition(".")[0], ("strength", "toughness")
    is_idle = ".expansion" in name if section == "material" else section == "interface" and name.endswith(idle)
    return np.zeros(len(data)) if is_idle else None


def _by_scaling(document: Document, data: Sequence[Datum], share: float) -> Float | None:
    """Return the derivatives along S(E; s R) = s S(E / s; R), of what does not depend on the end of the load."""
    found, derivatives = _values(document), []
    for each in data:
        if each.strain is not None:
            value, slope = _on_curve(document, each)
            derivatives.append((value - abs(each.strain) * slope) * share)
            continue
        place, _, component = each.name.partition("_")
        is_peak = place == "peak" and found[each.name] != found[f"end_{component}"]
        if not (place in ("onset", "envelope") or is_peak):
            return None
        derivatives.append(found[each.name] * share)
    return np.array(derivatives)


def _on_curve(document: Document, datum: Datum) -> tuple[float, float]:
    """Return the stress of a path at a strain, and its slope.

    Raises:
        CaseError: the strain is not that which rises, or the path ends before it.
    """
    curve = path_curves.rising_strain(document)
    strains, stresses = voigt_names(len(document["path"][0]["stress"]))
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
    k = int(np.clip(np.searchsorted(strain, at), 1, len(strain) - 1))
    length = strain[k] - strain[k - 1]
    slope = float((stress[k] - stress[k - 1]) / length) if length > 0 else 0.0
    return float(stress[k - 1] + slope * (at - strain[k - 1])), slope
