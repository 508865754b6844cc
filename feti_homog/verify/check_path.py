"""Laws of paths and envelopes: breaking bonds and their loads; the first bond of an envelope at its strength.

Fields may be kept of some points only; the others in result.json obey the same laws of counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.typing import Bool, Float
from feti_homog.verify.bonds import law_at
from feti_homog.verify.check_fields import BONDED
from feti_homog.verify.check_loads import StateNumbers, States, tips
from feti_homog.verify.check_mesh import check_first_step
from feti_homog.verify.check_points import bond_directions, tip_shares
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import STRENGTH, Findings, relative, solver_limit
from feti_homog.verify.leaves import Points
from feti_homog.verify.path_energies import check_path_energies
from feti_homog.verify.prescribed import NAMES, SAME_SHARE, TEMPERATURE, damaged_at

# Utilisations by tractions below 10 rtol of the stress are none to the program; twice as many are here.
NOISE_PER_RTOL = 20.0
# Directions of bonds are distinguished to so many degrees.
SAME_DIRECTION = 1e-6
Point = Mapping[str, Any]


class _Bonds:
    """Tractions and utilisations under any load, from the states of the unit loads."""

    def __init__(self, cell: DiscreteCell, states: States) -> None:
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


def check_envelope(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check the points of `envelope` in result.json."""
    document, asked = cell.files.document, cell.files.case["envelope"]
    points, bonds = document["envelope"], _Bonds(cell, states)
    findings.record("load", abs(len(points) - asked["directions"]), "envelope, which lacks directions or has too many")
    stiffness, temperature = np.array(document["effective_stiffness"]), float(asked.get("temperature", 0.0))
    thermal = temperature * np.array(document.get("thermal_stress", np.zeros(len(stiffness))))
    of_strains = asked["plane"][0] in NAMES[len(stiffness)][0]
    names = NAMES[len(stiffness)][0 if of_strains else 1]
    for number, point in enumerate(points):
        at = f"envelope[{number}]"
        findings.record("load", abs(point["angle"] - 360.0 * number / len(points)) / 360.0, f"{at}.angle")
        direction, unit = np.radians(360.0 * number / len(points)), np.zeros(len(stiffness))
        unit[[names.index(name) for name in asked["plane"]]] = np.cos(direction), np.sin(direction)
        if "factor" in point:  # others are zero, and stress follows from strain
            strain, stress, factor = np.array(point["strain"]), np.array(point["stress"]), float(point["factor"])
            given = strain if of_strains else stress
            off = relative(given - factor * unit, max(factor, float(np.abs(given).max())))
            findings.record("load", off, f"{at}, {' and '.join(asked['plane'])}")
            terms = np.abs(stiffness) @ np.abs(strain) + np.abs(thermal)
            findings.record("load", relative(stress - stiffness @ strain - thermal, terms.max()), f"{at}.stress")
            _check_bonds(findings, cell, bonds, point, temperature, at)
        else:
            strain = unit if of_strains else np.linalg.solve(stiffness, unit)
            least = NOISE_PER_RTOL * float(document["solver"].hint("rtol")) * np.abs(stiffness @ strain).max()
            traction = bonds.traction(strain, 0.0)
            over = bonds.used(traction) > bonds.law.onset(np.full_like(traction, least))
            findings.require("onset", not over.any(), f"{at}, where some load breaks a bond")


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
    findings.require("tables", here.any(), f"{at}, where no bond is")
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


def check_path(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """All laws of a path on its points in result.json, and on the states of those whose fields are kept."""
    points = cell.files.document["path"]
    if any(not 0 <= state.point < len(points) for state in states):  # which breaks the law of the load
        return
    by_events = cell.files.case["path"]["method"] == "events"
    if not by_events:
        check_first_step(findings, cell, points[0])
    for number, (point, after) in enumerate(pairwise(points)):
        broke = (point if by_events else after)["broke"]
        findings.record("breaks", abs(point["bonded"] - after["bonded"] - broke), f"path[{number + 1}].bonded")
    if by_events and points[-1]["load_factor"] == 1.0:
        findings.record("breaks", points[-1]["broke"], f"path[{len(points) - 1}], bonds that broke at the end")
    _check_breaks(findings, states, points, by_events)
    # Signs are sure where a force or a gap is 20 rtol beyond zero.  While contact changes at one load, all else moves
    # by 115 rtol then, the median of 276 changes, and by 2100 rtol at most.
    near = max(STRENGTH, 10.0 * solver_limit(float(cell.files.document["solver"].hint("rtol"))))
    in_full = list[StateNumbers]()
    for state in states:
        used = state.used.copy()
        if "tips" in points[state.point]:  # of which the strength is not in the fields
            node, shares = tip_shares(cell, state, points[state.point]["tips"])
            used[node] = np.where(np.isnan(used[node]), shares, used[node])
        in_full.append(replace(state, used=used))
    _check_strength(findings, in_full, points, by_events, near)
    check_path_energies(findings, cell, states, points)


def _check_breaks(findings: Findings, states: States, points: Points, by_events: bool) -> None:
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


def _check_strength(findings: Findings, states: States, points: Points, by_events: bool, near: float) -> None:
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


def _overloaded_by_jump(state: StateNumbers, points: Points, near: float) -> Bool:
    """(k,) which bonds may be over their strength where some break: all in a cascade, where one break overloads others.

    Tips where only the contact changed (strains and stresses up to `near`), with which the energy jumps that their
    break releases.
    """
    if state.point == 0 or damaged_at(points[state.point]) == 0:
        return np.zeros(len(state.used), bool)
    before, now = points[state.point - 1 : state.point + 1]
    if damaged_at(before) > 0 and abs(before["load_factor"] - now["load_factor"]) <= SAME_SHARE:
        return np.ones(len(state.used), bool)
    same = damaged_at(before) == 0 and before["closed"] != now["closed"]
    for name in ("strain", "stress", TEMPERATURE):
        here, there = (np.atleast_1d(np.asarray(point.get(name) or 0.0, float)) for point in (before, now))
        same &= float(np.abs(here - there).max()) <= near * float(np.abs(there).max())
    return np.asarray(state.released & same)
