"""Laws of the states as a whole: their loads are those that the case asks for, their numbers those of result.json."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import Any

import numpy as np

from feti_homog.typing import AnyInt, Bool, Float
from feti_homog.verify.bonds import energy_of_springs, held_traction, law_at
from feti_homog.verify.cell_tables import State
from feti_homog.verify.check_fields import BONDED, CLOSED, OPEN
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.elements import ElementFields
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.prescribed import TEMPERATURE, Prescribed, at_points, targets

COUNTS = {"bonded": BONDED, "closed": CLOSED, "open": OPEN}
LAST_OF_PLANE = 2  # place of gamma12 among the unit loads: the state that the counts of an angle are of
SPATIAL_ORDER = [0, 1, 5, 2, 4, 3]  # of the unit strains of generalized plane strain; the fifth load is a temperature


@dataclass(frozen=True)
class StateNumbers:
    """Numbers of a state that the laws of paths and tables need.

    Attributes:
        strain, stress: (v,) macroscopic.
        point: number of its point in `path` or `angle` of result.json.
        stored: energy per area of the cell, <sigma : (eps - alpha T)> / 2 and that of the springs, from the fields.
        in_springs: that of the springs in it.
        traction: (k, c) normal, tangential and along the fibres.
        released: (k,) which bonds are tips of which the energy counts that their break would release.
        used: (k,) share of the strength that the bonded nodes use, 0 elsewhere; NaN at these tips, for that energy is
            not in the files.
        temperature: its change.
        heat: what works on it, - <alpha : sigma>; 0 if the expansions alpha of the phases are not known.
        expanding: mean of alpha : L : strain, likewise.
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
    damage: Float
    released: Bool
    used: Float
    temperature: float
    heat: float
    expanding: float

    @classmethod
    def of(cls, cell: DiscreteCell, state: State, fields: ElementFields) -> StateNumbers:
        """Return those of a state of a cell."""
        law = law_at(cell.files, damage=state.damage)
        released = tips(cell, state.status) & law.grows_by_release
        held = held_traction(cell.files, state)
        used = np.where(state.status == BONDED, law.utilisation(held), 0.0)
        used[released] = np.nan
        in_springs = energy_of_springs(cell.files, state) / cell.area
        heat = _heat(cell, state)
        energies = fields.energy / (2 * cell.area) + state.temperature * heat / 2 + in_springs, in_springs
        means = state.strain, state.mean_stress
        return cls(
            state.name, state.load_factor, state.point, *means, *energies, held, state.status,
            state.damage, released,
            used, state.temperature, heat, _expanding(cell, fields),
        )  # fmt: skip


def _heat(cell: DiscreteCell, state: State) -> float:
    """- <alpha : sigma>, the derivative of the energy by the temperature."""
    if cell.expansions is None:
        return 0.0
    own = (cell.expansions[cell.files.mesh.phase] * state.stress).sum(axis=1)
    return -float(cell.elements.area @ own) / cell.area


def _expanding(cell: DiscreteCell, fields: ElementFields) -> float:
    """Mean of alpha : L : strain over the cell."""
    if cell.expansions is None:
        return 0.0
    thermal = np.einsum("pij,pj->pi", cell.stiffnesses, cell.expansions)[cell.files.mesh.phase]
    return float(cell.elements.area @ (thermal * fields.strain).sum(axis=1)) / cell.area


def tips(cell: DiscreteCell, status: AnyInt) -> Bool:
    """(k,) which bonds lie beside a broken one."""
    broken, beside = status != BONDED, cell.beside
    tips = np.zeros(len(broken), bool)
    for here, there in (beside.T, beside.T[::-1]):
        tips[here[broken[there]]] = True
    return np.asarray(tips & ~broken)


def check_load(findings: Findings, cell: DiscreteCell, states: Sequence[StateNumbers]) -> None:
    """Check loads against the case, and points or columns of result.json against the states."""
    document, case = cell.files.document, cell.files.case
    same = json.loads(str(cell.files.file.attrs["case"])) == case
    findings.record("tables", 0.0 if same else np.inf, "the case, which differs between the two files")
    rows = list(_rows(document, case, _unit_loads(cell)))
    scales = _Scales.of(cell, states, [load for load, _ in rows])
    if "path" in document:
        _check_kept(findings, document, case, [state.point for state in states])
        for number, (load, entries) in enumerate(rows):
            strain, stress = np.array(entries["strain"]), np.array(entries["stress"])
            warmer = float(entries.get(TEMPERATURE, 0.0))
            _check_prescribed(findings, load, strain, stress, warmer, scales, f"path[{number}]")
        pairs = [(state, rows[state.point]) for state in states if 0 <= state.point < len(rows)]
    else:
        _check_all(findings, document, states, len(rows))
        pairs = list(zip(states, rows, strict=False))
    for state, (load, entries) in pairs:
        _check_prescribed(findings, load, state.strain, state.stress, state.temperature, scales, state.name)
        _check_entries(findings, state, entries, scales)
    for place, matrix in _linear_stiffnesses(document, cell.files.contact):
        findings.record("symmetry", relative(matrix - matrix.T, float(np.abs(matrix).max())), place)


@dataclass(frozen=True)
class _Scales:
    """Sizes of the strains and stresses of all states, and of stresses that the loads make in the bonded cell."""

    strain: float
    stress: float
    imposed: float

    @classmethod
    def of(cls, cell: DiscreteCell, states: Sequence[StateNumbers], loads: Sequence[Prescribed]) -> _Scales:
        largest, imposed = max((float(np.abs(state.stress).max()) for state in states), default=0.0), 0.0
        for state, load in product(states[:1], loads):
            # Strains that came out are no scale of the stresses that are asked for.
            given, n = np.where(load.by_stress, 0.0, load.values), len(state.strain)
            asked = replace(state, strain=given[:n], temperature=float(given[n:].sum()))
            imposed = max(imposed, float(np.abs(cell.reuss @ cell.loads(asked)).max()))
        return cls(cell.largest_strain or 1.0, largest or 1.0, max(largest, imposed) or 1.0)


def _check_prescribed(
    findings: Findings, load: Prescribed, strain: Float, stress: Float, temperature: float, scales: _Scales, place: str
) -> None:
    """Strains, stresses and the temperature that a load prescribes."""
    given, by_stress = load.values[: len(strain)], load.by_stress[: len(strain)]
    findings.record("load", np.abs(strain - given)[~by_stress] / scales.strain, f"{place}, strain")
    findings.record("stress load", np.abs(stress - given)[by_stress] / scales.imposed, f"{place}, stress")
    warmer = float(load.values[-1]) if len(load.values) > len(given) else 0.0
    findings.record("load", abs(temperature - warmer) / max(abs(warmer), 1.0), f"{place}, temperature")


def _check_kept(
    findings: Findings, document: Mapping[str, Any], case: Mapping[str, Any], numbers: Sequence[int]
) -> None:
    """Check that the states of a path are those of the points that result.json lists, in order.

    They include the first and the last, and are as many as the case asks for.
    """
    count, asked = len(document["path"]), case["output"]["states"]
    given = list(document["states"]) == list(numbers)
    findings.record("tables", 0.0 if given else np.inf, "states, which differ between the two files")
    rising = all(a < b for a, b in pairwise(numbers))
    ends = len(numbers) > 0 and numbers[0] == 0 and numbers[-1] == count - 1
    findings.record(
        "load", 0.0 if rising and ends else np.inf, "states, which are not from the first point to the last"
    )
    wanted = count if asked == "all" else len(numbers) if asked == "peaks" else min(asked, count)
    findings.record("load", abs(wanted - len(numbers)), f"{len(numbers)} states, {wanted} asked for")


def _check_all(findings: Findings, document: Mapping[str, Any], states: Sequence[StateNumbers], count: int) -> None:
    """Check that the states of other analyses are all that the case asks for, with their points."""
    findings.record("load", abs(count - len(states)), f"{len(states)} states, {count} asked for")
    each = count // len(document["angle"]) if "angle" in document else count
    off = [abs(state.point - number // each) for number, state in enumerate(states)]
    findings.record("tables", off, lambda i: f"{states[i].name}, point")


def _check_entries(findings: Findings, state: StateNumbers, entries: Mapping[str, Any], scales: _Scales) -> None:
    """Check the numbers of a state in result.json."""
    given = {"strain": (state.strain, scales.strain), "stress": (state.stress, scales.stress)}
    given |= {TEMPERATURE: (np.array(state.temperature), max(abs(state.temperature), 1.0))}
    for name in given.keys() & entries.keys():
        value, scale = given[name]
        findings.record("tables", relative(np.array(entries[name]) - value, scale), f"{state.name}, {name}")
    if "load_factor" in entries:
        findings.record("tables", abs(entries["load_factor"] - state.load_factor), f"{state.name}, load_factor")
    for name in COUNTS.keys() & entries.keys():
        counted = np.count_nonzero(state.status == COUNTS[name])
        findings.record("tables", abs(entries[name] - counted), f"{state.name}, {name}")


def _unit_loads(cell: DiscreteCell) -> list[Prescribed]:
    """Return the unit strains, and the unit of temperature, in the order of their states."""
    if not cell.files.is_spatial:
        return [Prescribed.strain(strain, 0.0) for strain in np.eye(3)]
    unit = [Prescribed.strain(strain, 0.0) for strain in np.eye(6)[SPATIAL_ORDER]]
    thermal = [] if cell.expansions is None else [Prescribed.strain(np.zeros(6), 1.0)]
    return [*unit[:4], *thermal, *unit[4:]]


def _rows(
    document: Mapping[str, Any], case: Mapping[str, Any], unit: Sequence[Prescribed]
) -> Iterator[tuple[Prescribed, Mapping[str, Any]]]:
    """Yield the load and the entry of result.json of each point of a path, or of each state of another case."""
    if "path" in document:
        yield from zip(at_points(case, document["path"]), document["path"], strict=True)
    elif "load" in document:
        yield from ((load, document["load"]) for load in targets(case))
    elif "angle" in document:
        given = case["angle"].get("strain")
        for point in document["angle"]:
            if given is not None:
                yield Prescribed.strain(np.array(given), 0.0), point
                continue
            for number, (load, entry) in enumerate(_columns(point, "stiffness", "", 1.0, unit)):
                yield load, entry | ({name: point[name] for name in COUNTS} if number == LAST_OF_PLANE else {})
    else:
        for suffix, sign in (("", 1.0), ("_compression", -1.0)):
            if f"effective_stiffness{suffix}" in document:
                yield from _columns(document, "effective_stiffness", suffix, sign, unit)


def _columns(
    given: Mapping[str, Any], stiffness: str, suffix: str, sign: float, unit: Sequence[Prescribed]
) -> Iterator[tuple[Prescribed, dict[str, Float]]]:
    """Yield the unit loads, or minus them, with their stresses: columns of a stiffness, and `thermal_stress`."""
    v = 6 if len(unit[0].values) > 3 else 3
    for load in unit:
        matrix = np.array(given[f"{stiffness}{suffix}"])
        is_thermal = load.values[v:].any()
        stress = np.array(given[f"thermal_stress{suffix}"]) if is_thermal else matrix @ load.values[:v]
        yield replace(load, values=sign * load.values), {"stress": sign * stress}


def _linear_stiffnesses(document: Mapping[str, Any], contact: bool) -> Iterator[tuple[str, Float]]:
    """Yield the stiffnesses in result.json of cells without one-sided contact, and what they are called."""
    if "effective_stiffness" in document and "effective_stiffness_compression" not in document:
        yield "effective_stiffness", np.array(document["effective_stiffness"])
    for number, point in enumerate(document.get("angle", ())):
        if "stiffness" in point and not (contact and point["open"] + point["closed"]):
            yield f"angle[{number}].stiffness", np.array(point["stiffness"])
