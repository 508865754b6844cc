"""Scaling of a path with the toughness, so that one run calibrates the toughness.

Springs of fixed stiffness break by energy at tractions proportional to the root of the toughness, and the response of
a cell with contact has degree one in the loads.  With s^2 times the toughness and s times the loads the same events
therefore occur at s times the strains and stresses, with s^2 times the energies.
"""

import math
from collections.abc import Mapping
from typing import Any

from feti_homog.results import path_curves

LOADS = ("strain", "stress", "temperature", "to", "waypoints", "first_break_strain", "first_break_stress",
         "stress_left")  # fmt: skip
ENERGIES = ("stored", "stored_in_springs", "work", "dissipated", "dissipated_strain_controlled", "fracture_energy",
            "toughness", "G_I", "G_II")  # fmt: skip
POWERS = dict.fromkeys(LOADS, 1) | dict.fromkeys(ENERGIES, 2)
"""Powers of s of the numbers in entries of result.json, and in all tables and lists below; others stay."""


def scaled(document: Mapping[str, Any], toughness: float) -> dict[str, Any]:
    """Return case, path and peak of a result for another toughness of the first interface.

    With s = sqrt(toughness / toughness in the case) the case gets s times its loads, and every interface s^2 times its
    toughness.  Raises ValueError for a result that does not scale, and for a toughness that is not positive.
    """
    if not path_curves.scales_with_toughness(document):
        raise ValueError("only a path whose bonds break by energy on springs scales with the toughness")
    if not toughness > 0:
        raise ValueError(f"toughness = {toughness}: expected an energy per area above 0")
    s = math.sqrt(toughness / path_curves.interface_sections(document)[0]["toughness"])
    case = {**document["case"], **{name: _times(document["case"][name], s) for name in ("path", "interface")}}
    return {"case": case, **{name: _times(document[name], s) for name in ("path", "peak")}}


def _times(value: Any, s: float, power: int = 0) -> Any:
    """Multiply the numbers in a value by s to the power of their entry."""
    if isinstance(value, Mapping):
        return {name: _times(item, s, POWERS.get(name, power)) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_times(item, s, power) for item in value]
    return value * s**power if power else value
