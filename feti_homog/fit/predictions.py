"""Measured values, and what a result.json has in their place, with its derivatives where they are exact."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.case.case import Case
from feti_homog.errors import CaseError
from feti_homog.materials.derivatives import composite_constants
from feti_homog.materials.laws import expansion
from feti_homog.materials.plane_state import PLANE_STATES
from feti_homog.materials.voigt import voigt_names
from feti_homog.results import path_curves
from feti_homog.results.path_curves import Document
from feti_homog.sweep.report.outputs import outputs
from feti_homog.typing import Float

TOUGHNESS = "interface.toughness"
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

    @property
    def words(self) -> str:
        """The name, of a point of a curve with its place."""
        return self.name if self.strain is None else f"{self.name}({self.strain_name} = {self.strain:g})"


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


def predicted(document: Document, data: Sequence[Datum]) -> Float:
    """(m,) values of a result in place of the data.

    Raises:
        CaseError: the result has no such value.
    """
    found = _values(document)
    missing = [datum for datum in data if datum.strain is None and datum.name not in found]
    if missing:
        raise CaseError(*(f"[measured] {each.name}: this path has no such value" for each in missing))
    return np.array([found[each.name] if each.strain is None else _on_curve(document, each)[0] for each in data])


def exact_derivatives(document: Document, data: Sequence[Datum], name: str) -> Float | None:
    """(m,) derivatives of the values by an unknown; None where the result does not give them."""
    sections = path_curves.interface_sections(document)
    name = name.replace("interface.1.", "interface.") if len(sections) == 1 else name
    if "sensitivities" in document:
        return _of_stiffness(document["sensitivities"], data, name)
    is_scaling = name == TOUGHNESS and len(sections) == 1 and path_curves.scales_with_toughness(document)
    return _by_toughness(document, data, float(sections[0]["toughness"])) if is_scaling else None


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
    """Return the derivatives of constants: zero by strengths and what else a stiffness does not depend on."""
    if name in own["parameters"]:
        values = np.array(own["derivatives"])[:, own["parameters"].index(name)]
        column = dict(zip(own["constants"], values, strict=True))
        return np.array([column[each.name] for each in data])
    section = name.partition(".")[0]
    is_idle = section == "material" or (section == "interface" and name.endswith(("strength", "toughness")))
    return np.zeros(len(data)) if is_idle else None


def _by_toughness(document: Document, data: Sequence[Datum], toughness: float) -> Float | None:
    """Return the derivatives along S(E; s^2 G) = s S(E / s; G), of what does not depend on the end of the load."""
    found, last = _values(document), document["path"][-1]["stress"]
    of_stress = dict(zip(voigt_names(len(last))[1], last, strict=True))
    derivatives = []
    for each in data:
        if each.strain is not None:
            value, slope = _on_curve(document, each)
            derivatives.append((value - abs(each.strain) * slope) / (2 * toughness))
            continue
        place, _, component = each.name.partition("_")
        is_peak = place == "peak" and (component not in of_stress or found[each.name] != of_stress[component])
        if not (place == "onset" or is_peak):
            return None
        derivatives.append(found[each.name] / (2 * toughness))
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
