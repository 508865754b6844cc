"""Loads that the case of a result prescribes: of every component its strain or its stress, and a temperature.

Components are those of strain, 3 or 6, and last in generalized plane strain a change of temperature, of which the
strain is given.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.typing import Bool, Float

NAMES = {
    3: (("E11", "E22", "gamma12"), ("S11", "S22", "S12")),
    6: (("E11", "E22", "E33", "gamma23", "gamma13", "gamma12"), ("S11", "S22", "S33", "S23", "S13", "S12")),
}
TEMPERATURE = "temperature"
# Shares of a leg that are not distinguished.
SAME_SHARE = 1e-12

Document = Mapping[str, Any]


@dataclass(frozen=True)
class Prescribed:
    """A load: the values (n,) of its components, and of which (n,) the stress is given."""

    values: Float
    by_stress: Bool

    @classmethod
    def strain(cls, strain: Float, temperature: float) -> Prescribed:
        """Return a strain (v,) and a change of temperature, which only generalized plane strain has."""
        values = np.array([*strain, temperature] if len(strain) > 3 else strain, float)
        return cls(values, np.zeros(len(values), bool))


def targets(case: Document) -> list[Prescribed]:
    """Return the loads that a case names, each in full.

    A component that one does not name stays, and is at first free of stress.
    """
    v = 6 if case["analysis"]["plane"] == "generalized" else 3
    n = v + (v > 3)
    strains, stresses = NAMES[v]
    places = {name: (k, False) for k, name in enumerate([*strains, TEMPERATURE][:n])}
    places |= {name: (k, True) for k, name in enumerate(stresses)}
    values, by_stress, found = np.zeros(n), np.arange(n) < v, []
    path = case.get("path", {})
    single = [path[name] for name in ("strain", "to") if path.get(name)]
    for load in [case["load"]["to"]] if "load" in case else path.get("waypoints") or single:
        values, by_stress = values.copy(), by_stress.copy()
        for name, value in (load if isinstance(load, Mapping) else dict(zip(strains, load, strict=True))).items():
            place, by_stress[places[name][0]] = places[name]
            values[place] = value
        found.append(Prescribed(values, by_stress))
    return found


def at_points(case: Document, points: Sequence[Document]) -> Iterator[Prescribed]:
    """Yield the prescribed load at every point of a path.

    The first leg has a share of its end. Later legs are straight from the last prescribed load to their end. A
    component that changes its kind begins at its value in the last point.
    """
    ends, leg, ended = targets(case), 0, False
    by_events = case["path"]["method"] == "events"
    start, last = np.zeros(len(ends[0].values)), None
    for point in points:
        along = float(point["load_factor"]) * len(ends)
        while leg < len(ends) - 1 and (ended or along > leg + 1 + SAME_SHARE):
            before, end, leg, ended = ends[leg], ends[leg + 1], leg + 1, False
            same = before.by_stress == end.by_stress
            start = before.values if last is None else np.where(same, before.values, _values(last, end.by_stress))
        share = along - leg
        yield Prescribed((1 - share) * start + share * ends[leg].values, ends[leg].by_stress)
        # After the last break at a waypoint comes its own point, at which nothing breaks.
        ended, last = abs(share - 1) <= SAME_SHARE and not (by_events and damaged_at(point)), point


def damaged_at(point: Document) -> int:
    """Count the bonds that break or soften at a point, or did in the step to it."""
    return int(point["broke"]) + int(point.get("softened") or 0)


def _values(point: Document, by_stress: Bool) -> Float:
    """Return the components (n,) of a point: its strains and temperature, or its stresses."""
    strain, stress = ([*point[name], point.get(TEMPERATURE, 0.0)][: len(by_stress)] for name in ("strain", "stress"))
    return np.where(by_stress, stress, strain)
