"""Check the energies on a path: work is stored, lost where bonds break, or becomes heat by friction.

E and Sigma are all strains at a point, with a temperature as the last strain, and their conjugates; W = E.Sigma / 2 is
the stored energy.  For fixed bonds W is a convex function of E, homogeneous of degree two.  A load prescribes strains
E_s and stresses Sigma_f; its potential is

    P(E_s, Sigma_f) = min over E_f of W - Sigma_f.E_f = 1/2 (E_s.Sigma_s - Sigma_f.E_f),

convex in E_s and concave in Sigma_f.  So a state under another load with the same bonds (') bounds P: for any t >= 0

    P >= t Sigma'_s.E_s - t^2 W'   if Sigma_f = t Sigma'_f,
    P <= t^2 W' - t E'_f.Sigma_f   if E_s = t E'_s.                                                         (P)

Bonds break at constant load; the loss is P before - P after.  The files have one of these two states; (P) bounds the
other potential by the next state with the same bonds.  Both bounds are equal for proportional loads: on the first
leg, in a cascade, and on a later leg along a ray.  There the loss obeys an equation; elsewhere it lies between bounds.
Between event points without breaks the response is linear, so that the work is (Sigma + Sigma').(E' - E) / 2.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.bonds import friction_at, law_at
from feti_homog.verify.check_loads import TEMPERATURE, Prescribed, StateNumbers, States, at_points, damaged_at, targets
from feti_homog.verify.discrete_cell import ROUNDED_TERMS, DiscreteCell
from feti_homog.verify.findings import ROUNDING, Findings
from feti_homog.verify.reading import Status


@dataclass(frozen=True)
class PointNumbers:
    """The strains and stresses (n,), stored energy per area and load at a path point.

    With n = 7, the last ones are the temperature and its conjugate, NaN if unknown; `terms` scales energies per area.
    """

    name: str
    strain: Float
    stress: Float
    stored: float
    load: Prescribed
    terms: float = 0.0

    @classmethod
    def of(cls, cell: DiscreteCell, number: int, load: Prescribed, state: StateNumbers | None) -> Self:
        """Collect the numbers of a point, from its `state` if there is one, else from result.json.

        Without a state, at temperature 0, the stored energy is E.Sigma / 2, and the conjugate of temperature is NaN
        if there are expansions; at other temperatures, this conjugate follows from the stored energy in the file.
        """
        point, n = cell.files.document["path"][number], len(load.values)
        strain, stress, name = np.array(point["strain"]), np.array(point["stress"]), f"path[{number}]"
        temperature, stored, heat = float(point.get(TEMPERATURE, 0.0)), float(strain @ stress) / 2, 0.0
        if state is not None:
            name, strain, stress, temperature = state.name, state.strain, state.mean_stress, state.temperature
            stored, heat = state.stored, state.heat
        elif temperature:
            work, stored = 2 * stored, float(point["stored"])
            heat = (2 * stored - work) / temperature
        elif cell.expansions.any():
            heat = np.nan
        scales = cell.scales(strain, temperature)
        pairs = np.array([*strain, temperature][:n]), np.array([*stress, heat][:n])
        return cls(name, *pairs, stored, load, scales.stress * scales.strain)

    @property
    def potential(self) -> float:
        """Compute the potential P of the load, per area."""
        return _work(*self.pairs(by_stress=False)) / 2 - _work(*self.pairs(by_stress=True)) / 2

    def pairs(self, by_stress: bool) -> tuple[Float, Float]:
        """Return the prescribed strains (or stresses, if `by_stress`) and their conjugates."""
        kind = self.load.by_stress == by_stress
        return self.load.values[kind], (self.strain if by_stress else self.stress)[kind]


def check_stored(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check dissipation under strain control and, without temperature or friction, stored energies E.Sigma / 2."""
    points = cell.files.document["path"]
    with_fields = {state.point for state in states}
    scale = max([state.stored for state in states], default=0.0) + cell.rounded_energy
    for number, point in enumerate(points):
        if number not in with_fields and not all(point["strain"]):
            point.leaves_open("stress")  # the conjugate of a strain 0 does no work
        if not point.get(TEMPERATURE) and "friction_heat" not in point:
            work = float(np.dot(point["strain"], point["stress"])) / 2
            findings.compare("energy", point["stored"], work, scale, f"path[{number}].stored")
    by_events = cell.files.case["path"]["method"] == "events"
    # Under strain control the load never falls on the first leg of events: a break at a load below the largest so far
    # counts at the largest load, and the loss grows by the square of the ratio.
    names = "dissipated", "dissipated_strain_controlled", "load_factor", "stored"
    lost, rising, factor, stored = np.array([[point[name] for name in names] for point in points]).T
    first_leg = 1.0 / len(targets(cell.files.case)) if by_events else 0.0
    falls = (factor > 0.0) & (factor < first_leg - ROUNDING)
    rise = np.where(falls, np.maximum.accumulate(factor) / np.where(falls, factor, 1.0), 1.0)
    expected = lost[0] + np.cumsum(np.r_[0.0, rise[:-1] ** 2 * np.diff(lost)])
    scale = max(float(np.abs(expected).max()), float(np.abs(stored).max()))
    findings.compare("energy", rising, expected, scale, "path[{}].dissipated_strain_controlled".format)


def check_heat(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check that the work is stored, lost in breaks, or becomes heat.

    Heat never falls, and `dissipated` changes only in breaks.  With friction the energy depends on the path, so that
    the loss in breaks has no bounds.  Bonds break after the point of an event, and before the point of an increment.
    """
    points, by_events = cell.files.document["path"], cell.files.case["path"]["method"] == "events"
    stored = {number: float(point["stored"]) for number, point in enumerate(points)}
    stored |= {state.point: state.stored for state in states}
    terms = np.array([[p["work"], stored[n], p["dissipated"], p["friction_heat"]] for n, p in enumerate(points)])
    # Sums along the path have the rounding of their largest terms; in an increment it is far less.
    scale = np.maximum.accumulate(np.abs(terms).max(axis=1)) + np.finfo(float).tiny
    steps = np.diff(terms, axis=0, prepend=0.0)
    step_scale = np.abs(steps).max(axis=1) + ROUNDED_TERMS * scale
    findings.record("heat", np.abs(terms @ [1.0, -1.0, -1.0, -1.0]) / scale, "path[{}].work".format)
    findings.record("heat", np.maximum(-steps[:, 3], 0.0) / step_scale, "path[{}].friction_heat".format)
    breaks = np.array([damaged_at(point) for point in points])
    breaks = np.r_[0, breaks[:-1]] if by_events else breaks
    lost = np.where(breaks > 0, 0.0, np.abs(steps[:, 2]))
    findings.record("heat", lost / step_scale, "path[{}].dissipated".format)
    for before, state in pairwise(states):
        check_step_heat(findings, cell, before, state)


def check_step_heat(findings: Findings, cell: DiscreteCell, before: StateNumbers, state: StateNumbers) -> None:
    """Check the friction heat of an increment without breaks: final tractions times changes of slip.

    The error is relative to these tractions times the slips before and after the increment, plus the rounding of the
    energies.  The work in the result is no evidence: runs sum it from energies and heat.  Other steps are not checked.
    """
    files, at = cell.files, state.point
    points = files.document["path"]
    if at != before.point + 1 or damaged_at(points[at]):
        return
    if files.case["path"]["method"] == "events" or friction_at(files, on_damage=True).any():
        return
    slips = [(s.jump - law_at(files, damage=s.damage).jumps(s.traction))[:, 1] for s in (before, state)]
    rubs = (state.status == Status.CLOSED) & (friction_at(files) > 0.0)
    force = np.where(rubs, state.traction[:, 1], 0.0) * files.interface.length / cell.area
    heats, stored = ([points[number][name] for number in (before.point, at)] for name in ("friction_heat", "stored"))
    scale = np.abs(force) @ (np.abs(slips[0]) + np.abs(slips[1])) + ROUNDED_TERMS * np.abs([*heats, *stored]).max()
    made, heat = force @ (slips[1] - slips[0]), heats[1] - heats[0]
    findings.compare("heat", made, heat, scale or 1e-300, f"path[{at}].friction_heat")


def potentials(load: Prescribed, other: PointNumbers) -> tuple[float, float]:
    """Bound the potential of `load` from below and above by the state `other`; infinite if `by_stress` differs."""
    if (load.by_stress != other.load.by_stress).any():
        return -np.inf, np.inf
    (strains, stresses), (forces, answers) = other.pairs(by_stress=False), other.pairs(by_stress=True)
    load_strains, load_forces = load.values[~load.by_stress], load.values[load.by_stress]
    # Where bonds alone carried the load, the stored energy after their break is rounding.
    energy = other.stored if abs(other.stored) > ROUNDING * other.terms else 0.0
    least = _largest(_work(load_strains, stresses), energy, load_forces, forces)
    return least, -_largest(_work(load_forces, answers), energy, load_strains, strains)


def _largest(power: float, energy: float, load: Float, unit: Float) -> float:
    """Maximize t power - t^2 energy over all t >= 0 with load = t unit; return -inf if no t fits, or for NaN."""
    if not (load.any() or unit.any()):
        t = max(power / (2 * energy), 0.0) if energy > 0 else 0.0
    else:
        k = int(np.abs(unit).argmax())
        t = float(load[k] / unit[k]) if unit[k] else -1.0
        if t < 0 or not np.allclose(load, t * unit, rtol=ROUNDING, atol=0.0):
            return -np.inf
    value = t * power - t**2 * energy
    return -np.inf if np.isnan(value) else value


def _work(prescribed: Float, conjugate: Float) -> float:
    """Compute the dot product of the arguments without terms where `prescribed` is 0; `conjugate` may be NaN there."""
    return float(prescribed[prescribed != 0.0] @ conjugate[prescribed != 0.0])


def check_losses(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check the work, and the loss in breaks by (P).

    The loss is the potential with old bonds minus the potential with new bonds, at the load of the break: after an
    event point, or at the end of an increment.  In increments, Voigt's stiffness bounds the energy of old bonds, too.
    """
    points, by_events = cell.files.document["path"], cell.files.case["path"]["method"] == "events"
    of_point, loads = {state.point: state for state in states}, at_points(cell.files.case, points)
    numbers = [PointNumbers.of(cell, number, load, of_point.get(number)) for number, load in enumerate(loads)]
    scale = max(point.stored for point in numbers) + cell.rounded_energy or 1e-300
    voigt: Float = np.einsum("p,pij->ij", cell.fractions, cell.stiffnesses)
    thermal = np.einsum("p,pij,pj->i", cell.fractions, cell.stiffnesses, cell.expansions)
    square = np.einsum("p,pi,pij,pj->", cell.fractions, cell.expansions, cell.stiffnesses, cell.expansions)
    C = np.block([[voigt, -thermal[:, None]], [-thermal[None], square]])  # with the temperature as last strain
    for number, (point, now) in enumerate(zip(points, numbers, strict=True)):
        off, place = point["work"] - now.stored - point["dissipated"], f"{now.name}, work - stored - dissipated"
        findings.record("energy", abs(off) / scale, place)
        state, before = (numbers[number - 1], points[number - 1]) if number else (None, {"dissipated": 0.0})
        lost, low, high = point["dissipated"] - before["dissipated"], 0.0, 0.0
        if by_events and state:
            if damaged_at(before):
                least, largest = potentials(state.load, now)
                low, high = max(state.potential - largest, 0.0), state.potential - least
            else:  # the response is linear
                straight = _work(now.strain - state.strain, state.stress + now.stress) / 2
                off = np.nan_to_num(point["work"] - before["work"] - straight)
                findings.record("energy", abs(off) / scale, f"{now.name}, work")
        elif not by_events and damaged_at(point):
            n = len(now.strain)
            high = float(now.strain @ C[:n, :n] @ now.strain) / 2 - now.stored
            least, largest = potentials(now.load, state) if state else (-np.inf, np.inf)
            low, high = max(least - now.potential, 0.0), min(high, largest - now.potential)
        findings.record("energy", max(low - lost, lost - high, 0.0) / scale, f"{now.name}, dissipated")
