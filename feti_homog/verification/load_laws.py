"""Laws of the states as a whole: their strains are those that the case asks for, their numbers those of result.json."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.typing import AnyInt, Bool, Float
from feti_homog.verification.discrete_cell import DiscreteCell
from feti_homog.verification.elements import ElementFields
from feti_homog.verification.given_loads import GivenLoad, given_loads
from feti_homog.verification.interface_laws import BONDED, CLOSED, OPEN, spring_jumps, utilisation
from feti_homog.verification.ledger import Ledger, relative
from feti_homog.verification.reading import State

COUNTS = {"bonded": BONDED, "closed": CLOSED, "open": OPEN}
# The least scale of stresses: this share of what the largest strain makes in the bonded cell.
LEAST_STRESS = 1e-3
SPATIAL_ORDER = [0, 1, 5, 2, 4, 3]  # of the unit strains of generalized plane strain; the fifth load is a temperature


@dataclass(frozen=True)
class UnitLoad:
    """A unit strain (v,), or a unit of temperature."""

    strain: Float
    temperature: float

    def given(self, sign: float) -> GivenLoad:
        """The load, or minus it, as it is given."""
        return GivenLoad(sign * self.strain, np.zeros(len(self.strain), bool), sign * self.temperature)

    def entries(self, told: Mapping[str, Any], stiffness: str, suffix: str, sign: float) -> dict[str, Float]:
        """The stress under it, or under minus it, that is told in a column of a stiffness or in `thermal_stress`."""
        if self.temperature:
            return {"stress": sign * np.array(told[f"thermal_stress{suffix}"])}
        return {"stress": sign * np.array(told[f"{stiffness}{suffix}"]) @ self.strain}


@dataclass(frozen=True)
class Scales:
    """The largest strain, stress and change of temperature of a result."""

    strain: float
    stress: float
    temperature: float

    @property
    def triple(self) -> tuple[float, float, float]:
        """The three."""
        return self.strain, self.stress, self.temperature

    @classmethod
    def of(cls, cell: DiscreteCell, states: Sequence[StateNumbers], entries: Sequence[Mapping[str, Any]]) -> Scales:
        """Those of the states and of what result.json says."""
        strain = cell.largest_strain or 1.0
        stress = max((float(np.abs(state.stress).max()) for state in states), default=0.0)
        told = [np.abs(entry["stress"]).max() for entry in entries if "stress" in entry]
        stress = max(float(np.max(told, initial=stress)), LEAST_STRESS * float(np.abs(cell.reuss).max()) * strain)
        warmest = max((abs(state.temperature) for state in states), default=0.0)
        return cls(strain, stress, warmest or 1.0)


@dataclass(frozen=True)
class StateNumbers:
    """What the laws of paths and tables need of a state.

    Attributes:
        strain, stress: (v,) macroscopic.
        point: number of its point in `path` or `angle` of result.json.
        stored: energy per area of the cell, from the fields.
        in_springs: that of the springs in it.
        traction: (k, c) normal, tangential and along the fibres.
        used: (k,) share of the strength that the bonded nodes use, 0 elsewhere; NaN at tips of which the energy counts
            that their break would release, for it is not in the files.
        temperature: its change.
        expanding: mean of alpha : L : strain, 0 if the expansions alpha of the phases are not known.
        thermal: minus the mean of alpha : stress, on which a change of temperature works; 0 likewise.
    """

    name: str
    load_factor: float
    point: int
    strain: Float
    stress: Float
    stored: float
    in_springs: float
    traction: Float
    status: AnyInt
    used: Float
    temperature: float
    expanding: float
    thermal: float

    @classmethod
    def of(cls, cell: DiscreteCell, state: State, fields: ElementFields) -> StateNumbers:
        """Those of a state of a cell."""
        section = cell.files.case.get("interface", {})
        used = np.where(state.status == BONDED, utilisation(section, state.traction), 0.0)
        if section.get("growth") == "released":
            used[tips(cell, state.status)] = np.nan
        stretched = state.traction * spring_jumps(cell, state) * cell.files.interface.length[:, None]
        in_springs = float(stretched.sum()) / (2 * cell.area)
        thermal = _thermal(cell, state)
        stored = (fields.energy / cell.area + thermal * state.temperature) / 2
        energies = stored + in_springs, in_springs
        means = state.strain, state.mean_stress
        return cls(
            state.name, state.load_factor, state.point, *means, *energies, state.traction, state.status, used,
            state.temperature, _expanding(cell, fields), thermal,
        )  # fmt: skip


def _expanding(cell: DiscreteCell, fields: ElementFields) -> float:
    """Mean of alpha : L : strain over the cell."""
    if cell.expansions is None:
        return 0.0
    thermal = np.einsum("pij,pj->pi", cell.stiffnesses, cell.expansions)[cell.files.mesh.phase]
    return float(cell.elements.area @ (thermal * fields.strain).sum(axis=1)) / cell.area


def _thermal(cell: DiscreteCell, state: State) -> float:
    """Minus the mean of alpha : stress over the cell."""
    if cell.expansions is None:
        return 0.0
    alpha = cell.expansions[cell.files.mesh.phase]
    return -float(cell.elements.area @ (alpha * state.stress).sum(axis=1)) / cell.area


def tips(cell: DiscreteCell, status: AnyInt) -> Bool:
    """(k,) which bonds lie beside a broken one."""
    broken, beside = status != BONDED, cell.beside
    tips = np.zeros(len(broken), bool)
    for here, there in (beside.T, beside.T[::-1]):
        tips[here[broken[there]]] = True
    return np.asarray(tips & ~broken)


def check_load(ledger: Ledger, cell: DiscreteCell, states: Sequence[StateNumbers]) -> None:
    """Loads against the case, and points or columns of result.json against the states."""
    document, case = cell.files.document, cell.files.case
    same = json.loads(str(cell.files.file.attrs["case"])) == case
    ledger.record("tables", 0.0 if same else np.inf, "the case, which the two files tell otherwise")
    unit = _unit_loads(cell)
    loads, entries = list(_expected_loads(document, case, unit)), list(_entries(document, unit))
    scales = Scales.of(cell, states, entries)
    if "path" in document:
        _check_kept(ledger, document, case, [state.point for state in states])
        pairs = [(state, state.point) for state in states if 0 <= state.point < len(entries)]
    else:
        _check_all(ledger, document, states, len(loads))
        pairs = [(state, number) for number, state in enumerate(states[: len(loads)])]
    for number, (load, entry) in enumerate(zip(loads, entries, strict=False)):
        if "strain" in entry and "stress" in entry:
            told = [np.array(entry[name], float) for name in ("strain", "stress")]
            _check_given(ledger, load, (*told, entry.get("temperature", 0.0)), scales, f"point {number}")
    for state, number in pairs:
        _check_given(ledger, loads[number], (state.strain, state.stress, state.temperature), scales, state.name)
        _check_entries(ledger, state, entries[number], scales)
    for place, matrix in _linear_stiffnesses(document, cell.files.contact):
        ledger.record("symmetry", relative(matrix - matrix.T, float(np.abs(matrix).max())), place)


def _check_given(ledger: Ledger, load: GivenLoad, has: tuple[Float, Float, float], scales: Scales, where: str) -> None:
    """What is given is what strain, stress and temperature are."""
    strain, stress, temperature = has
    off = np.abs(strain - load.values)[~load.by_stress] / scales.strain
    ledger.record("load", off, where)
    ledger.record("load", abs(temperature - load.temperature) / scales.temperature, where)
    ledger.record("load stress", np.abs(stress - load.values)[load.by_stress] / scales.stress, where)


def _check_kept(ledger: Ledger, document: Mapping[str, Any], case: Mapping[str, Any], numbers: Sequence[int]) -> None:
    """The states of a path are of the points that result.json says, in their order: the first, the last, and as many
    as the case asks for."""
    count, asked = len(document["path"]), case["output"]["states"]
    told = list(document["states"]) == list(numbers)
    ledger.record("tables", 0.0 if told else np.inf, "states, which the two files tell otherwise")
    rising = all(a < b for a, b in pairwise(numbers))
    ends = len(numbers) > 0 and numbers[0] == 0 and numbers[-1] == count - 1
    ledger.record("load", 0.0 if rising and ends else np.inf, "states, which are not from the first point to the last")
    wanted = count if asked == "all" else len(numbers) if asked == "peaks" else min(asked, count)
    ledger.record("load", abs(wanted - len(numbers)), f"{len(numbers)} states, {wanted} asked for")


def _check_all(ledger: Ledger, document: Mapping[str, Any], states: Sequence[StateNumbers], count: int) -> None:
    """The states of other analyses are all that the case asks for, and know their points."""
    ledger.record("load", abs(count - len(states)), f"{len(states)} states, {count} asked for")
    each = count // len(document["angle"]) if "angle" in document else count
    off = [abs(state.point - number // each) for number, state in enumerate(states)]
    ledger.record("tables", off, lambda i: f"{states[i].name}, point")


def _check_entries(ledger: Ledger, state: StateNumbers, entries: Mapping[str, Any], scales: Scales) -> None:
    """What result.json says of a state."""
    for name, value, scale in (
        ("strain", state.strain, scales.strain),
        ("stress", state.stress, scales.stress),
        ("temperature", state.temperature, scales.temperature),
    ):
        if name in entries:
            ledger.record("tables", relative(np.array(entries[name]) - value, scale), f"{state.name}, {name}")
    if "load_factor" in entries:
        ledger.record("tables", abs(entries["load_factor"] - state.load_factor), f"{state.name}, load_factor")
    for name in COUNTS.keys() & entries.keys():
        counted = np.count_nonzero(state.status == COUNTS[name])
        ledger.record("tables", abs(entries[name] - counted), f"{state.name}, {name}")


def _unit_loads(cell: DiscreteCell) -> list[UnitLoad]:
    """The unit loads in the order of their states."""
    if not cell.files.is_spatial:
        return [UnitLoad(strain, 0.0) for strain in np.eye(3)]
    unit = [UnitLoad(strain, 0.0) for strain in np.eye(6)[SPATIAL_ORDER]]
    thermal = [] if cell.expansions is None else [UnitLoad(np.zeros(6), 1.0)]
    return [*unit[:4], *thermal, *unit[4:]]


def _expected_loads(
    document: Mapping[str, Any], case: Mapping[str, Any], unit: Sequence[UnitLoad]
) -> Iterator[GivenLoad]:
    """Those of the points of a path or a single load, or of the states of another case, in their order."""
    if "path" in document or "load" in document:
        yield from given_loads(case, document.get("path", ()))
    elif "angle" in document:
        given = case["angle"].get("strain")
        for _ in document["angle"]:
            yield from (
                [load.given(1.0) for load in unit] if given is None else [UnitLoad(np.array(given), 0.0).given(1.0)]
            )
    else:
        signs = (1.0, -1.0) if "effective_stiffness_compression" in document else (1.0,)
        yield from (load.given(sign) for sign in signs for load in unit)


def _entries(document: Mapping[str, Any], unit: Sequence[UnitLoad]) -> Iterator[Mapping[str, Any]]:
    """What result.json says of each point of a path, or of each state of another case."""
    if "path" in document:
        yield from document["path"]
    elif "load" in document:
        yield document["load"]
    elif "angle" in document:
        for point in document["angle"]:
            if "stiffness" in point:
                *others, last = (load.entries(point, "stiffness", "", 1.0) for load in unit)
                yield from others
                yield last | {name: point[name] for name in COUNTS}
            else:
                yield point
    else:
        for suffix, sign in (("", 1.0), ("_compression", -1.0)):
            if f"effective_stiffness{suffix}" in document:
                yield from (load.entries(document, "effective_stiffness", suffix, sign) for load in unit)


def _linear_stiffnesses(document: Mapping[str, Any], contact: bool) -> Iterator[tuple[str, Float]]:
    """The stiffnesses in result.json of cells without one-sided contact, and what they are called."""
    if "effective_stiffness" in document and "effective_stiffness_compression" not in document:
        yield "effective_stiffness", np.array(document["effective_stiffness"])
    for number, point in enumerate(document.get("angle", ())):
        if "stiffness" in point and not (contact and point["open"] + point["closed"]):
            yield f"angle[{number}].stiffness", np.array(point["stiffness"])
