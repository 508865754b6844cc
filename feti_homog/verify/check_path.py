"""Laws of a path of load: which bonds break and when.

Fields may be kept of some points only; what result.json says of the others obeys the same laws of counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.typing import Bool
from feti_homog.verify.check_interfaces import BONDED
from feti_homog.verify.check_loads import StateNumbers
from feti_homog.verify.check_points import tip_shares
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, relative, same_state_limit
from feti_homog.verify.path_energies import check_path_energies
from feti_homog.verify.prescribed import NAMES, SAME_SHARE, TEMPERATURE

Point = Mapping[str, Any]


def check_path(findings: Findings, cell: DiscreteCell, states: Sequence[StateNumbers]) -> None:
    """All laws of a path on its points in result.json, and on the states of those whose fields are kept."""
    points = cell.files.document["path"]
    if any(not 0 <= state.point < len(points) for state in states):  # which breaks the law of the load
        return
    by_events = cell.files.case["path"]["method"] == "events"
    _check_counts(findings, points, by_events)
    _check_peak(findings, cell.files.document.get("peak"), points)
    _check_breaks(findings, states, points, by_events)
    near = same_state_limit(float(cell.files.document["solver"]["rtol"]))
    in_full = [_with_tips(cell, state, points[state.point]) for state in states]
    _check_strength(findings, in_full, points, by_events, near)
    check_path_energies(findings, cell, states, points)


def _with_tips(cell: DiscreteCell, state: StateNumbers, point: Point) -> StateNumbers:
    """Return the state with what its point says of tips whose strength is not in the fields."""
    if "tips" not in point:
        return state
    node, shares = tip_shares(cell, state, point["tips"])
    used = state.used.copy()
    used[node] = np.where(np.isnan(used[node]), shares, used[node])
    return replace(state, used=used)


def _check_counts(findings: Findings, points: Sequence[Point], by_events: bool) -> None:
    """Check that the number of bonds falls by those that break."""
    for number, (point, after) in enumerate(pairwise(points)):
        broke = (point if by_events else after)["broke"]
        findings.record("breaks", abs(point["bonded"] - after["bonded"] - broke), f"path[{number + 1}].bonded")
    if by_events and points[-1]["load_factor"] == 1.0:
        findings.record("breaks", points[-1]["broke"], f"path[{len(points) - 1}], bonds that broke at the end")


def _check_peak(findings: Findings, peak: Point | None, points: Sequence[Point]) -> None:
    """Check that the peak is the largest stress of its component, and the first break the first; older results have
    none."""
    if peak is None:
        return
    strain, stress = (
        np.array([point[kind] for point in points])[:, names.index(peak[f"{kind}_name"])]
        for names, kind in zip(NAMES[len(points[0]["stress"])], ("strain", "stress"), strict=True)
    )
    size, event = float(np.abs(stress).max()), peak["event"]
    findings.record("tables", relative(np.array(peak["stress"] - stress[event]), size), "peak.stress")
    findings.record("tables", relative(np.array(np.abs(stress[event]) - size), size), "peak.event")
    findings.record("tables", relative(np.array(peak["strain"] - strain[event]), np.abs(strain).max()), "peak.strain")
    broken = [number for number, point in enumerate(points) if point["broke"]]
    told = peak.get("first_break_event")
    findings.record("tables", 0.0 if told == next(iter(broken), None) else np.inf, "peak.first_break_event")


def _check_breaks(findings: Findings, states: Sequence[StateNumbers], points: Sequence[Point], by_events: bool) -> None:
    """Check that the bonds of consecutive states differ by those that broke between their points."""
    shift = 0 if by_events else 1
    for state, after in pairwise(states):
        bonded, still = state.status == BONDED, after.status == BONDED
        broke = sum(point["broke"] for point in points[state.point + shift : after.point + shift])
        findings.record("breaks", np.count_nonzero(still & ~bonded), f"{after.name}, bonds that healed")
        findings.record("breaks", abs(np.count_nonzero(bonded & ~still) - broke), f"{state.name}, bonds that broke")


def _check_strength(
    findings: Findings, states: Sequence[StateNumbers], points: Sequence[Point], by_events: bool, near: float
) -> None:
    """No bond is over its strength but where a jump at this load overloads it and it breaks at once.

    Events break the worst bonds.
    """
    for state in states:
        where = f"{state.name}, interface node {{}}".format
        used = np.nan_to_num(state.used)
        held = ~_overloaded_by_jump(state, points, near) if by_events else np.ones(len(used), bool)
        findings.record("strength", np.where(held, np.maximum(used - 1.0, 0.0), 0.0), where)
        if by_events and (broke := points[state.point]["broke"]):
            # Which break, the next point tells; that so many are as near to their strength as the worst, this one does.
            due = max(float(used.max(initial=0.0)), 1.0)
            worst = np.sort(np.where(np.isnan(state.used), np.inf, state.used))[-broke:]
            findings.record("strength", np.maximum(1.0 - worst / due, 0.0), f"{state.name}, bonds that break")
    for state, after in pairwise(states):
        if by_events and after.point == state.point + 1:
            due = max(float(np.nan_to_num(state.used).max(initial=0.0)), 1.0)
            off = np.where(_broken(state, after) & ~np.isnan(state.used), 1.0 - state.used / due, 0.0)
            findings.record("strength", off, f"{state.name}, interface node {{}}".format)


def _overloaded_by_jump(state: StateNumbers, points: Sequence[Point], near: float) -> Bool:
    """(k,) which bonds may be over their strength where some break: all in a cascade, where one break overloads others.

    Tips where only the contact changed, with which the energy jumps that their break releases.
    """
    if points[state.point]["broke"] == 0:
        return np.zeros(len(state.used), bool)
    if _in_cascade(points, state.point):
        return np.ones(len(state.used), bool)
    return state.released & _only_contact_changed(points, state.point, near)


def _in_cascade(points: Sequence[Point], number: int) -> bool:
    """Return whether bonds broke at the same load just before."""
    before = points[number - 1] if number else None
    return before is not None and before["broke"] > 0 and _same_load(before, points[number])


def _same_load(one: Point, other: Point) -> bool:
    return bool(abs(one["load_factor"] - other["load_factor"]) <= SAME_SHARE)


def _only_contact_changed(points: Sequence[Point], number: int, near: float) -> bool:
    """Return True if a point has bonds, strains and stresses (up to `near`) of the one before, but other contact."""
    if number == 0:
        return False
    before, now = points[number - 1], points[number]
    turned = before["broke"] == 0 and before["closed"] != now["closed"]
    return turned and all(_is_near(before.get(name), now.get(name), near) for name in ("strain", "stress", TEMPERATURE))


def _is_near(one: Any, other: Any, near: float) -> bool:
    here, there = (np.atleast_1d(np.asarray(value or 0.0, float)) for value in (one, other))
    return float(np.abs(here - there).max()) <= near * float(np.abs(there).max())


def _broken(state: StateNumbers, after: StateNumbers) -> Bool:
    return np.asarray((state.status == BONDED) & (after.status != BONDED))
