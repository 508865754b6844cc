"""Check that states and result.json have the loads of the case, and that their numbers agree.

A case prescribes the strain or stress of n components; in generalized plane strain the last strain is the temperature.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from feti_homog.typing import Bool, Document, Float
from feti_homog.verify.bonds import cohesive_traction, law_at, rubbing_force
from feti_homog.verify.constitutive_law import GRADIENT
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.elements import ElementFields
from feti_homog.verify.findings import ROUNDING, Findings
from feti_homog.verify.reading import State, Status

NAMES = {
    3: (("E11", "E22", "gamma12"), ("S11", "S22", "S12")),
    6: (("E11", "E22", "E33", "gamma23", "gamma13", "gamma12"), ("S11", "S22", "S33", "S23", "S13", "S12")),
}
TEMPERATURE, COUNTS = "temperature", {status.name.lower(): status for status in Status}
OF_ARCS = "debonded_length", "debonded_share", "debonded_shares"  # entries of an angle, equal under all unit loads
UNIT_LOADS = {3: [0, 1, 2], 6: [0, 1, 5, 2, 6, 4, 3]}  # components in the order of the states; 6 is the temperature
FIELDS = ("displacement", "fluctuation", "stress", "mesh_error", "stress_33")  # large fields of a state


@dataclass(frozen=True)
class Prescribed:
    """A load: `values` (n,) of its components, stresses where `by_stress` (n,), else strains."""

    values: Float
    by_stress: Bool


def targets(case: Document) -> list[Prescribed]:
    """Return the loads of [path] or [load], with all components; [] for other analyses.

    A component that a load omits keeps its previous value and kind; initially stresses and temperature are 0.
    """
    v, n = (6, 7) if case["analysis"]["plane"] == "generalized" else (3, 3)
    strains, stresses = NAMES[v]
    places = {name: (k, False) for k, name in enumerate([*strains, TEMPERATURE][:n])}
    places |= {name: (k, True) for k, name in enumerate(stresses)}
    values, by_stress, loads = np.zeros(n), np.arange(n) < v, []
    path = case.get("path", {})
    single = [path[name] for name in ("strain", "to") if path.get(name)]
    waypoints = [case["load"]["to"]] if "load" in case else path.get("waypoints") or single
    for load in waypoints:
        values, by_stress = values.copy(), by_stress.copy()
        for name, value in (load if isinstance(load, Mapping) else dict(zip(strains, load, strict=True))).items():
            place, is_stress = places[name]
            values[place], by_stress[place] = value, is_stress
        loads.append(Prescribed(values, by_stress))
    return loads


def at_points(case: Document, points: Sequence[Document]) -> Iterator[Prescribed]:
    """Yield the prescribed load at every point of a path.

    A leg is straight, from the end of the previous leg, or from 0, to its waypoint.  A component that changes between
    strain and stress starts at its value at the previous point.
    """
    ends, leg, ended = targets(case), 0, False
    by_events, start, last = case["path"]["method"] == "events", np.zeros(len(ends[0].values)), None
    for point in points:
        along = float(point["load_factor"]) * len(ends)
        while leg < len(ends) - 1 and (ended or along > leg + 1 + ROUNDING):
            before, end, leg, ended = ends[leg], ends[leg + 1], leg + 1, False
            start = before.values
            if last is not None:
                pairs = ([*last[name], last.get(TEMPERATURE, 0.0)][: len(start)] for name in ("stress", "strain"))
                start = np.where(before.by_stress == end.by_stress, start, np.where(end.by_stress, *pairs))
        share = along - leg
        yield Prescribed((1 - share) * start + share * ends[leg].values, ends[leg].by_stress)
        # With events, a leg ends at its waypoint with a point without breaks.
        ended, last = abs(share - 1) <= ROUNDING and not (by_events and damaged_at(point)), point


def damaged_at(point: Document) -> int:
    """Return the number of bonds that break or soften at a point, or in its increment."""
    return int(point["broke"]) + int(point.get("softened") or 0)


@dataclass(frozen=True)
class StateNumbers(State):
    """A state whose `traction` is cohesive and whose large `FIELDS` are empty arrays, so that all states fit in memory.

    Attributes:
        stored, in_springs: energies per area: <sigma : (eps - alpha T)> / 2 plus springs, and springs alone.
        released: (k,) whether a bond is at a tip that breaks by energy release.
        used: (k,) utilisation at bonded nodes, NaN where `released`, else 0.
        heat: conjugate of the temperature T, -<alpha : sigma> with the expansions alpha.
        expanding: <alpha : L : strain> with the stiffnesses L.
    """

    stored: float
    in_springs: float
    released: Bool
    used: Float
    heat: float
    expanding: float

    @classmethod
    def of(cls, cell: DiscreteCell, state: State, fields: ElementFields) -> Self:
        """Compute the numbers of a state from its fields."""
        law = law_at(cell.files, damage=state.damage)
        released = cell.tips(state.status) & law.grows_by_release
        traction = cohesive_traction(cell.files, state)
        used = np.where(released, np.nan, np.where(state.status == Status.BONDED, law.utilisation(traction), 0.0))
        # In rubbing bonds the springs store (1 - d) K s^2 / 2 + d f^2 / (2 K).
        intact = law_at(cell.files, damage=np.zeros(len(traction))).jumps(np.ones_like(traction))[:, 1]
        twice = (traction * law.jumps(traction)).sum(axis=1)
        twice += state.damage * intact * rubbing_force(cell.files, state) ** 2
        in_springs = float(twice @ cell.files.interface.length) / (2 * cell.area)
        weights, phase = cell.elements.area / cell.area, cell.files.mesh.phase
        heat = -float(weights @ (cell.expansions[phase] * state.stress).sum(axis=1))
        thermal = np.einsum("pij,pj->pi", cell.stiffnesses, cell.expansions)[phase]
        expanding = float(weights @ (thermal * fields.strain).sum(axis=1))
        stored = fields.energy / (2 * cell.area) + state.temperature * heat / 2 + in_springs
        numbers = dict(vars(state)) | dict.fromkeys(FIELDS, np.zeros(0)) | {"traction": traction}
        return cls(**numbers, stored=stored, in_springs=in_springs, released=released, used=used, heat=heat,
                   expanding=expanding)  # fmt: skip


States = Sequence[StateNumbers]
Rows = Sequence[tuple[Prescribed, Document]]
Pairs = Sequence[tuple[StateNumbers, tuple[Prescribed, Document]]]


def check_loads(findings: Findings, cell: DiscreteCell, states: States, rows: Rows) -> Pairs:
    """Check the loads of points and states against the case; return each state with its row.

    A row is a load with its entries in result.json.  The states of a path include its first and last points.
    """
    document, numbers, count = cell.files.document, [state.point for state in states], len(rows)
    # The bonded cell gives the scale of stresses: computed strains are no scale for prescribed stresses.
    given, v = (np.where(load.by_stress, 0.0, load.values) for load, _ in rows), len(cell.reuss)
    stresses = [cell.reuss @ cell.loads(strains[:v], float(strains[v:].sum())) for strains in given]
    largest = float(np.abs([*stresses, *(state.mean_stress for state in states)]).max(initial=0.0))
    hottest = max((abs(float(load.values[v:].sum())) for load, _ in rows), default=0.0)
    scales = cell.largest_strain or 1.0, largest or 1.0, hottest or 1.0
    if "path" in document:
        findings.require("tables", list(document["states"]) == numbers, "states, which differ between the two files")
        in_order = [*numbers[:1], *numbers[-1:]] == [0, count - 1] and numbers == sorted({*numbers})
        findings.require("load", in_order, "states, which do not go from the first point to the last")
        for number, (load, entries) in enumerate(rows):
            _check_load(findings, load, entries, scales, f"path[{number}]")
        key = cell.files.case["output"]["states"]
        most = count if key == "all" else len(numbers)
        count = min(key, count) if isinstance(key, int) else most
        pairs = [(state, rows[state.point]) for state in states if 0 <= state.point < len(rows)]
    else:
        pairs = list(zip(states, rows, strict=False))
        points = np.arange(len(numbers)) // (count // len(document.get("angle", [None])))
        findings.compare("tables", numbers, points, 1.0, lambda k: f"{states[k].name}, point")
    findings.compare("load", len(states), count, 1.0, f"{len(states)} states, expected {count}")
    for state, (load, _) in pairs:
        entries = {"strain": state.strain, "stress": state.mean_stress, TEMPERATURE: state.temperature}
        _check_load(findings, load, entries, scales, state.name)
    return pairs


def _check_load(findings: Findings, load: Prescribed, numbers: Document, scales: Sequence[float], place: str) -> None:
    """Check prescribed strains, stresses and the temperature, each relative to one of the three `scales`."""
    strain, stress, v = np.array(numbers["strain"]), np.array(numbers["stress"]), len(numbers["strain"])
    values, by_stress, (of_strain, of_stress, of_heat) = load.values[:v], load.by_stress[:v], scales
    findings.record("load", np.abs(strain - values)[~by_stress] / of_strain, f"{place}, strain")
    findings.record("stress load", np.abs(stress - values)[by_stress] / of_stress, f"{place}, stress")
    findings.compare("load", numbers.get(TEMPERATURE, 0.0), load.values[v:].sum(), of_heat, f"{place}, temperature")


def check_tables(findings: Findings, cell: DiscreteCell, states: States, pairs: Pairs) -> None:
    """Check points, or columns of a stiffness, in result.json against states and their rows `pairs`."""
    files, nodes, sections = cell.files, cell.files.interface, len(cell.files.interfaces)
    is_same = json.loads(str(files.file.attrs["case"])) == files.case
    findings.require("tables", is_same, "the case, which differs between the two files")

    def lengths(where: Bool) -> Float:
        return np.asarray(np.bincount(nodes.fibre - 1, nodes.length * where, len(files.fibres.radius)), float)

    longest = float(lengths(np.ones(len(nodes.length), bool)).max(initial=0.0)) or 1.0
    total, points_with_state = nodes.length.sum() or 1.0, {state.point for state in states}
    of_section = nodes.length[:, None] * (nodes.pair[:, None] == np.arange(sections))
    stress = float(np.max([(cell.scales_of(s).stress, *np.abs(s.mean_stress)) for s in states], initial=0.0)) or 1.0
    energy = max([state.stored for state, _ in pairs], default=0.0) + cell.rounded_energy
    laws = {"stored": "energy", "stored_in_springs": "energy"}
    laws |= {"stress": "mean stress"} if "path" in files.document else {}  # fields have balanced multipliers
    for state, (_, entries) in pairs:
        debonded, damaged = state.status != Status.BONDED, (state.damage > 0.0) & (state.damage < 1.0)
        numbers: dict[str, tuple[Any, float]] = {
            "strain": (state.strain, cell.largest_strain or 1.0),
            "stress": (state.mean_stress, stress),
            TEMPERATURE: (state.temperature, max(abs(state.temperature), 1.0)),
            "load_factor": (state.load_factor, 1.0),
            "stored": (state.stored, energy),
            "stored_in_springs": (state.in_springs, energy),
            "debonded_length": (lengths(debonded), longest),
            "debonded_share": (lengths(debonded).sum() / total, 1.0),
            "damaged_share": (lengths(damaged).sum() / total, 1.0),
            "debonded_shares": (debonded @ of_section / of_section.sum(axis=0), 1.0),
        }
        numbers |= {name: (np.count_nonzero(state.status == status), 1.0) for name, status in COUNTS.items()}
        for name in [name for name in numbers if name in entries]:
            findings.compare(laws.get(name, "tables"), entries[name], *numbers[name], f"{state.name}, {name}")
    for number, point in enumerate(files.points):
        count, place = sum(point[name] for name in COUNTS), f"point {number}, {', '.join(COUNTS)}"
        findings.compare("tables", count, len(nodes.length), 1.0, place)
        needed = {"debonded_length": number in points_with_state, "debonded_shares": sections > 1}
        missing = [name for name, is_needed in needed.items() if is_needed and name not in point]
        findings.require("tables", not missing, f"point {number}, {', '.join(missing)}")


def rows_of(cell: DiscreteCell) -> Rows:
    """Return loads and their entries in result.json, for path points or for states."""
    document, case = cell.files.document, cell.files.case
    if "path" in document:
        return list(zip(at_points(case, document["path"]), document["path"], strict=True))
    if "load" in document:
        return [(load, document["load"]) for load in targets(case)]
    if strain := case.get("angle", {}).get("strain"):
        values = np.array([*strain, 0.0] if len(strain) > 3 else strain, float)
        return [(Prescribed(values, np.zeros(len(values), bool)), point) for point in document["angle"]]
    if (k := document.get("effective_conductivity")) is not None:
        columns, none = np.zeros((6, 6)), np.zeros(7, bool)
        columns[np.ix_(GRADIENT, GRADIENT)] = k
        return [(Prescribed(np.eye(7)[place], none), {"stress": columns[:, place]}) for place in GRADIENT]
    # Unit loads with both signs, and their stresses: the columns of a stiffness, and `thermal_stress`.
    tables = [(point, "stiffness", "", 1.0) for point in document.get("angle", ())]
    tables = tables or [(document, "effective_stiffness", *signed) for signed in (("", 1.0), ("_compression", -1.0))]
    rows = []
    for table, stiffness, suffix, sign in tables:
        if f"{stiffness}{suffix}" not in table:
            continue
        columns = np.array(table[f"{stiffness}{suffix}"])
        v = len(columns)
        n = 7 if v == 6 else v  # with the temperature
        if f"thermal_stress{suffix}" in table:
            columns = np.column_stack([columns, table[f"thermal_stress{suffix}"]])
        for k in [k for k in UNIT_LOADS[v] if k < columns.shape[1]]:
            names = (*OF_ARCS, *COUNTS) if k == v - 1 else OF_ARCS  # the state of gamma12 has the counts
            entries = {"stress": sign * columns[:, k]} | {name: table[name] for name in names if name in table}
            rows.append((Prescribed(sign * np.eye(n)[k], np.zeros(n, bool)), entries))
    return rows
