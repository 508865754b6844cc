"""Check paths and envelopes: breaks and their loads, tips, and the first break in every direction.

Not all points of result.json have a state with fields; laws of counts hold at all points.
"""

from dataclasses import replace
from itertools import pairwise, zip_longest

import numpy as np

from feti_homog.typing import Bool
from feti_homog.verify.bonds import law_at
from feti_homog.verify.check_loads import NAMES, TEMPERATURE, StateNumbers, States, damaged_at
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import CONTACT_PER_RTOL, ROUNDING, STRENGTH, Findings, Points, Section, solver_limit
from feti_homog.verify.reading import Status


def check_breaks(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check the breaks and the fracture energy of a path.  Bonds must never heal.

    A break adds the toughness times the broken length, at the mode in the state before the break; if the files lack
    this state, the energy must lie in its range over all modes.
    """
    points, by_events = cell.files.document["path"], cell.files.case["path"]["method"] == "events"
    for number, (point, after) in enumerate(pairwise(points), start=1):
        broke = (point if by_events else after)["broke"]
        findings.compare("breaks", point["bonded"] - after["bonded"], broke, 1.0, f"path[{number}].bonded")
    if by_events and points[-1]["load_factor"] == 1.0:
        findings.record("breaks", points[-1]["broke"], f"path[{len(points) - 1}], bonds that broke at the end")
    has_toughness, scale = law_at(cell.files).has_toughness, float(np.finfo(float).tiny)
    if has_toughness:
        scale = max(points[-1]["fracture_energy"], scale)
        first = np.where(by_events, points[0]["fracture_energy"] / scale, 0.0)
        findings.record("energy", first, "path[0].fracture_energy")
    for state, after in pairwise(states):
        bonded, bonded_after = (numbers.status == Status.BONDED for numbers in (state, after))
        damaged = after.damage > state.damage
        between = points[state.point : after.point] if by_events else points[state.point + 1 : after.point + 1]
        softened, stated = np.count_nonzero(bonded_after & damaged), sum(point.get("softened", 0) for point in between)
        off = abs(softened - stated) if len(between) == 1 else max(softened - stated, 0)  # a bond may soften again
        findings.record("breaks", off, f"{state.name}, bonds that softened")
        findings.record("breaks", np.count_nonzero(after.damage < state.damage), f"{after.name}, damage that healed")
        findings.record("breaks", np.count_nonzero(bonded_after & ~bonded), f"{after.name}, bonds that healed")
        broke, expected = np.count_nonzero(bonded & ~bonded_after), sum(point["broke"] for point in between)
        findings.compare("breaks", broke, expected, 1.0, f"{state.name}, bonds that broke")
        if has_toughness:
            law, damages = law_at(cell.files, damaged), (state.damage[damaged], after.damage[damaged])
            if by_events and after.point == state.point + 1:
                lower = upper = law.absorbed(law.mode(state.traction[damaged]), *damages)
            else:
                lower, upper = law.absorbed_range(*damages)
            low, high = (float(bound @ cell.files.interface.length[damaged]) / cell.area for bound in (lower, upper))
            grown = points[after.point]["fracture_energy"] - points[state.point]["fracture_energy"]
            off = max(low - grown, grown - high, 0.0) / scale
            findings.record("energy", off, f"{after.name}, fracture_energy")


def check_strength(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check that no bond exceeds its strength, except `overloaded_by_jump`.  Events must break the worst bonds."""
    points, law = cell.files.document["path"], law_at(cell.files)
    # Signs of forces and gaps are certain beyond 20 rtol.  When contact changes at constant load, other quantities then
    # move by 115 rtol (median of 276 changes), and by at most 2100 rtol.
    tolerance = max(STRENGTH, 10.0 * solver_limit(float(cell.files.document["solver"].hint("rtol"))))
    if law.has_tips:
        states = [_check_tips(findings, cell, state, points[state.point]["tips"]) for state in states]
    by_events = cell.files.case["path"]["method"] == "events"
    for state, after in zip_longest(states, states[1:]):
        used, where = np.nan_to_num(state.used), f"{state.name}, interface node {{}}".format
        overloaded = by_events & overloaded_by_jump(state, points, tolerance)
        findings.record("strength", np.where(overloaded, 0.0, np.maximum(used - 1.0, 0.0)), where)
        if not by_events:
            continue
        largest, broke = used.max(initial=1.0), damaged_at(points[state.point])
        # This point has the number of breaks, the next point their nodes: as many bonds are loaded like the worst bond.
        worst = np.sort(np.where(np.isnan(state.used), np.inf, state.used))[::-1][:broke]
        findings.record("strength", np.maximum(1.0 - worst / largest, 0.0), f"{state.name}, bonds that break")
        if after is not None and after.point == state.point + 1:
            broken = (after.damage > state.damage) & ~np.isnan(state.used)
            findings.record("strength", np.where(broken, 1.0 - state.used / largest, 0.0), where)


def overloaded_by_jump(state: StateNumbers, points: Points, tolerance: float) -> Bool:
    """Return the bonds (k,) that may exceed their strength at a point with breaks.

    In a cascade, where a break overloads other bonds, any bond may.  Where only contact has changed (strains and
    stresses agree to `tolerance`), only tips may: their energy release jumps with the contact.
    """
    if state.point == 0 or damaged_at(points[state.point]) == 0:
        return np.zeros(len(state.released), bool)
    before, now = points[state.point - 1 : state.point + 1]
    if damaged_at(before) > 0 and abs(before["load_factor"] - now["load_factor"]) <= ROUNDING:
        return np.ones(len(state.released), bool)
    is_contact_alone = damaged_at(before) == 0 and before["closed"] != now["closed"]
    for name in ("strain", "stress", TEMPERATURE):
        old, new = (np.atleast_1d(np.asarray(point.get(name) or 0.0, float)) for point in (before, now))
        is_contact_alone &= float(np.abs(old - new).max()) <= tolerance * float(np.abs(new).max())
    return np.asarray(state.released & is_contact_alone)


def _check_tips(findings: Findings, cell: DiscreteCell, state: StateNumbers, tips: Section) -> StateNumbers:
    """Check that `tips` lists the bonds beside broken bonds, with modes and energies that follow from the tractions.

    Returns the state with the utilisation sqrt(G / toughness) of tips that break by energy release; G is in the file.
    """
    # Tips are sorted by fibre, section and direction.
    node, rows = np.flatnonzero(cell.tips(state.status)), cell.files.interface
    direction = np.round(cell.bond_directions[node] / ROUNDING)
    node = node[np.lexsort((direction, rows.pair[node], rows.fibre[node]))]
    law, where, used = law_at(cell.files, node), f"{state.name}, tip {{}}".format, state.used.copy()
    psi, first, second = law.mode(state.traction[node]), np.array(tips["G_I"]), np.array(tips["G_II"])
    if len(first) == len(second) == len(node):
        used[node] = np.where(np.isnan(used[node]), np.sqrt((first + second) / law.lost(psi)), used[node])
    sections = (rows.pair[node] + 1).tolist() if len(cell.files.interfaces) > 1 else None
    is_complete = (list(tips["fibre"]), tips.get("interface")) == (rows.fibre[node].tolist(), sections)
    is_complete &= {*map(len, tips.values())} == {len(node)}
    findings.require("tables", is_complete, f"{state.name}, tips")
    if is_complete:
        difference = (np.array(tips["angle"]) - cell.bond_directions[node] + 180.0) % 360.0 - 180.0
        findings.record("tables", np.abs(difference) / 360.0, where)
        findings.compare("tables", tips["psi"], np.degrees(psi), 90.0, where)
        findings.compare("tables", first * np.sin(psi) ** 2, second * np.cos(psi) ** 2, first + second, where)
        if law.grows_by_release:
            tips.leaves_open("G_I", "G_II")
        else:
            energies = law.energies(state.traction[node])
            total = energies.sum(axis=1)[:, None]
            findings.compare("tables", np.stack([first, second], axis=1), energies, total, where)
    return replace(state, used=used)


def check_envelope(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check `envelope` by superposing the unit loads; tips that break by energy release have no utilisation."""
    document, keys, law = cell.files.document, cell.files.case["envelope"], law_at(cell.files)
    rows, points, n, status = cell.files.interface, document["envelope"], keys["directions"], states[0].status
    released = cell.tips(status) & law.grows_by_release
    may_break = (status == Status.BONDED) & ~released
    unit_loads = np.array([[*state.strain, state.temperature] for state in states]).T
    unit_tractions = np.stack([state.traction for state in states])
    findings.compare("load", len(points), n, 1.0, "envelope, number of directions")
    stiffness, temperature = np.array(document["effective_stiffness"]), float(keys.get("temperature", 0.0))
    thermal = temperature * np.array(document.get("thermal_stress", np.zeros(len(stiffness))))
    strains, stresses = NAMES[len(stiffness)]
    of_strains = keys["plane"][0] in strains
    places = [(strains if of_strains else stresses).index(name) for name in keys["plane"]]
    for number, point in enumerate(points):
        at, angle, unit = f"envelope[{number}]", 360.0 * number / len(points), np.zeros(len(stiffness))
        findings.compare("load", point["angle"], angle, 360.0, f"{at}.angle")
        unit[places] = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        has_factor = "factor" in point  # else no load in this direction breaks a bond
        imposed = unit if of_strains else np.linalg.solve(stiffness, unit)
        strain = np.array(point["strain"]) if has_factor else imposed
        shares, *_ = np.linalg.lstsq(unit_loads, np.array([*strain, temperature if has_factor else 0.0]), rcond=None)
        traction = np.asarray(np.tensordot(shares, unit_tractions, axes=1), float)
        used = np.where(may_break, law.onset(traction), 0.0)
        if not has_factor:
            noise = CONTACT_PER_RTOL * float(document["solver"].hint("rtol")) * np.abs(stiffness @ strain).max()
            over = used > law.onset(np.full_like(traction, noise))
            findings.require("onset", not over.any(), f"{at}, where a load breaks a bond")
            continue
        stress, factor = np.array(point["stress"]), float(point["factor"])
        value, terms = strain if of_strains else stress, np.abs(stiffness) @ np.abs(strain) + np.abs(thermal)
        scale = max(factor, float(np.abs(value).max()))
        findings.compare("load", value, factor * unit, scale, f"{at}, {' and '.join(keys['plane'])}")
        findings.compare("load", stress, stiffness @ strain + thermal, terms.max(), f"{at}.stress")
        # No bond exceeds its strength; the bond in the file is at its strength, and breaks as the file says.
        largest, difference = float(used.max(initial=0.0)), cell.bond_directions - point["bond_angle"]
        on_curve = (rows.fibre == point["fibre"]) & (rows.pair == point.get("interface", 1) - 1)
        nodes = np.flatnonzero(on_curve & (np.abs((difference + 180.0) % 360.0 - 180.0) < ROUNDING))
        findings.require("tables", bool(len(nodes)), f"{at}, where no bond is")
        if not len(nodes):
            continue
        is_tip, node, off = bool(released[nodes].any()), int(nodes[np.argmax(used[nodes])]), largest - 1.0
        if factor == 0.0:
            findings.record("onset", 0.0 if is_tip else max(-off, 0.0), f"{at}, by the temperature alone")
        else:
            findings.record("onset", max(off, 0.0) if is_tip else abs(off), at)
        if not is_tip:
            findings.record("strength", (largest - used[node]) / largest, f"{at}, fibre and bond_angle")
        for name, expected in law_at(cell.files, np.array([node])).breaks(traction[node : node + 1]).items():
            findings.compare("onset", point[name], expected, 90.0 if name == "psi" else 1.0, f"{at}.{name}")
