"""Laws of energies, debonded shares and tips in points of an angle or a path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.typing import Float, Int
from feti_homog.verify.bonds import law_at
from feti_homog.verify.check_fields import BONDED
from feti_homog.verify.check_loads import StateNumbers, tips
from feti_homog.verify.check_mesh import directions
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, relative

Point = Mapping[str, Any]
# To so many digits directions of tips are distinguished.
DIRECTION_DIGITS = 9


def check_points(findings: Findings, cell: DiscreteCell, states: Sequence[StateNumbers]) -> None:
    """Check the numbers of points beside their strains, stresses and counts."""
    document = cell.files.document
    single = [document["load"]] if "load" in document else []
    points: Sequence[Point] = document.get("path") or document.get("angle") or single
    known = [state for state in states if 0 <= state.point < len(points)]
    scale = max([state.stored for state in known], default=0.0) + cell.rounded_energy
    for state in known:
        point = points[state.point]
        _check_debonding(findings, cell, state, point)
        for name in {"stored", "stored_in_springs"} & point.keys():
            own = state.stored if name == "stored" else state.in_springs
            findings.record("energy", relative(np.array(point[name] - own), scale), f"{state.name}, {name}")
    if "path" in document:
        _check_path(findings, cell, known, points, scale)


def _check_path(
    findings: Findings, cell: DiscreteCell, known: Sequence[StateNumbers], points: Sequence[Point], scale: float
) -> None:
    """Check the energies of all points of a path, and the tips of points with fields."""
    for number, point in enumerate(points):
        if not point.get("temperature") and "friction_heat" not in point:
            off = point["stored"] - float(np.dot(point["strain"], point["stress"])) / 2
            findings.record("energy", relative(np.array(off), scale), f"path[{number}].stored")
    law = law_at(cell.files)
    if law.has_toughness:
        _check_ratios(findings, points)
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


def _check_debonding(findings: Findings, cell: DiscreteCell, state: StateNumbers, point: Point) -> None:
    """Lengths and angles of what has debonded."""
    rows, fibres = cell.files.interface, cell.files.fibres
    softened = (state.damage > 0.0) & (state.damage < 1.0)
    whole, debonded, damaged = (
        np.bincount(rows.fibre - 1, weights, len(fibres.radius))
        for weights in (rows.length, rows.length * (state.status != BONDED), rows.length * softened)
    )
    coated = np.bincount(rows.fibre - 1, rows.body != fibres.body[rows.fibre - 1], len(fibres.radius)) > 0
    radius = np.where(coated, np.nan, fibres.radius)
    angle = np.where(np.isnan(radius), 360.0 * debonded / np.where(whole > 0, whole, 1.0), 0.0)
    angle += np.where(np.isnan(radius), 0.0, np.degrees(debonded / radius))
    share = debonded.sum() / (whole.sum() or 1.0)
    expected = {"debonded_length": debonded, "debonding_angle": np.nan_to_num(angle), "debonded_share": share}
    scales = {"debonded_length": float(whole.max(initial=0.0)), "debonding_angle": 360.0}
    if "damaged_length" in point:
        expected["damaged_length"], scales["damaged_length"] = damaged, scales["debonded_length"]
    if len(cell.files.interfaces) > 1:
        expected["debonded_shares"] = _shares_of_pairs(cell, state)
    for name, value in expected.items():
        given = np.array(point.get(name, np.nan), float)
        off = given - value if given.shape == np.shape(value) else np.array(np.inf)
        findings.record("tables", relative(off, scales.get(name, 1.0)), f"{state.name}, {name}")


def _shares_of_pairs(cell: DiscreteCell, state: StateNumbers) -> Float:
    """(sections,) debonded length / length of the interfaces of each section."""
    rows, count = cell.files.interface, len(cell.files.interfaces)
    own = rows.pair[:, None] == np.arange(count)
    return np.asarray((rows.length * (state.status != BONDED)) @ own / (rows.length @ own))


def _check_ratios(findings: Findings, points: Sequence[Point]) -> None:
    for number, point in enumerate(points):
        energy = point["fracture_energy"]
        given, own = point.get("dissipation_ratio", 0.0), point["dissipated"] / energy if energy else 0.0
        findings.record("tables", abs(given - own) / max(abs(own), 1.0), f"path[{number}].dissipation_ratio")


def _check_toughness(
    findings: Findings, cell: DiscreteCell, states: Sequence[StateNumbers], points: Sequence[Point], by_events: bool
) -> None:
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


def _check_tips(
    findings: Findings, cell: DiscreteCell, state: StateNumbers, given: Mapping[str, Sequence[float]]
) -> None:
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
    if not law.grows_by_release:
        own = law.energies(state.traction[node])
        off = np.abs(np.stack([first, second], axis=1) - own).max(axis=1, initial=0.0)
        findings.record("tables", relative(off, own.sum(axis=1)), where)
