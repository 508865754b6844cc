"""The loads that a case asks for at the points of a path, or of a single load, from its sections alone."""

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
# Load factors that differ by less are one.
SAME_LOAD = 1e-12
# Loads whose directions differ by less, relatively, have one.
SAME_DIRECTION = 1e-9

Point = Mapping[str, Any]


@dataclass(frozen=True)
class GivenLoad:
    """What is given at a point.

    Attributes:
        values: (v,) strains or stresses.
        by_stress: (v,) which are stresses.
        temperature: its change.
    """

    values: Float
    by_stress: Bool
    temperature: float

    def towards(self, end: GivenLoad, share: float) -> GivenLoad:
        """The load after a share of the way to one of the same kinds."""
        values = (1 - share) * self.values + share * end.values
        return GivenLoad(values, self.by_stress, (1 - share) * self.temperature + share * end.temperature)

    def times(self, other: GivenLoad, scales: tuple[float, float, float]) -> float | None:
        """r > 0 if the other load, of the same kinds, is r times this one, else None; `scales` of strains, stresses and
        temperatures."""
        if not np.array_equal(self.by_stress, other.by_stress):
            return None
        here, there = (
            np.array([*(load.values / np.where(load.by_stress, *scales[1::-1])), load.temperature / scales[2]])
            for load in (self, other)
        )
        size = float(here @ here)
        ratio = float(here @ there) / size if size > 0 else 0.0
        off = np.abs(there - ratio * here).max()
        return ratio if ratio > 0 and off <= SAME_DIRECTION * max(np.abs(there).max(), np.abs(here).max()) else None


def given_loads(case: Mapping[str, Any], points: Sequence[Point]) -> Iterator[GivenLoad]:
    """Those of the points of a path, or of the one point under a single load."""
    targets = _targets(case)
    if "path" not in case:
        yield from targets
        return
    legs, v = len(targets), len(targets[0].values)
    none = np.zeros(v)
    start, reached, last = GivenLoad(none, targets[0].by_stress, 0.0), 0, {"strain": none, "stress": none}
    for point in points:
        along = float(point["load_factor"]) * legs
        leg = min(max(int(np.ceil(along - legs * SAME_LOAD)), 1), legs)
        if leg < legs and _ended(last, along / legs):
            leg += 1
        if leg - 1 > reached:
            start, reached = _start(targets[leg - 2], targets[leg - 1], last), leg - 1
        yield start.towards(targets[leg - 1], along - (leg - 1))
        last = dict(point)


def _ended(last: Point, load_factor: float) -> bool:
    """Whether the leg ended with the last point, so that one at the same load is of the next leg."""
    return last.get("broke") == 0 and same_load(last, {"load_factor": load_factor})


def _start(before: GivenLoad, target: GivenLoad, last: Point) -> GivenLoad:
    """The load at which a leg begins: the last waypoint, but of a component that is given in another way what the last
    point has of it."""
    has = np.where(target.by_stress, np.array(last["stress"], float), np.array(last["strain"], float))
    changed = target.by_stress != before.by_stress
    return GivenLoad(np.where(changed, has, before.values), target.by_stress, before.temperature)


def _targets(case: Mapping[str, Any]) -> list[GivenLoad]:
    """The waypoints of a path, or the single load, in full: what one does not name is that of the one before, at first
    a stress of zero."""
    section = case["path"] if "path" in case else case["load"]
    strains, stresses = NAMES[6 if case["analysis"]["plane"] == "generalized" else 3]
    found = list[GivenLoad]()
    now: dict[str, float] = dict.fromkeys(stresses, 0.0)
    for load in section.get("waypoints") or [section.get("to") or section["strain"]]:
        given = load if isinstance(load, Mapping) else dict(zip(strains, load, strict=True))
        for pair in zip(strains, stresses, strict=True):
            if not given.keys().isdisjoint(pair):
                now = {name: value for name, value in now.items() if name not in pair}
        now |= given
        by_stress = np.array([name in now for name in stresses])
        values = np.array([now.get(a, now.get(b)) for a, b in zip(strains, stresses, strict=True)], float)
        found.append(GivenLoad(values, by_stress, float(now.get("temperature", 0.0))))
    return found


def same_load(one: Point, other: Point) -> bool:
    """Whether two points of a path are at one load."""
    return bool(abs(one["load_factor"] - other["load_factor"]) <= SAME_LOAD)
