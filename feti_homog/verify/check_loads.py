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
    """Numbers of a state that the laws of paths and tables need; others as in `State`.

    Energies per area `stored`, <sigma : (eps - alpha T)> / 2 and `in_springs`, from the fields; `released` (k,) tips
    whose break counts by what it would release; `used` (k,) shares of the strength of bonded nodes, NaN at these tips;
    `heat`, what works on the temperature, - <alpha : sigma>, and `expanding`, <alpha : L : strain>, 0 if not known.
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
        in_springs, heat, expanding = energy_of_springs(cell.files, state) / cell.area, 0.0, 0.0
        if cell.expansions is not None:
            weights, phase = cell.elements.area / cell.area, cell.files.mesh.phase
            heat = -float(weights @ (cell.expansions[phase] * state.stress).sum(axis=1))
            thermal = np.einsum("pij,pj->pi", cell.stiffnesses, cell.expansions)[phase]
            expanding = float(weights @ (thermal * fields.strain).sum(axis=1))
        energies = fields.energy / (2 * cell.area) + state.temperature * heat / 2 + in_springs, in_springs
        means = state.strain, state.mean_stress
        return cls(
            state.name, state.load_factor, state.point, *means, *energies, held, state.status,
            state.damage, released, used, state.temperature, heat, expanding,
        )  # fmt: skip


States = Sequence[StateNumbers]


def tips(cell: DiscreteCell, status: AnyInt) -> Bool:
    """(k,) which bonds lie beside a broken one."""
    broken, beside = status != BONDED, cell.beside
    tips = np.zeros(len(broken), bool)
    for here, there in (beside.T, beside.T[::-1]):
        tips[here[broken[there]]] = True
    return np.asarray(tips & ~broken)


def check_load(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check loads against the case, and points or columns of result.json against the states.

    States of a path are those of the points that result.json lists, in order, the first and the last among them, and as
    many as the case asks for; of other analyses all.
    """
    document, case = cell.files.document, cell.files.case
    same = json.loads(str(cell.files.file.attrs["case"])) == case
    findings.require("tables", same, "the case, which differs between the two files")
    rows, numbers = list(_rows(document, case, _unit_loads(cell))), [state.point for state in states]
    scales = _scales(cell, states, [load for load, _ in rows])
    if "path" in document:
        _check_kept(findings, case["output"]["states"], numbers, list(document["states"]), len(rows))
        for number, (load, entries) in enumerate(rows):
            _check_prescribed(findings, load, entries, scales, f"path[{number}]")
        pairs = [(state, rows[state.point]) for state in states if 0 <= state.point < len(rows)]
    else:
        pairs, each = list(zip(states, rows, strict=False)), len(rows) // len(document.get("angle", [None]))
        off = [abs(number - k // each) for k, number in enumerate(numbers)]
        findings.record("tables", off, lambda k: f"{states[k].name}, point")
        findings.record("load", abs(len(rows) - len(states)), f"{len(states)} states, {len(rows)} asked for")
    for state, row in pairs:
        _check_entries(findings, state, *row, scales)
    for place, matrix in linear_stiffnesses(document, cell.files.contact):
        findings.record("symmetry", relative(matrix - matrix.T, float(np.abs(matrix).max())), place)


def _unit_loads(cell: DiscreteCell) -> list[Prescribed]:
    """Return the unit strains, and the unit of temperature, in the order of their states."""
    order = np.eye(6)[SPATIAL_ORDER] if cell.files.is_spatial else np.eye(3)
    unit = [Prescribed.strain(strain, 0.0) for strain in order]
    unit[4:4] = [] if cell.expansions is None else [Prescribed.strain(np.zeros(6), 1.0)]
    return unit


def _scales(cell: DiscreteCell, states: States, loads: Sequence[Prescribed]) -> tuple[float, float, float]:
    """Sizes of the strains and stresses of all states, and of stresses that the loads make in the bonded cell."""
    largest, imposed = max((float(np.abs(state.stress).max()) for state in states), default=0.0), 0.0
    for state, load in product(states[:1], loads):
        # Strains that came out are no scale of the stresses that are asked for.
        given, n = np.where(load.by_stress, 0.0, load.values), len(state.strain)
        asked = replace(state, strain=given[:n], temperature=float(given[n:].sum()))
        imposed = max(imposed, float(np.abs(cell.reuss @ cell.loads(asked)).max()))
    return cell.largest_strain or 1.0, largest or 1.0, max(largest, imposed) or 1.0


def _check_kept(findings: Findings, asked: str | int, numbers: list[int], given: list[int], points: int) -> None:
    """Check the numbers of the kept states of a path with so many points."""
    findings.require("tables", given == numbers, "states, which differ between the two files")
    ends, rises = numbers[:1] == [0] and numbers[-1:] == [points - 1], all(a < b for a, b in pairwise(numbers))
    findings.require("load", ends and rises, "states, which are not from the first point to the last")
    wanted = min(asked, points) if isinstance(asked, int) else points if asked == "all" else len(numbers)
    findings.record("load", abs(wanted - len(numbers)), f"{len(numbers)} states, {wanted} asked for")


def _check_entries(
    findings: Findings, state: StateNumbers, load: Prescribed, entries: Mapping[str, Any], scales: tuple[float, ...]
) -> None:
    """Check the numbers of a state against its load and in result.json."""
    own: dict[str, Any] = {"strain": state.strain, "stress": state.stress, TEMPERATURE: state.temperature}
    _check_prescribed(findings, load, own, scales, state.name)
    own |= {name: np.count_nonzero(state.status == status) for name, status in COUNTS.items()}
    own |= {"load_factor": state.load_factor}
    sizes = {"strain": scales[0], "stress": scales[1], TEMPERATURE: max(abs(state.temperature), 1.0)}
    for name in own.keys() & entries.keys():
        off = relative(np.array(entries[name]) - own[name], sizes.get(name, 1.0))
        findings.record("tables", off, f"{state.name}, {name}")


def _check_prescribed(
    findings: Findings, load: Prescribed, own: Mapping[str, Any], scales: tuple[float, ...], place: str
) -> None:
    """Strains, stresses and the temperature that a load prescribes."""
    strain, stress, temperature = np.array(own["strain"]), np.array(own["stress"]), float(own.get(TEMPERATURE, 0.0))
    given, by_stress = load.values[: len(strain)], load.by_stress[: len(strain)]
    findings.record("load", np.abs(strain - given)[~by_stress] / scales[0], f"{place}, strain")
    findings.record("stress load", np.abs(stress - given)[by_stress] / scales[2], f"{place}, stress")
    warmer = float(load.values[-1]) if len(load.values) > len(given) else 0.0
    findings.record("load", abs(temperature - warmer) / max(abs(warmer), 1.0), f"{place}, temperature")


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


def linear_stiffnesses(document: Mapping[str, Any], contact: bool) -> Iterator[tuple[str, Float]]:
    """Yield the stiffnesses in result.json of cells without one-sided contact, and what they are called."""
    if "effective_stiffness" in document and "effective_stiffness_compression" not in document:
        yield "effective_stiffness", np.array(document["effective_stiffness"])
    for number, point in enumerate(document.get("angle", ())):
        if "stiffness" in point and not (contact and point["open"] + point["closed"]):
            yield f"angle[{number}].stiffness", np.array(point["stiffness"])
