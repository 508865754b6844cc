"""Laws of the energies of a path: the work of the loads is stored, or lost where bonds break.

Notation: E and Sigma are all strains of a point, a temperature among them, and what works on each; W = E.Sigma / 2 is
the stored energy.  With the bonds as they are W is a convex function of E, homogeneous of degree two.  A load gives the
strains E_s and the stresses Sigma_f; its potential is

    P(E_s, Sigma_f) = min over E_f of W - Sigma_f.E_f = 1/2 (E_s.Sigma_s - Sigma_f.E_f),

convex in E_s and concave in Sigma_f, so that the state ' of another load on the same bonds bounds it: for any t >= 0

    P >= t Sigma'_s.E_s - t^2 W'   if Sigma_f = t Sigma'_f,
    P <= t^2 W' - t E'_f.Sigma_f   if E_s = t E'_s.                                                         (P)

Bonds break at constant load and lose P before - P after.  Of these one is that of a state in the files; (P) bounds the
other one by the state beyond, on both sides the same where the loads are in proportion: on the whole first leg, in a
cascade, and where a later leg is on a ray.  There what is lost is an equation; elsewhere it lies between bounds.
Between points of events at which nothing breaks the response is straight, so the work is (Sigma + Sigma').(E' - E) / 2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.check_loads import States
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.leaves import Points
from feti_homog.verify.prescribed import SAME_SHARE, TEMPERATURE, Prescribed, at_points, damaged_at, targets

# Loads whose components differ by so much, relatively, are in proportion.
SAME_RATIO = 1e-9
# A share of the energy of the bonded cell below which what a parted one stores is rounding.
NO_ENERGY = 1e-9
# A share of the energies of a path up to a point below which those of a step are rounding.
LEAST_STEP = 1e-6
Point = Mapping[str, Any]
UNLOADED = {"friction_heat": 0.0, "dissipated": 0.0, "broke": 0}


class Loads(NamedTuple):
    """Strains (v,) and a change of temperature."""

    strain: Float
    temperature: float


@dataclass(frozen=True)
class PointNumbers:
    """Strains and stresses (n,), with the temperature and what works on it, NaN where no file has it; energies.

    `load` is what is prescribed, `terms` the energy per area of which the stored one is summed at least.
    """

    name: str
    strain: Float
    stress: Float
    stored: float
    load: Prescribed
    terms: float = 0.0

    @property
    def potential(self) -> float:
        """Per area, of the load."""
        return _work(*self.given) / 2 - _work(*self.answered) / 2

    @property
    def given(self) -> tuple[Float, Float]:
        """(s,) the strains that are given, and what works on them."""
        own = ~self.load.by_stress
        return self.load.values[own], self.stress[own]

    @property
    def answered(self) -> tuple[Float, Float]:
        """(f,) the stresses that are given, and the strains on which they work."""
        own = self.load.by_stress
        return self.load.values[own], self.strain[own]


def check_path_energies(findings: Findings, cell: DiscreteCell, states: States, points: Points) -> None:
    """`work`, `stored` and what was dissipated at all points; fields are kept of those of `states`."""
    by_events = cell.files.case["path"]["method"] == "events"
    _check_rising(findings, points, 1.0 / len(targets(cell.files.case)) if by_events else 0.0)
    if "friction_heat" in points[0]:
        _check_heat(findings, states, points, by_events)
        return
    numbers = _numbers(cell, states, points)
    scale = max(each.stored for each in numbers) + cell.rounded_energy or 1e-300
    for each, point in zip(numbers, points, strict=True):
        off = point["work"] - each.stored - point["dissipated"]
        findings.record("energy", abs(off) / scale, f"{each.name}, work less stored and dissipated")
    if by_events:
        _check_events(findings, numbers, points, scale)
    else:
        C: Float = np.einsum("p,pij->ij", cell.fractions, cell.stiffnesses)  # Voigt's, of strains and temperature
        if cell.files.is_spatial:
            alpha = np.zeros(cell.stiffnesses.shape[:2]) if cell.expansions is None else cell.expansions
            thermal = np.einsum("p,pij,pj->i", cell.fractions, cell.stiffnesses, alpha)
            square = np.einsum("p,pi,pij,pj->", cell.fractions, alpha, cell.stiffnesses, alpha)
            C = np.block([[C, -thermal[:, None]], [-thermal[None], square]])
        _check_increments(findings, C, numbers, points, scale)


def _check_rising(findings: Findings, points: Points, first_leg: float) -> None:
    """Check what is lost if the load only rises on the first leg of events, which ends at the load factor `first_leg`.

    Breaks at a load below the largest so far lose as much more as energies grow up to that.
    """
    names = "dissipated", "dissipated_strain_controlled", "load_factor"
    lost, rising, load = np.array([[point[name] for name in names] for point in points]).T
    falls = (load > 0.0) & (load < first_leg - SAME_SHARE)
    rise = np.where(falls, np.maximum.accumulate(load) / np.where(falls, load, 1.0), 1.0)
    expected = lost[0] + np.cumsum(np.r_[0.0, rise[:-1] ** 2 * np.diff(lost)])
    scale = max(float(np.abs(expected).max()), *(abs(point["stored"]) for point in points))
    findings.record("energy", relative(rising - expected, scale), "path[{}].dissipated_strain_controlled".format)


def _check_heat(findings: Findings, states: States, points: Points, by_events: bool) -> None:
    """Check that the work is stored, lost to breaks or heat, which never falls; breaks alone lose what is `dissipated`.

    With friction the energy depends on the way, so nothing bounds what breaks lose.  Bonds break behind a point of
    events, before one of increments.
    """
    stored = {number: float(point["stored"]) for number, point in enumerate(points)}
    stored |= {state.point: state.stored for state in states}
    terms = np.array([[p["work"], stored[n], p["dissipated"], p["friction_heat"]] for n, p in enumerate(points)])
    # Sums along the path have the rounding of what they were; its share in an increment is far less.
    scale = np.maximum.accumulate(np.abs(terms).max(axis=1)) + np.finfo(float).tiny
    of_step = np.abs(np.diff(terms, axis=0, prepend=0.0)).max(axis=1) + LEAST_STEP * scale
    off = np.abs(terms @ [1.0, -1.0, -1.0, -1.0]) / scale
    findings.record("heat", off, "path[{}].work".format)
    for number, (before, after) in enumerate(pairwise([UNLOADED, *points])):
        cooled = before["friction_heat"] - after["friction_heat"]
        findings.record("heat", max(cooled, 0.0) / of_step[number], f"path[{number}].friction_heat")
        lost = after["dissipated"] - before["dissipated"]
        left = 0.0 if damaged_at(before if by_events else after) else abs(lost)
        findings.record("heat", left / of_step[number], f"path[{number}].dissipated")


def _numbers(cell: DiscreteCell, states: States, points: Points) -> list[PointNumbers]:
    """Return those of every point, the energy from the fields where they are kept, else by Hill E.Sigma / 2.

    What works on a temperature follows from what is stored.
    """
    kept, found = {state.point: state for state in states}, []
    for number, (point, load) in enumerate(zip(points, at_points(cell.files.case, points), strict=True)):
        strain, stress = np.array(point["strain"]), np.array(point["stress"])
        warmer, name = float(point.get(TEMPERATURE, 0.0)), f"path[{number}]"
        if (state := kept.get(number)) is not None:
            name, strain, stress, warmer = state.name, state.strain, state.stress, state.temperature
            stored, heat = state.stored, state.heat
        elif warmer:
            stored = float(point["stored"])
            heat = (2 * stored - float(strain @ stress)) / warmer
        else:
            stored, heat = float(strain @ stress) / 2, 0.0 if cell.expansions is None else np.nan
        n, terms = len(load.values), cell.energy_terms(Loads(strain, warmer))
        pairs = np.array([*strain, warmer][:n]), np.array([*stress, heat][:n])
        found.append(PointNumbers(name, *pairs, stored, load, terms))
    return found


def _check_events(findings: Findings, numbers: Sequence[PointNumbers], points: Points, scale: float) -> None:
    """Check that the energy lost between two points is lost by the bonds that break at the first of them."""
    findings.record("energy", abs(points[0]["dissipated"]) / scale, f"{numbers[0].name}, dissipated")
    for (state, before), (after, now) in pairwise(zip(numbers, points, strict=True)):
        low, high = 0.0, 0.0
        if damaged_at(before):
            least, most = potentials(state.load, after)
            low, high = max(state.potential - most, 0.0), state.potential - least
        lost = now["dissipated"] - before["dissipated"]
        findings.record("energy", max(low - lost, lost - high, 0.0) / scale, f"{after.name}, dissipated")
        if damaged_at(before) == 0:
            straight = _work(after.strain - state.strain, state.stress + after.stress) / 2
            off = np.nan_to_num(now["work"] - before["work"] - straight)
            findings.record("energy", abs(off) / scale, f"{after.name}, work")


def potentials(load: Prescribed, other: PointNumbers) -> tuple[float, float]:
    """Return the least and the largest potential at a load with the bonds of another state, by (P)."""
    if (load.by_stress != other.load.by_stress).any():
        return -np.inf, np.inf
    (strains, stresses), (forces, answers) = other.given, other.answered
    own_strains, own_forces = load.values[~load.by_stress], load.values[load.by_stress]
    energy = other.stored if abs(other.stored) > NO_ENERGY * other.terms else 0.0
    least = _largest(_work(own_strains, stresses), energy, own_forces, forces)
    return least, -_largest(_work(own_forces, answers), energy, own_strains, strains)


def _largest(power: float, energy: float, one: Float, other: Float) -> float:
    """max t power - t^2 energy over the t >= 0 with one = t other; -inf if there is none, or power is not known."""
    if not (one.any() or other.any()):
        t = max(power / (2 * energy), 0.0) if energy > 0 else 0.0
    else:
        k = int(np.abs(other).argmax())
        t = float(one[k] / other[k]) if other[k] else -1.0
        if t < 0 or not np.allclose(one, t * other, rtol=SAME_RATIO, atol=0.0):
            return -np.inf
    value = t * power - t**2 * energy
    return -np.inf if np.isnan(value) else value


def _work(one: Float, other: Float) -> float:
    """one.other, where what is not known counts only if it works."""
    return float(one[one != 0.0] @ other[one != 0.0])


def _check_increments(
    findings: Findings, stiffest: Float, numbers: Sequence[PointNumbers], points: Points, scale: float
) -> None:
    """Check the energy lost at the load of each step: the potential of the old bonds, by (P), less that of the new.

    The strain of the new ones in bonded phases stores no less than the old bonds would have.
    """
    total = 0.0
    for number, (point, now) in enumerate(zip(points, numbers, strict=True)):
        lost, low, high = point["dissipated"] - total, 0.0, 0.0
        if damaged_at(point):
            n = len(now.strain)
            high = float(now.strain @ stiffest[:n, :n] @ now.strain) / 2 - now.stored
            least, most = potentials(now.load, numbers[number - 1]) if number else (-np.inf, np.inf)
            low, high = max(least - now.potential, 0.0), min(high, most - now.potential)
        findings.record("energy", max(low - lost, lost - high, 0.0) / scale, f"{now.name}, dissipated")
        total = point["dissipated"]
