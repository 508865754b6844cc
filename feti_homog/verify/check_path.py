"""Laws of paths and envelopes: breaking bonds and their loads; the first bond of an envelope at its strength.

Fields may be kept of some points only; the others in result.json obey the same laws of counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.typing import Bool, Float
from feti_homog.verify.bonds import law_at
from feti_homog.verify.check_fields import BONDED
from feti_homog.verify.check_loads import StateNumbers, tips
from feti_homog.verify.check_points import bond_directions, tip_shares
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, relative, same_state_limit
from feti_homog.verify.path_energies import check_path_energies
from feti_homog.verify.prescribed import NAMES, SAME_SHARE, TEMPERATURE, damaged_at

# Utilisations by tractions below 10 rtol of the stress are none to the program; twice as many are here.
NOISE_PER_RTOL = 20.0
# Directions of bonds are distinguished to so many degrees.
SAME_DIRECTION = 1e-6
Point = Mapping[str, Any]


class _Bonds:
    """Tractions and utilisations under any load, from the states of the unit loads."""

    def __init__(self, cell: DiscreteCell, states: Sequence[StateNumbers]) -> None:
        self.law = law_at(cell.files)
        self._loads = np.array([[*state.strain, state.temperature] for state in states]).T
        self._unit = np.stack([state.traction for state in states])
        status = states[0].status
        self._bonded, self.released = status == BONDED, np.zeros(len(status), bool)
        if self.law.grows_by_release:
            self.released = tips(cell, status)

    def traction(self, strain: Float, temperature: float) -> Float:
        """(k, c) under a strain (v,) and a change of temperature."""
        share, *_ = np.linalg.lstsq(self._loads, np.array([*strain, temperature]), rcond=None)
        return np.tensordot(share, self._unit, axes=1)

    def used(self, traction: Float) -> Float:
        """(k,) 0 of debonded nodes, and of tips whose breaks release what is not in the files."""
        return np.where(self._bonded & ~self.released, self.law.onset(traction), 0.0)


def check_envelope(findings: Findings, cell: DiscreteCell, states: Sequence[StateNumbers]) -> None:
    """Check the points of `envelope` in result.json."""
    document, asked = cell.files.document, cell.files.case["envelope"]
    points, bonds = document["envelope"], _Bonds(cell, states)
    findings.record("load", abs(len(points) - asked["directions"]), "envelope, which lacks directions or has too many")
    stiffness, temperature = np.array(document["effective_stiffness"]), float(asked.get("temperature", 0.0))
    thermal = temperature * np.array(document.get("thermal_stress", np.zeros(len(stiffness))))
    for number, point in enumerate(points):
        at = f"envelope[{number}]"
        findings.record("load", abs(point["angle"] - 360.0 * number / len(points)) / 360.0, f"{at}.angle")
        unit = _unit(asked["plane"], np.radians(360.0 * number / len(points)), len(stiffness))
        if "factor" in point:
            _check_load(findings, point, asked["plane"], unit, (stiffness, thermal), at)
            _check_bonds(findings, cell, bonds, point, temperature, at)
        else:
            of_strains = asked["plane"][0] in NAMES[len(stiffness)][0]
            strain = unit if of_strains else np.linalg.solve(stiffness, unit)
            least = NOISE_PER_RTOL * float(document["solver"]["rtol"]) * np.abs(stiffness @ strain).max()
            traction = bonds.traction(strain, 0.0)
            over = bonds.used(traction) > bonds.law.onset(np.full_like(traction, least))
            findings.record("onset", np.inf if over.any() else 0.0, f"{at}, where some load breaks a bond")


def _unit(plane: Sequence[str], angle: float, count: int) -> Float:
    """(v,) cosine and sine at the places of the two names."""
    names = next(family for family in NAMES[count] if plane[0] in family)
    found = np.zeros(count)
    found[[names.index(name) for name in plane]] = np.cos(angle), np.sin(angle)
    return found


def _check_load(
    findings: Findings, point: Point, plane: Sequence[str], unit: Float, law: tuple[Float, Float], at: str
) -> None:
    """Check that named loads are factor times cosine and sine, others zero, and that stress follows from strain."""
    (stiffness, thermal), strain, stress = law, np.array(point["strain"]), np.array(point["stress"])
    given = strain if plane[0] in NAMES[len(strain)][0] else stress
    scale = max(float(point["factor"]), float(np.abs(given).max()))
    findings.record("load", relative(given - point["factor"] * unit, scale), f"{at}, {' and '.join(plane)}")
    terms = np.abs(stiffness) @ np.abs(strain) + np.abs(thermal)
    findings.record("load", relative(stress - stiffness @ strain - thermal, terms.max()), f"{at}.stress")


def _check_bonds(
    findings: Findings, cell: DiscreteCell, bonds: _Bonds, point: Point, temperature: float, at: str
) -> None:
    """No bond is over its strength, the one of the file is at it, and breaks as in the file."""
    traction = bonds.traction(np.array(point["strain"]), temperature)
    used = bonds.used(traction)
    largest = float(used.max(initial=0.0))
    rows = cell.files.interface
    away = bond_directions(cell) - point["bond_angle"]
    here = (rows.fibre == point["fibre"]) & (rows.pair == point.get("interface", 1) - 1)
    here &= np.abs((away + 180.0) % 360.0 - 180.0) < SAME_DIRECTION
    findings.record("tables", 0.0 if here.any() else np.inf, f"{at}, where no bond is")
    if not here.any():
        return
    is_tip = bool((here & bonds.released).any())
    if point["factor"] == 0.0:
        findings.record("onset", max(1.0 - largest, 0.0) if not is_tip else 0.0, f"{at}, of the temperature alone")
    else:
        findings.record("onset", max(largest - 1.0, 0.0) if is_tip else abs(largest - 1.0), at)
    node = int(np.flatnonzero(here)[np.argmax(used[here])])
    if not is_tip:
        findings.record("strength", (largest - used[node]) / largest, f"{at}, fibre and bond_angle")
    for name, value in law_at(cell.files, np.array([node])).breaks(traction[node : node + 1]).items():
        findings.record("onset", abs(point[name] - value) / (90.0 if name == "psi" else 1.0), f"{at}.{name}")


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
    """Return the state with the tips of its point whose strength is not in the fields."""
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
    """Check that no stress before the peak is larger, and that the first break is the first.

    Older results have none.
    """
    if peak is None:
        return
    strain, stress = (
        np.array([point[kind] for point in points])[:, names.index(peak[f"{kind}_name"])]
        for names, kind in zip(NAMES[len(points[0]["stress"])], ("strain", "stress"), strict=True)
    )
    size, event = float(np.abs(stress).max()), peak["event"]
    before = float(np.abs(stress[:event]).max(initial=0.0))
    findings.record("tables", relative(np.array(peak["stress"] - stress[event]), size), "peak.stress")
    findings.record("tables", max(before - float(abs(stress[event])), 0.0) / (size or 1.0), "peak.event")
    findings.record("tables", relative(np.array(peak["strain"] - strain[event]), np.abs(strain).max()), "peak.strain")
    broken = [number for number, point in enumerate(points) if point["broke"]]
    cut = "event_left" not in peak and points[-1]["load_factor"] < 1.0 - SAME_SHARE
    findings.record("tables", 0.0 if peak.get("so_far", cut) == cut else np.inf, "peak.so_far")
    given = peak.get("first_break_event")
    findings.record("tables", 0.0 if given == next(iter(broken), None) else np.inf, "peak.first_break_event")


def _check_breaks(findings: Findings, states: Sequence[StateNumbers], points: Sequence[Point], by_events: bool) -> None:
    """Check that the bonds of consecutive states differ by those that broke between their points."""
    shift = 0 if by_events else 1
    for state, after in pairwise(states):
        bonded, still = state.status == BONDED, after.status == BONDED
        between = points[state.point + shift : after.point + shift]
        broke = sum(point["broke"] for point in between)
        softened = np.count_nonzero(still & (after.damage > state.damage))
        most = sum(point.get("softened", 0) for point in between)
        off = abs(softened - most) if len(between) == 1 else max(softened - most, 0)
        findings.record("breaks", off, f"{state.name}, bonds that softened")
        findings.record("breaks", np.count_nonzero(after.damage < state.damage), f"{after.name}, damage that healed")
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
        if by_events and (broke := damaged_at(points[state.point])):
            # The next point has the bonds that break; here so many are as near to their strength as the worst.
            due = max(float(used.max(initial=0.0)), 1.0)
            worst = np.sort(np.where(np.isnan(state.used), np.inf, state.used))[-broke:]
            findings.record("strength", np.maximum(1.0 - worst / due, 0.0), f"{state.name}, bonds that break")
    for state, after in pairwise(states):
        if by_events and after.point == state.point + 1:
            due = max(float(np.nan_to_num(state.used).max(initial=0.0)), 1.0)
            broken = (after.damage > state.damage) & ~np.isnan(state.used)
            off = np.where(broken, 1.0 - state.used / due, 0.0)
            findings.record("strength", off, f"{state.name}, interface node {{}}".format)


def _overloaded_by_jump(state: StateNumbers, points: Sequence[Point], near: float) -> Bool:
    """(k,) which bonds may be over their strength where some break: all in a cascade, where one break overloads others.

    Tips where only the contact changed, with which the energy jumps that their break releases.
    """
    if damaged_at(points[state.point]) == 0:
        return np.zeros(len(state.used), bool)
    if _in_cascade(points, state.point):
        return np.ones(len(state.used), bool)
    return state.released & _only_contact_changed(points, state.point, near)


def _in_cascade(points: Sequence[Point], number: int) -> bool:
    """Return whether bonds broke at the same load just before."""
    if number == 0:
        return False
    before, now = points[number - 1], points[number]
    return damaged_at(before) > 0 and bool(abs(before["load_factor"] - now["load_factor"]) <= SAME_SHARE)


def _only_contact_changed(points: Sequence[Point], number: int, near: float) -> bool:
    """Return True if a point has bonds, strains and stresses (up to `near`) of the one before, but other contact."""
    if number == 0:
        return False
    before, now = points[number - 1], points[number]
    turned = damaged_at(before) == 0 and before["closed"] != now["closed"]
    return turned and all(_is_near(before.get(name), now.get(name), near) for name in ("strain", "stress", TEMPERATURE))


def _is_near(one: Any, other: Any, near: float) -> bool:
    here, there = (np.atleast_1d(np.asarray(value or 0.0, float)) for value in (one, other))
    return float(np.abs(here - there).max()) <= near * float(np.abs(there).max())
