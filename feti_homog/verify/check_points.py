"""Laws of energies, debonded shares and tips in points of an angle or a path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.typing import Bool, Float, Int
from feti_homog.verify.bonds import law_at
from feti_homog.verify.check_fields import BONDED
from feti_homog.verify.check_loads import COUNTS, StateNumbers, States, tips
from feti_homog.verify.check_mesh import directions, from_centre
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.leaves import Points, Section
from feti_homog.verify.prescribed import NAMES

Point = Mapping[str, Any]
# To so many digits directions of tips are distinguished.
DIRECTION_DIGITS = 9
# Tips of arcs are nodes, up to the rounding of directions; modes are separated over this share of the radius at least.
AT_NODE, MODE_LENGTH = 1e-6, 1e-3
# Under which there are release rates.
LOADS = [sign + name for sign in ("", "-") for name in (*NAMES[3][0], "strain")]


def check_points(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check the numbers of points beside their strains, stresses and counts."""
    document = cell.files.document
    points: Points = document.get("path") or document.get("angle") or ([document["load"]] if "load" in document else [])
    known = [state for state in states if 0 <= state.point < len(points)]
    scale = max([state.stored for state in known], default=0.0) + cell.rounded_energy
    for state in known:
        _check_state(findings, cell, state, points[state.point], scale)
    for number, point in enumerate(points):
        count = sum(point[name] for name in COUNTS)
        findings.record("tables", abs(count - len(cell.files.interface.points)), f"point {number}, {', '.join(COUNTS)}")
    if "path" in document:
        _check_path(findings, cell, known, points, scale)
        return
    for number, point in enumerate([document, *points], start=-1):
        _check_rates(findings, cell, point.get("tips"), f"point {number}")


def _check_path(findings: Findings, cell: DiscreteCell, known: States, points: Points, scale: float) -> None:
    """Check the energies of all points of a path, and the tips of points with fields."""
    kept = {state.point for state in known}
    for number, point in enumerate(points):
        if number not in kept and not all(point["strain"]):
            point.leaves_open("stress")  # what works on no strain stores nothing
        if not point.get("temperature") and "friction_heat" not in point:
            off = point["stored"] - float(np.dot(point["strain"], point["stress"])) / 2
            findings.record("energy", relative(np.array(off), scale), f"path[{number}].stored")
    law = law_at(cell.files)
    if law.has_toughness:
        _check_toughness(findings, cell, known, points, cell.files.case["path"]["method"] == "events")
        for state in known if law.has_tips else ():
            _check_tips(findings, cell, state, points[state.point]["tips"])


def tip_shares(cell: DiscreteCell, state: StateNumbers, given: Mapping[str, Sequence[float]]) -> tuple[Int, Float]:
    """(t,) the tips of a state, by fibre and direction, and sqrt(G / G_c) by the rates in the file.

    None, if of other tips.
    """
    node = _tips_in_order(cell, state)
    law = law_at(cell.files, node)
    if len(given["G_I"]) != len(node) or len(given["G_II"]) != len(node):
        return node[:0], np.zeros(0)
    energy = np.array(given["G_I"]) + np.array(given["G_II"])
    return node, np.sqrt(energy / law.lost(law.mode(state.traction[node])))


def _tips_in_order(cell: DiscreteCell, state: StateNumbers) -> Int:
    node = np.flatnonzero(tips(cell, state.status))
    turned = np.round(bond_directions(cell)[node], DIRECTION_DIGITS)
    rows = cell.files.interface
    return np.asarray(node[np.lexsort((turned, rows.pair[node], rows.fibre[node]))])


def bond_directions(cell: DiscreteCell) -> Float:
    """(k,) in degrees, in (-180, 180], about the centres of the fibres; of the normal where there is none."""
    n1, n2 = cell.files.interface.normal.T
    about = directions(cell)
    found = np.where(np.isnan(about), np.degrees(np.arctan2(n2, n1)), about)
    return np.asarray(found + 360.0 * (np.round(found, DIRECTION_DIGITS) <= -180.0))


def _check_state(findings: Findings, cell: DiscreteCell, state: StateNumbers, point: Point, scale: float) -> None:
    """Check the energies of a point, and the lengths of what has debonded and of what is damaged."""
    for name, stored in {"stored": state.stored, "stored_in_springs": state.in_springs}.items():
        if name in point:
            findings.record("energy", relative(np.array(point[name] - stored), scale), f"{state.name}, {name}")
    rows = cell.files.interface
    softened = (state.damage > 0.0) & (state.damage < 1.0)
    expected = {"debonded_length": _of_fibres(cell, state.status != BONDED)}
    expected |= {"damaged_length": _of_fibres(cell, softened)} if "damaged_length" in point else {}
    if len(cell.files.interfaces) > 1:
        own = rows.length[:, None] * (rows.pair[:, None] == np.arange(len(cell.files.interfaces)))
        expected["debonded_shares"] = (state.status != BONDED) @ own / own.sum(axis=0)
    longest = float(_of_fibres(cell, np.ones(len(rows.length), bool)).max(initial=0.0))
    for name, value in expected.items():
        _compare(findings, point, name, value, 1.0 if name == "debonded_shares" else longest, state.name)


def _of_fibres(cell: DiscreteCell, nodes: Bool) -> Float:
    """(f,) length of each fibre's interfaces that these nodes (k,) have."""
    rows = cell.files.interface
    return np.asarray(np.bincount(rows.fibre - 1, rows.length * nodes, len(cell.files.fibres.radius)), float)


def _compare(findings: Findings, point: Point, name: str, value: Float, scale: float, where: str) -> None:
    given = np.array(point.get(name, np.nan), float)
    off = given - value if given.shape == np.shape(value) else np.array(np.inf)
    findings.record("tables", relative(off, scale or 1.0), f"{where}, {name}")


def _check_rates(findings: Findings, cell: DiscreteCell, given: Section | None, where: str) -> None:
    """Check that release rates agree with each other, and that tips and the lengths behind them are on the mesh."""
    if given is None:
        return
    rows, about, at = cell.files.interface, bond_directions(cell), f"{where}, tip {{}}".format
    table = {name: np.array(given[name]) for name in ("G", "G_I", "G_II", "psi", "length", "angle", "fibre", "load")}
    G, first, second, psi, length, angle, number, load = table.values()
    pair, turn = np.array(given.get("interface", np.ones(len(G)))), np.radians(psi)
    findings.record("rates", relative(G - first - second, np.abs(G)), at)
    findings.record("rates", relative(first * np.sin(turn) ** 2 - second * np.cos(turn) ** 2, np.abs(G)), at)
    findings.record("rates", np.where(np.isin(load, LOADS), 0.0, np.inf), at)
    for t in range(len(G)):
        own = (rows.fibre == number[t]) & (rows.pair == pair[t] - 1)
        # A coating has the number of its fibre and another radius.
        away = from_centre(rows.points[own], cell.files.fibres.centre[rows.fibre[own] - 1], cell.files.size)
        radius = float(np.median(np.hypot(*away.T))) if own.any() else np.nan
        chords = np.append(2 * radius * np.abs(np.sin(np.radians(about[own] - angle[t]) / 2)), MODE_LENGTH * radius)
        off = np.abs(chords - length[t]).min() / length[t] + (chords[:-1].min(initial=np.inf) > AT_NODE * radius)
        findings.record("rates", max(off - AT_NODE, 0.0), at(t))


def _check_toughness(findings: Findings, cell: DiscreteCell, states: States, points: Points, by_events: bool) -> None:
    """Check that the fracture energy grows with the length that breaks.

    It grows by G_c in the mode of the state before, if the files have that state, otherwise by between G_Ic and G_c in
    pure shear.
    """
    length = cell.files.interface.length / cell.area
    scale = max(points[-1]["fracture_energy"], 1e-300)
    findings.record("energy", points[0]["fracture_energy"] * by_events / scale, "path[0].fracture_energy")
    for state, after in pairwise(states):
        grown = points[after.point]["fracture_energy"] - points[state.point]["fracture_energy"]
        broken = after.damage > state.damage
        law, damages = law_at(cell.files, broken), (state.damage[broken], after.damage[broken])
        if by_events and after.point == state.point + 1:
            bounds = (law.taken(law.mode(state.traction[broken]), *damages),) * 2
        else:
            bounds = law.taken_between(*damages)
        low, high = (float(energies @ length[broken]) for energies in bounds)
        off = max(low - grown, grown - high, 0.0)
        findings.record("energy", off / scale, f"{after.name}, fracture_energy")


def _check_tips(findings: Findings, cell: DiscreteCell, state: StateNumbers, given: Section) -> None:
    """Check that tips are the bonds beside broken ones, in the mode of their tractions.

    With springs also their energy.
    """
    node = _tips_in_order(cell, state)
    law = law_at(cell.files, node)
    fibre, where = cell.files.interface.fibre[node], f"{state.name}, tip {{}}".format
    pair = (cell.files.interface.pair[node] + 1).tolist() if len(cell.files.interfaces) > 1 else None
    if (list(given["fibre"]), given.get("interface")) != (fibre.tolist(), pair) or any(
        len(values) != len(node) for values in given.values()
    ):
        findings.record("tables", np.inf, f"{state.name}, tips")
        return
    psi = law.mode(state.traction[node])
    away = (np.array(given["angle"]) - bond_directions(cell)[node] + 180.0) % 360.0 - 180.0
    findings.record("tables", np.abs(away) / 360.0, where)
    findings.record("tables", np.abs(np.array(given["psi"]) - np.degrees(psi)) / 90.0, where)
    first, second = np.array(given["G_I"]), np.array(given["G_II"])
    findings.record("tables", relative(first * np.sin(psi) ** 2 - second * np.cos(psi) ** 2, first + second), where)
    if law.grows_by_release:
        for name in ("G_I", "G_II"):
            given.leaves_open(name)
    else:
        own = law.energies(state.traction[node])
        off = np.abs(np.stack([first, second], axis=1) - own).max(axis=1, initial=0.0)
        findings.record("tables", relative(off, own.sum(axis=1)), where)
