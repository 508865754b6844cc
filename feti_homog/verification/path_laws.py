"""Laws of a path of load: which bonds break and when, and what becomes of the work.

Notation: E, Sigma and W = 1/2 E.Sigma are strain, stress and stored energy of a point, t its load on the first leg.
With the bonds as they are the energy is a convex function of E, homogeneous of degree two, so that for any two strains

    W(E) >= (Sigma'.E)^2 / (4 W')   if Sigma'.E > 0, and W(t E') = t^2 W' for t > 0.                        (C)

Bonds break at constant strain and lose W before - W after.  Of these one is the energy of a state in the files; (C)
bounds the other one from below by the state beyond, exactly where both strains have the same direction: on the whole
first leg.  There work = stored + dissipated is an equation; on other legs what was dissipated lies between bounds.
Fields may be kept of some points only; what result.json says of the others obeys the same laws of counts and energy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.typing import Bool, Float
from feti_homog.verification.discrete_cell import DiscreteCell
from feti_homog.verification.interface_laws import BONDED
from feti_homog.verification.ledger import Ledger
from feti_homog.verification.load_laws import StateNumbers
from feti_homog.verification.point_laws import tip_shares

SAME_LOAD = 1e-12
Point = Mapping[str, Any]


@dataclass(frozen=True)
class PointNumbers:
    """What the laws of energy need of a point: its strain and stress, and the energy that it stores per area."""

    name: str
    strain: Float
    stress: Float
    stored: float


def check_path(ledger: Ledger, cell: DiscreteCell, states: Sequence[StateNumbers]) -> None:
    """All laws of a path on its points in result.json, and on the states of those whose fields are kept."""
    points = cell.files.document["path"]
    path = cell.files.case["path"]
    if any(not 0 <= state.point < len(points) for state in states):  # which breaks the law of the load
        return
    by_events = path["method"] == "events"
    _check_counts(ledger, points, by_events)
    _check_breaks(ledger, states, points, by_events)
    _check_strength(ledger, [_with_tips(cell, state, points[state.point]) for state in states], points, by_events)
    numbers = _numbers(points, states)
    if by_events:
        _check_energy(ledger, numbers, points, len(path["waypoints"]) if path.get("waypoints") else 1)
    else:
        _check_energy_of_increments(ledger, cell, numbers, points)


def _with_tips(cell: DiscreteCell, state: StateNumbers, point: Point) -> StateNumbers:
    """The state with what its point says of tips whose strength is not in the fields."""
    if "tips" not in point:
        return state
    node, shares = tip_shares(cell, state, point["tips"])
    used = state.used.copy()
    used[node] = np.where(np.isnan(used[node]), shares, used[node])
    return replace(state, used=used)


def _numbers(points: Sequence[Point], states: Sequence[StateNumbers]) -> list[PointNumbers]:
    """Those of every point, the energy from the fields where they are kept, else E.Sigma / 2 (Hill)."""
    kept = {state.point: state for state in states}
    found = []
    for number, point in enumerate(points):
        strain, stress = np.array(point["strain"]), np.array(point["stress"])
        if (state := kept.get(number)) is None:
            found.append(PointNumbers(f"path[{number}]", strain, stress, float(strain @ stress) / 2))
        else:
            found.append(PointNumbers(state.name, state.strain, state.stress, state.stored))
    return found


def _check_counts(ledger: Ledger, points: Sequence[Point], by_events: bool) -> None:
    """The number of bonds falls by those that break."""
    for number, (point, after) in enumerate(pairwise(points)):
        broke = (point if by_events else after)["broke"]
        ledger.record("breaks", abs(point["bonded"] - after["bonded"] - broke), f"path[{number + 1}].bonded")
    if by_events and points[-1]["load_factor"] == 1.0:
        ledger.record("breaks", points[-1]["broke"], f"path[{len(points) - 1}], bonds that broke at the end")


def _check_breaks(ledger: Ledger, states: Sequence[StateNumbers], points: Sequence[Point], by_events: bool) -> None:
    """The bonds of two states that follow each other differ by those that the points say broke between them."""
    shift = 0 if by_events else 1
    for state, after in pairwise(states):
        bonded, still = state.status == BONDED, after.status == BONDED
        broke = sum(point["broke"] for point in points[state.point + shift : after.point + shift])
        ledger.record("breaks", np.count_nonzero(still & ~bonded), f"{after.name}, bonds that healed")
        ledger.record("breaks", abs(np.count_nonzero(bonded & ~still) - broke), f"{state.name}, bonds that broke")


def _check_strength(ledger: Ledger, states: Sequence[StateNumbers], points: Sequence[Point], by_events: bool) -> None:
    """No bond is over its strength but in a cascade, where one break overloads others; events break the worst bonds."""
    for state in states:
        where = f"{state.name}, interface node {{}}".format
        used = np.nan_to_num(state.used)
        if not (by_events and _in_cascade(points, state.point)):
            ledger.record("strength", np.maximum(used - 1.0, 0.0), where)
        if by_events and (broke := points[state.point]["broke"]):
            # Which break, the next point tells; that so many are as near to their strength as the worst, this one does.
            due = max(float(used.max(initial=0.0)), 1.0)
            worst = np.sort(np.where(np.isnan(state.used), np.inf, state.used))[-broke:]
            ledger.record("strength", np.maximum(1.0 - worst / due, 0.0), f"{state.name}, bonds that break")
    for state, after in pairwise(states):
        if by_events and after.point == state.point + 1:
            due = max(float(np.nan_to_num(state.used).max(initial=0.0)), 1.0)
            off = np.where(_broken(state, after) & ~np.isnan(state.used), 1.0 - state.used / due, 0.0)
            ledger.record("strength", off, f"{state.name}, interface node {{}}".format)


def _in_cascade(points: Sequence[Point], number: int) -> bool:
    """Whether bonds broke at the same strain just before."""
    before = points[number - 1] if number else None
    return before is not None and before["broke"] > 0 and _same_load(before, points[number])


def _same_load(one: Point, other: Point) -> bool:
    return bool(abs(one["load_factor"] - other["load_factor"]) <= SAME_LOAD)


def _broken(state: StateNumbers, after: StateNumbers) -> Bool:
    return np.asarray((state.status == BONDED) & (after.status != BONDED))


def _least(state: PointNumbers, other: PointNumbers) -> float:
    """The least energy at the strain of `state` with the bonds of `other`, by (C)."""
    power = float(other.stress @ state.strain)
    return power**2 / (4 * other.stored) if power > 0 and other.stored > 0 else 0.0


def _check_energy(ledger: Ledger, numbers: Sequence[PointNumbers], points: Sequence[Point], legs: int) -> None:
    """Between events: what was lost is the energy before the break less that of the new bonds at the same strain."""
    scale = max(*(s.stored for s in numbers), 1e-300)
    ledger.record("energy", abs(points[0]["dissipated"]) / scale, f"{numbers[0].name}, dissipated")
    ledger.record("energy", abs(points[0]["dissipated_strain_controlled"]) / scale, f"{numbers[0].name}, dissipated")
    largest = 0.0
    for number, (before, now) in enumerate(pairwise(points)):
        on_first = legs * before["load_factor"] < 1.0 - SAME_LOAD
        largest = max(largest, before["load_factor"])
        lost = now["dissipated"] - before["dissipated"]
        low, high = _losses(numbers[number], numbers[number + 1], before, now, on_first)
        name = numbers[number + 1].name
        ledger.record("energy", max(low - lost, lost - high, 0.0) / scale, f"{name}, dissipated")
        rise = largest / before["load_factor"] if on_first and before["load_factor"] > 0 else 1.0
        off = now["dissipated_strain_controlled"] - before["dissipated_strain_controlled"] - rise**2 * lost
        ledger.record("energy", abs(off) / scale, f"{name}, dissipated_strain_controlled")


def _losses(state: PointNumbers, after: PointNumbers, before: Point, now: Point, on_first: bool) -> tuple[float, float]:
    """Least and largest energy that the breaks between two points can have lost."""
    if before["broke"] == 0:
        return 0.0, 0.0
    if _same_load(before, now) and not on_first:
        return state.stored - after.stored, state.stored - after.stored
    most = state.stored - _least(state, after)
    return most if on_first else 0.0, most


def _check_energy_of_increments(
    ledger: Ledger, cell: DiscreteCell, numbers: Sequence[PointNumbers], points: Sequence[Point]
) -> None:
    """At the strain of a step: what was lost is the energy of the old bonds, which (C) bounds, less that of the new."""
    scale = max(*(s.stored for s in numbers), 1e-300)
    stiffest = np.einsum("p,pij->ij", cell.fractions, cell.stiffnesses)
    total = 0.0
    for number, (point, now) in enumerate(zip(points, numbers, strict=False)):
        lost, low, high = point["dissipated"] - total, 0.0, 0.0
        if point["broke"]:
            high = float(now.strain @ stiffest @ now.strain) / 2 - now.stored
            low = max(_least(now, numbers[number - 1]) - now.stored, 0.0) if number else 0.0
        ledger.record("energy", max(low - lost, lost - high, 0.0) / scale, f"{now.name}, dissipated")
        off = point["dissipated_strain_controlled"] - point["dissipated"]
        ledger.record("energy", abs(off) / scale, f"{now.name}, dissipated_strain_controlled")
        total = point["dissipated"]
