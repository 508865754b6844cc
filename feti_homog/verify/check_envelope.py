"""Laws of an envelope: loads are in its plane, and from the tractions under the unit loads the first bond is at its
strength there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.bonds import law_at
from feti_homog.verify.check_interfaces import BONDED
from feti_homog.verify.check_loads import StateNumbers, tips
from feti_homog.verify.check_mesh import directions
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.prescribed import NAMES

# Utilisations by tractions below 10 rtol of the stress are none to the program; twice as many are here.
NOISE_PER_RTOL = 20.0
# Directions of bonds are told apart to so many degrees.
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
        return np.where(self._bonded & ~self.released, self.law.utilisation(traction), 0.0)


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
            over = bonds.used(traction) > bonds.law.utilisation(np.full_like(traction, least))
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
    told = strain if plane[0] in NAMES[len(strain)][0] else stress
    scale = max(float(point["factor"]), float(np.abs(told).max()))
    findings.record("load", relative(told - point["factor"] * unit, scale), f"{at}, {' and '.join(plane)}")
    terms = np.abs(stiffness) @ np.abs(strain) + np.abs(thermal)
    findings.record("load", relative(stress - stiffness @ strain - thermal, terms.max()), f"{at}.stress")


def _check_bonds(
    findings: Findings, cell: DiscreteCell, bonds: _Bonds, point: Point, temperature: float, at: str
) -> None:
    """No bond is over its strength, the one that is told is at it, and breaks as told."""
    traction = bonds.traction(np.array(point["strain"]), temperature)
    used = bonds.used(traction)
    largest = float(used.max(initial=0.0))
    rows = cell.files.interface
    by_normal, about_centre = np.degrees(np.arctan2(rows.normal[:, 1], rows.normal[:, 0])), directions(cell)
    away = np.where(np.isnan(about_centre), by_normal, about_centre) - point["bond_angle"]
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
