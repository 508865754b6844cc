"""Scaling of paths with the toughness: one run calibrates it.

On springs with fixed stiffness a bond breaks by energy at tractions that grow as the root of the toughness, and the
cell with contact is homogeneous of degree one in its loads.  So a toughness s^2 times as large, under s times the
loads, has the same events at s times the strains and stresses, and s^2 times the energies.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from feti_homog.analysis.result_records import PathPoint, Peak, Tips
from feti_homog.results.path_curves import interface_sections, scales_with_toughness

LOADS = ("strain", "to", "waypoints")
ENERGIES = ("stored", "stored_in_springs", "work", "dissipated", "dissipated_strain_controlled", "fracture_energy")

Record = TypeVar("Record", PathPoint, Peak, Tips)


def ratio(document: Mapping[str, Any], toughness: float) -> float:
    """Return s = sqrt(toughness / case toughness), with several interfaces by the first.

    Raises ValueError for a result that does not scale.
    """
    if not scales_with_toughness(document):
        raise ValueError("only a path whose bonds break by energy on springs scales with the toughness")
    if not toughness > 0:
        raise ValueError(f"toughness = {toughness}: expected an energy per area above 0")
    return math.sqrt(toughness / interface_sections(document)[0]["toughness"])


def case(old: Mapping[str, Any], s: float) -> dict[str, Any]:
    """Return the case with s^2 times its toughness and s times its loads."""
    sections = [{**section, "toughness": section["toughness"] * s**2} for section in interface_sections({"case": old})]
    path = {name: _times(value, s) if name in LOADS else value for name, value in old["path"].items()}
    return {**old, "path": path, "interface": sections if isinstance(old["interface"], list) else sections[0]}


def point(old: PathPoint, s: float) -> PathPoint:
    """Return a point with s times its strain, stress and temperature, and s^2 times its energies."""
    tips = None if old.tips is None else _scaled(old.tips, ("G_I", "G_II"), s**2)
    return replace(_scaled(_scaled(old, ("strain", "stress", "temperature"), s), ENERGIES, s**2), tips=tips)


def peak(old: Peak, s: float) -> Peak:
    """Scale a peak as the points are scaled."""
    names = ("stress", "strain", "first_break_stress", "first_break_strain", "stress_left")
    return _scaled(_scaled(old, names, s), ("dissipated",), s**2)


def _scaled(old: Record, names: tuple[str, ...], factor: float) -> Record:
    """Multiply a record's named numbers and arrays; None stays."""
    values = {name: getattr(old, name) for name in names}
    changes = {name: _times(value, factor) for name, value in values.items() if value is not None}
    return replace(old, **changes)


def _times(value: Any, factor: float) -> Any:
    """Return a number, an array, or the numbers in lists and tables multiplied."""
    if isinstance(value, Mapping):
        return {name: _times(item, factor) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_times(item, factor) for item in value]
    return np.asarray(value) * factor if isinstance(value, np.ndarray) else value * factor
