"""Scaling of a path with the toughness, so that one run calibrates the toughness.

Springs of fixed stiffness break by energy at tractions proportional to the root of the toughness, and the response of
a cell with contact has degree one in the loads.  With s^2 times the toughness and s times the loads the same events
therefore occur at s times the strains and stresses, with s^2 times the energies.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from feti_homog.analysis.result_records import PathPoint, Peak, Tips
from feti_homog.results import path_curves

LOADS = ("strain", "to", "waypoints")
ENERGIES = ("stored", "stored_in_springs", "work", "dissipated", "dissipated_strain_controlled", "fracture_energy")
POINT_MEANS = ("strain", "stress", "temperature")
PEAK_MEANS = ("stress", "strain", "first_break_stress", "first_break_strain", "stress_left")

Record = TypeVar("Record", PathPoint, Peak, Tips)


def scaled(
    document: Mapping[str, Any], points: Sequence[PathPoint], old_peak: Peak | None, toughness: float
) -> tuple[dict[str, Any], tuple[PathPoint, ...], Peak | None]:
    """Return case, points and peak for another toughness of the first interface.

    With s = sqrt(toughness / toughness in the case) the case gets s times its loads, and every interface s^2 times its
    toughness.  Raises ValueError for a result that does not scale, and for a toughness that is not positive.
    """
    if not path_curves.scales_with_toughness(document):
        raise ValueError("only a path whose bonds break by energy on springs scales with the toughness")
    if not toughness > 0:
        raise ValueError(f"toughness = {toughness}: expected an energy per area above 0")
    old, sections = document["case"], path_curves.interface_sections(document)
    s = math.sqrt(toughness / sections[0]["toughness"])
    tougher = [{**section, "toughness": section["toughness"] * s**2} for section in sections]
    path = {name: _times(value, s) if name in LOADS else value for name, value in old["path"].items()}
    case = {**old, "path": path, "interface": tougher if isinstance(old["interface"], list) else tougher[0]}
    changed = []
    for point in points:
        tips = None if point.tips is None else _scaled(point.tips, ("G_I", "G_II"), s**2)
        changed.append(replace(_scaled(_scaled(point, POINT_MEANS, s), ENERGIES, s**2), tips=tips))
    peak = None if old_peak is None else _scaled(_scaled(old_peak, PEAK_MEANS, s), ("dissipated",), s**2)
    return case, tuple(changed), peak


def _scaled(old: Record, names: tuple[str, ...], factor: float) -> Record:
    """Multiply the fields `names` of a record by a factor; None stays None."""
    values = {name: getattr(old, name) for name in names}
    changes = {name: _times(value, factor) for name, value in values.items() if value is not None}
    return replace(old, **changes)


def _times(value: Any, factor: float) -> Any:
    """Multiply a number, an array, or the numbers in lists and tables."""
    if isinstance(value, Mapping):
        return {name: _times(item, factor) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_times(item, factor) for item in value]
    return np.asarray(value) * factor if isinstance(value, np.ndarray) else value * factor
