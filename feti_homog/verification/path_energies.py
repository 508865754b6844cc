"""Laws of a path of load: what becomes of the work.

Notation: E and Sigma are strains and stresses of a point, a change of temperature T and what it works on, minus the
mean of alpha : sigma, among them; W = 1/2 E.Sigma is its stored energy, t its load factor.  At every point

    work = stored + dissipated.                                                                              (W)

With the bonds and the contact as they are E.Sigma' = E'.Sigma of two states (Betti).  So where nothing breaks between
two points the work grows by 1/2 (Sigma + Sigma').(E' - E).  Bonds that break at constant load, between the states b and
a, lose

    1/2 (E_a.Sigma_b - E_b.Sigma_a).                                                                         (R)

b is a point.  a is the next point where that is at the same load; where the load there is r > 0 times as large the
response is homogeneous and a is 1 / r times that point: so on the whole first leg, and on others on which the load is
proportional.  Elsewhere the loss is not known from the files.  It is not negative; and where only strains are given
the energy is a convex function of E, homogeneous of degree two, so that a stores at least

    W(E) >= (Sigma'.E)^2 / (4 W')   if Sigma'.E > 0                                                          (C)

with ' the next point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.typing import Float
from feti_homog.verification.discrete_cell import DiscreteCell
from feti_homog.verification.given_loads import GivenLoad, given_loads, same_load
from feti_homog.verification.ledger import Ledger
from feti_homog.verification.load_laws import Scales, StateNumbers

SAME_LOAD = 1e-12
Point = Mapping[str, Any]


@dataclass(frozen=True)
class PointNumbers:
    """What the laws of energy need of a point.

    Attributes:
        strain, stress: (v,) macroscopic.
        temperature: its change.
        thermal: what it works on; NaN where neither fields nor the energy tell.
        stored: energy per area.
        load: what is given.
    """

    name: str
    strain: Float
    stress: Float
    temperature: float
    thermal: float
    stored: float
    load: GivenLoad

    @property
    def of_strains_alone(self) -> bool:
        """Whether no stress is given."""
        return not self.load.by_stress.any()

    def work_to(self, after: PointNumbers) -> float:
        """1/2 (Sigma + Sigma').(E' - E); NaN if it is not known."""
        warmer = after.temperature - self.temperature
        thermal = (self.thermal + after.thermal) * warmer if warmer else 0.0
        return (float((self.stress + after.stress) @ (after.strain - self.strain)) + thermal) / 2

    def released_to(self, after: PointNumbers, ratio: float) -> float:
        """(R), the state after the breaks being 1 / ratio times another point."""
        thermal = self.temperature * (self.thermal - after.thermal / ratio) if self.temperature else 0.0
        return (float(after.strain @ self.stress - self.strain @ after.stress) / ratio + thermal) / 2

    def least_at(self, strain: Float) -> float:
        """The least energy at a strain with the bonds of this point, by (C)."""
        power = float(self.stress @ strain)
        return power**2 / (4 * self.stored) if power > 0 and self.stored > 0 else 0.0


def check_energies(ledger: Ledger, cell: DiscreteCell, states: Sequence[StateNumbers]) -> None:
    """The energies of all points of a path."""
    points, path = cell.files.document["path"], cell.files.case["path"]
    numbers = _numbers(cell, points, states)
    scale = max(*(point.stored for point in numbers), 1e-300)
    for point, own in zip(points, numbers, strict=True):
        off = point["work"] - point["stored"] - point["dissipated"]
        ledger.record("energy", abs(off) / scale, f"{own.name}, work")
    if path["method"] == "events":
        legs = len(path["waypoints"]) if path.get("waypoints") else 1
        _check_events(ledger, numbers, points, legs, Scales.of(cell, states, points))
    else:
        _check_increments(ledger, cell, numbers, points)


def _numbers(cell: DiscreteCell, points: Sequence[Point], states: Sequence[StateNumbers]) -> list[PointNumbers]:
    """Those of every point, the energy from the fields where they are kept."""
    kept, found = {state.point: state for state in states}, []
    for number, (point, load) in enumerate(zip(points, given_loads(cell.files.case, points), strict=True)):
        if (state := kept.get(number)) is not None:
            own = state.strain, state.stress, state.temperature, state.thermal, state.stored
            found.append(PointNumbers(state.name, *own, load))
            continue
        strain, stress, warmer = np.array(point["strain"]), np.array(point["stress"]), point.get("temperature", 0.0)
        mechanical = float(strain @ stress)
        thermal = (2 * point["stored"] - mechanical) / warmer if warmer else np.nan
        stored = point["stored"] if warmer else mechanical / 2
        found.append(PointNumbers(f"path[{number}]", strain, stress, warmer, thermal, stored, load))
    return found


def _check_events(
    ledger: Ledger, numbers: Sequence[PointNumbers], points: Sequence[Point], legs: int, scales: Scales
) -> None:
    """What is lost between two points is what the breaks at the first one lose."""
    scale = max(*(point.stored for point in numbers), 1e-300)
    for name in ("dissipated", "dissipated_strain_controlled"):
        ledger.record("energy", abs(points[0][name]) / scale, f"{numbers[0].name}, {name}")
    largest = 0.0
    for number, (before, now) in enumerate(pairwise(points)):
        state, after = numbers[number : number + 2]
        lost = now["dissipated"] - before["dissipated"]
        if before["broke"] == 0:
            ledger.record("energy", abs(lost) / scale, f"{after.name}, dissipated")
            work = state.work_to(after)
            if np.isfinite(work):
                off = now["work"] - before["work"] - work
                ledger.record("energy", abs(off) / scale, f"{after.name}, work")
        else:
            _check_loss(ledger, (state, after), (before, now), lost / scale, (scales, scale))
        on_first = legs * before["load_factor"] < 1.0 - SAME_LOAD
        largest = max(largest, before["load_factor"])
        rise = largest / before["load_factor"] if on_first and before["load_factor"] > 0 else 1.0
        off = now["dissipated_strain_controlled"] - before["dissipated_strain_controlled"] - rise**2 * lost
        ledger.record("energy", abs(off) / scale, f"{after.name}, dissipated_strain_controlled")


def _check_loss(
    ledger: Ledger,
    pair: tuple[PointNumbers, PointNumbers],
    points: tuple[Point, Point],
    lost: float,
    scales: tuple[Scales, float],
) -> None:
    """What breaks between two points lose, as a share of the largest energy: (R), or bounds."""
    (state, after), (loads, scale), where = pair, scales, f"{pair[1].name}, dissipated"
    ratio = 1.0 if same_load(*points) else state.load.times(after.load, loads.triple)
    if ratio is None:
        ledger.record("energy", max(-lost, 0.0), where)
        if state.of_strains_alone and not state.temperature:
            most = state.stored - after.least_at(state.strain)
            ledger.record("energy", max(lost - most / scale, 0.0), where)
        return
    released = state.released_to(after, ratio) / scale
    if np.isfinite(released):  # errors of the next point are as much larger as the load is less there
        ledger.record("energy", abs(lost - released) * min(ratio, 1.0), where)


def _check_increments(
    ledger: Ledger, cell: DiscreteCell, numbers: Sequence[PointNumbers], points: Sequence[Point]
) -> None:
    """At the load of a step: what was lost is not negative and, of given strains, the energy of the old bonds, which
    (C) bounds, less that of the new."""
    scale = max(*(point.stored for point in numbers), 1e-300)
    stiffest = np.einsum("p,pij->ij", cell.fractions, cell.stiffnesses)
    total = 0.0
    for number, (point, now) in enumerate(zip(points, numbers, strict=False)):
        lost, low, high = point["dissipated"] - total, 0.0, 0.0
        if point["broke"] and now.of_strains_alone and not now.temperature:
            high = float(now.strain @ stiffest @ now.strain) / 2 - now.stored
            low = max(numbers[number - 1].least_at(now.strain) - now.stored, 0.0) if number else 0.0
        elif point["broke"]:
            high = np.inf
        ledger.record("energy", max(low - lost, lost - high, 0.0) / scale, f"{now.name}, dissipated")
        off = point["dissipated_strain_controlled"] - point["dissipated"]
        ledger.record("energy", abs(off) / scale, f"{now.name}, dissipated_strain_controlled")
        total = point["dissipated"]
