"""Law of the sensitivities: energies of the fields of unit loads change as written where constants of a case change."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.cell_tables import Mesh, State
from feti_homog.verify.check_fields import BONDED, CLOSED
from feti_homog.verify.check_loads import SPATIAL_ORDER
from feti_homog.verify.check_summary import about_fibres, engineering_constants, moduli
from feti_homog.verify.constitutive_law import laws, mixed_phases
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.elements import Elements
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.prescribed import NAMES

STEP = 1e-6
# Constants beside the largest of their kind below which they are noise.
NOISE = 1e-3
SAME = 1e-8  # of a radius
SPRINGS = ("normal_stiffness", "tangential_stiffness", "axial_stiffness")
WEIGHTS = (1.0, -0.7, 0.5, 0.9, -0.8)
Case = dict[str, Any]


def check_sensitivities(findings: Findings, cell: DiscreteCell) -> None:
    """Check the values of all constants, and one derivative along a direction in which all parameters change."""
    document = cell.files.document
    if "sensitivities" not in document:
        return
    data = document["sensitivities"]
    names = data["parameters"]
    own = np.array([_place(dict(cell.files.case), name)[2] for name in names])
    # Changes over which the laws are nearly linear.
    ratios = np.array([name.endswith(".poisson") for name in names]) & (own < 0.5)
    sizes = np.where(ratios, 0.5 - own, np.where(own == 0.0, 1.0, np.abs(own)))
    direction = sizes * np.resize(WEIGHTS, len(own))
    moved = [_moved(cell, names, own + sign * STEP * direction) for sign in (1, -1)]
    states = list(cell.files.states())
    if "load" in document:
        _check_load(findings, cell, states[0], moved, direction)
    elif data.get("at_fixed_status"):
        _check_energies(findings, cell, states, moved, direction)
    else:
        _check_constants(findings, cell, states, moved, direction)


def _check_energies(
    findings: Findings, cell: DiscreteCell, states: list[State], cases: list[Case], direction: Float
) -> None:
    """Check the derivatives of the energies of states with contact, which are stationary, too.

    Those are the diagonal of the secants.  The others would need fields of other loads at the same status, which no
    file has; of them the values are checked.
    """
    document = cell.files.document
    data = document["sensitivities"]
    data.leaves_open("derivatives")
    known = {f"C{i + 1}{j + 1}": C for (i, j), C in np.ndenumerate(np.array(document["effective_stiffness"]))}
    known |= {f"thermal_S{k + 1}{k + 1}": heat for k, heat in enumerate(document.get("thermal_stress", ()))}
    for name, value in zip(data["constants"], data["constant_values"], strict=True):
        findings.record("constants", abs(value - known.get(name, np.inf)) / (abs(value) or 1e-300), name)
    strains, _ = _in_order(states[: len(states) // 2])  # those under minus the unit loads follow
    for number, state in enumerate(strains, start=1):
        k = data["constants"].index(name := f"C{number}{number}")
        above, below = (float(_energies(cell, [state], case)[0, 0]) for case in cases)
        terms, value = np.array(data["derivatives"][k]) * direction, data["constant_values"][k]
        expected, scale = (above - below) / (2 * STEP), max(float(np.abs(terms).max()), abs(value))
        findings.record("sensitivities", relative(np.array(terms.sum() - expected), scale), name)
        here = float(_energies(cell, [state], cell.files.case)[0, 0])
        findings.record("constants", abs(value - here) / max(abs(here), 1e-300), name)


def _check_load(findings: Findings, cell: DiscreteCell, state: State, cases: list[Case], direction: Float) -> None:
    """Check strains x and stresses s of one load, what is stored, and the derivatives of those that follow from it.

    With given strains g and given stresses f, d(x_g.s_g - x_f.s_f) / 2 is that of the energy of the fields at rest.
    Beside a temperature, whose conjugate no file has, the values are checked alone.
    """
    data, point = cell.files.document["sensitivities"], cell.files.document["load"]
    pairs = [*zip(*NAMES[len(point["strain"])], strict=True)]
    known = dict(zip(data["constants"], zip(data["constant_values"], data["derivatives"], strict=True), strict=True))
    follows = [[name for name in pair if name in known] for pair in pairs]
    if any(len(names) != 1 for names in follows) or "stored" not in known:
        findings.record("tables", np.inf, "sensitivities, constants of the load")
        return
    of_stored = np.array(known["stored"][1]) * direction
    terms, rest = np.zeros_like(direction), of_stored.copy()
    for (name,), strain, stress, (other, _) in zip(follows, point["strain"], point["stress"], pairs, strict=True):
        value, conjugate, sign = (strain, stress, -1) if name == other else (stress, strain, 1)
        size = max(map(abs, point["strain" if name == other else "stress"]))
        findings.record("constants", relative(np.array(known[name][0] - value), size), name)
        change = conjugate / 2 * np.array(known[name][1]) * direction
        terms, rest = terms + sign * change, rest - change
    if state.temperature:
        data.leaves_open("derivatives")
        return
    here, *ends = (0.5 * float(_energies(cell, [state], case)[0, 0]) for case in (cell.files.case, *cases))
    findings.record("constants", abs(known["stored"][0] - here) / max(abs(here), 1e-300), "stored")
    scale = max(float(np.abs(terms).max()), float(np.abs(of_stored).max()), abs(here))
    off = [terms.sum() - (ends[0] - ends[1]) / (2 * STEP), rest.sum()]
    findings.record("sensitivities", relative(np.array(off), scale), lambda k: ("the load", "stored")[k])


def _check_constants(
    findings: Findings, cell: DiscreteCell, states: list[State], cases: list[Case], direction: Float
) -> None:
    """Check the derivatives of all constants of a linear cell."""
    data = cell.files.document["sensitivities"]
    ends = [_energies(cell, states, case) for case in cases]
    slope = (ends[0] - ends[1]) / (2 * STEP)
    document = cell.files.document
    C, heat = np.array(document["effective_stiffness"]), document.get("thermal_stress")
    heat = None if heat is None else np.array(heat)
    here = constants_of(C, heat)
    step = 1e-5 * np.abs(C).max() / max(float(np.abs(slope).max()), 1e-300)
    moved = [constants_of(*changed(C, heat, sign * step * slope)) for sign in (1, -1)]
    for k, name in enumerate(data["constants"]):
        kind = max(abs(value) for other, value in here.items() if other[0] == name[0])
        terms = np.array(data["derivatives"][k]) * direction
        expected = (moved[0][name] - moved[1][name]) / (2 * step)
        scale = max(float(np.abs(terms).max()), abs(here[name]), NOISE * kind)
        findings.record("sensitivities", relative(np.array(terms.sum() - expected), scale), name)
        findings.record("moduli", abs(data["constant_values"][k] - here[name]) / max(abs(here[name]), NOISE * kind),
                        f"sensitivities, {name}")  # fmt: skip


def _place(case: Case, name: str) -> tuple[Any, Any, float]:
    """Return the table and key of a parameter, and its value."""
    section, *keys = name.split(".")
    table: Any = case[section]
    if section == "material" or isinstance(table, list):
        first = keys.pop(0)
        table = table[int(first) - 1] if isinstance(table, list) else table[first]
    if len(keys) == 1:
        return table, keys[0], float(table[keys[0]])
    place = tuple(int(digit) - 1 for digit in keys[1] if digit.isdigit())
    numbers = np.array(table[keys[0]], float)
    return table, (keys[0], place), float(numbers[place])


def _moved(cell: DiscreteCell, names: Sequence[str], values: Float) -> Case:
    """Return the case with other values of the parameters."""
    case: Case = copy.deepcopy(dict(cell.files.case))
    for name, value in zip(names, values, strict=True):
        table, key, _ = _place(case, name)
        if isinstance(key, str):
            table[key] = float(value)
        else:
            numbers = np.array(table[key[0]], float)
            numbers[key[1]] = numbers[key[1][::-1]] = value
            table[key[0]] = numbers.tolist()
    return case


def _energies(cell: DiscreteCell, states: list[State], case: Mapping[str, Any]) -> Float:
    """(v, v) or (6, 7) energies of pairs of the fields of unit loads, of which the first is a strain, in this case."""
    files, phases = cell.files, cell.files.phases
    growth = float(np.log(case["cell"].get("fibre_fraction", 1.0) / files.case["cell"].get("fibre_fraction", 1.0))) / 2
    mesh, states = _grown(cell, growth, states) if growth else (files.mesh, states)
    stiffnesses, free = laws(case, phases)
    # Elements stay what they are where constants that are alike change apart.
    elements = Elements(mesh, stiffnesses, mixed_phases(files.case, phases))
    strains, heated = _in_order(states)
    columns = []
    for state in (*strains, *heated):
        own = None if free is None else state.temperature * free
        fields = elements.fields(state.displacement, np.abs(state.displacement), state.along, own)
        out = float(elements.area @ fields.stress[:, 2]) if files.is_spatial else 0.0
        column = [float((other.displacement * fields.force).sum()) + other.along * out for other in strains]
        columns.append(np.array(column) + [_springs(cell, case, other, state) for other in strains])
    return np.asarray(np.stack(columns, axis=1) / cell.area)


def _grown(cell: DiscreteCell, growth: float, states: list[State]) -> tuple[Mesh, list[State]]:
    """Return the mesh where all radii have grown by this share, and the states at the same u - E x.

    Nodes around a fibre move as its circle does, less and less to nothing halfway to the next fibre.
    """
    files, x = cell.files, cell.files.mesh.points
    fibres, images = files.fibres, np.array([[i, j] for i in (-1, 0, 1) for j in (-1, 0, 1)]) * files.size
    V = np.zeros_like(x)
    for c, R in zip(fibres.centre, fibres.radius, strict=True):
        gaps = np.linalg.norm(fibres.centre[:, None] + images - c, axis=2) - fibres.radius[:, None] - R
        half = np.partition(gaps.ravel(), 1)[1] / 2  # the least is that to itself, -2 R
        d = (x - c + files.size / 2) % files.size - files.size / 2
        r = np.hypot(*d.T)
        V += d * np.where(r < R * (1 + SAME), 1.0, R / np.maximum(r, R) * np.maximum(1 - (r - R) / half, 0.0))[:, None]
    terms = np.column_stack([x, np.ones(len(x))])
    found = []
    for state in states:
        H = np.linalg.lstsq(terms, state.displacement - state.fluctuation, rcond=None)[0][:2]
        found.append(replace(state, displacement=state.displacement + growth * V @ H))
    return replace(files.mesh, points=x + growth * V), found


def _in_order(states: list[State]) -> tuple[list[State], list[State]]:
    """Return those under unit strains in the order of their components, and that under a temperature."""
    strains = [state for state in states if not state.temperature]
    ordered = [strains[SPATIAL_ORDER.index(k)] for k in range(6)] if len(strains) == 6 else strains
    return ordered, [state for state in states if state.temperature]


def _springs(cell: DiscreteCell, case: Mapping[str, Any], first: State, second: State) -> float:
    """Sum of [u] k l [u] over the bonds that are no glue."""
    sections, rows = case.get("interface") or [], cell.files.interface
    found = 0.0
    for number, section in enumerate(sections if isinstance(sections, list) else [sections]):
        around = section.get("tangential_stiffness")
        stiffnesses = section.get("normal_stiffness"), around, section.get("axial_stiffness") or around
        for k, stiffness in zip(range(first.jump.shape[1]), stiffnesses, strict=False):
            if stiffness is not None and np.isfinite(float(stiffness)):
                # Closed faces press on what is left of their springs.
                holds = (rows.pair == number) & ((first.status == BONDED) | ((first.status == CLOSED) & (k == 0)))
                own = rows.length * first.jump[:, k] * second.jump[:, k]
                found += float(stiffness) * float(own[holds].sum())
    return found


def changed(C: Float, heat: Float | None, change: Float) -> tuple[Float, Float | None]:
    """Return a stiffness and a thermal stress, if any, after a change (n, n) or (n, n + 1) of both."""
    n = len(C)
    return C + change[:, :n], None if heat is None else heat + change[:, n]


def constants_of(C: Float, heat: Float | None) -> dict[str, float]:
    """Return every constant by its name."""
    n = len(C)
    found = {f"C{i + 1}{j + 1}": float(C[i, j]) for i in range(n) for j in range(i, n)}
    if n == 3:
        return found | moduli(C)
    strains = None if heat is None else -np.linalg.solve(C, heat)
    about = about_fibres(C, strains)
    found |= engineering_constants(C) | {name: value for name, value in about.items() if value is not None}
    if heat is None or strains is None:
        return found
    found |= {"expansion_x1": float(strains[0]), "expansion_x2": float(strains[1])}
    return found | {f"thermal_S{k + 1}{k + 1}": float(heat[k]) for k in range(3)}
