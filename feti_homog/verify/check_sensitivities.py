"""Check sensitivities: if constants of the case change, energies change as the file says."""

import copy
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.bonds import law_at
from feti_homog.verify.check_constants import NOISE, constants_of
from feti_homog.verify.check_loads import NAMES
from feti_homog.verify.constitutive_law import laws, mixed_phases
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.elements import Elements
from feti_homog.verify.findings import STEP, Findings, Section, relative
from feti_homog.verify.reading import State, Status, gradient
from feti_homog.verify.torus import from_centre

TINY = float(np.finfo(float).tiny)
SPRINGS = ("normal_stiffness", "tangential_stiffness", "axial_stiffness")
Case = dict[str, Any]


def check_sensitivities(findings: Findings, cell: DiscreteCell) -> None:
    """Check the values of all constants, and their derivatives in one direction, in which all parameters change."""
    document = cell.files.document
    if "sensitivities" not in document:
        if cell.files.case.get("output", {}).get("sensitivities"):
            findings.record("tables", np.inf, "sensitivities, which are missing")
        return
    data = document["sensitivities"]
    names = data["parameters"]
    missing = sorted(_parameters(cell).difference(names))
    findings.record("tables", [np.inf] * len(missing), lambda i: f"sensitivities, {missing[i]}")
    places = (_place(dict(cell.files.case), name) for name in names)
    values = np.array([np.array(table[key], float)[index] for table, key, index in places])
    # Sizes of changes for which the laws are nearly linear.
    ratios = np.array([name.endswith(".poisson") for name in names]) & (values < 0.5)
    sizes = np.where(ratios, 0.5 - values, np.where(values == 0.0, 1.0, np.abs(values)))
    k = np.arange(1, len(values) + 1)
    direction = sizes * (-1.0) ** k * (1 + 1 / k)  # changes with both signs and different sizes, none of them small
    states = list(cell.files.states())
    if "load" not in document and data.get("at_fixed_status"):
        states = states[: len(states) // 2]  # the second half is under minus the unit loads
    energies = []
    for sign in (1, -1):
        case: Case = copy.deepcopy(dict(cell.files.case))
        for name, value in zip(names, values + sign * STEP * direction, strict=True):
            table, key, index = _place(case, name)
            numbers = np.array(table[key], float)
            numbers[index] = numbers[index[::-1]] = value  # matrices are symmetric
            table[key] = numbers.tolist()
        energies.append(_energies(cell, states, case))
    check = _check_load if "load" in document else _check_moduli
    check(findings, cell, states, (energies[0] - energies[1]) / (2 * STEP), direction)


def _parameters(cell: DiscreteCell) -> set[str]:
    """Return the names of all phase and spring constants on which the result depends.

    Names end in .k for one of several numbers, in .Cij or .kij for an entry of a stiffness or conductivity.
    """
    document, sections, names = cell.files.document, cell.files.interfaces, set[str]()
    material, conducts = cell.files.case["material"], "effective_conductivity" in document
    pairs = [(phase, key) for phase in {*cell.files.phases} & material.keys() for key in material[phase]]
    for phase, key in pairs:
        turns_conductivity = conducts and key == "angle" and np.ndim(material[phase]["conductivity"]) == 2
        if (key == "conductivity" or turns_conductivity) is not conducts or key == "strength":
            continue
        if "thermal_stress" in document or not key.startswith("expansion"):
            value = material[phase][key]
            numbers = np.array([*value] if isinstance(value, dict) else value)
            ends = [f".{end}" for end in (value if isinstance(value, dict) else range(1, numbers.size + 1))]
            if numbers.ndim > 1:
                ends = [f".{'k' if conducts else 'C'}{i + 1}{j + 1}" for i, j in np.argwhere(np.triu(numbers))]
            names |= {f"material.{phase}.{key}{end}" for end in (ends if numbers.ndim else [""])}
    springs = ("conductance",) if conducts else SPRINGS
    for number, section in enumerate(sections, start=1):
        name = f"interface.{number}" if len(sections) > 1 else "interface"
        names |= {f"{name}.{key}" for key in springs if np.isfinite(float(section.get(key) or np.inf))}
    return names


def _check_moduli(findings: Findings, cell: DiscreteCell, states: list[State], slope: Float, direction: Float) -> None:
    """Check effective constants, and their derivatives along `direction` (parameters,).

    `slope`, (v, v) or (6, 7), has derivatives of `_energies`.  At fixed contact status it gives derivatives of C_kk;
    other constants need fields under other loads with this status, which no file has: only their values are checked.
    """
    document, data = cell.files.document, cell.files.document["sensitivities"]
    k, heat = document.get("effective_conductivity"), document.get("thermal_stress")
    C = np.array(document["effective_stiffness"] if k is None else k)
    heat, n = None if heat is None else np.array(heat), len(C)
    law, floor = "moduli" if k is None else "constants", NOISE
    constants = constants_of(C, heat) if k is None else _entries("k", C)
    if k is not None:
        changes = _entries("k", slope[::-1, ::-1])  # the states are in the order of `GRADIENT`
    elif data.get("at_fixed_status"):
        data.leaves_open("derivatives")
        law, floor = "constants", 0.0
        thermal = {name: value for name, value in constants.items() if name.startswith("thermal")}
        constants = thermal | _entries("C", C)
        changes = {f"C{i + 1}{i + 1}": slope[i, i] for i in range(n)}
        for name, energy in zip(changes, np.diag(_energies(cell, states, cell.files.case)), strict=True):
            value = data["constant_values"][data["constants"].index(name)]
            findings.compare("constants", value, energy, max(abs(energy), TINY), name)
    else:
        step = STEP * np.abs(C).max() / max(float(np.abs(slope).max()), TINY)
        steps = step * slope, -step * slope
        ends = [constants_of(C + dC[:, :n], None if heat is None else heat + dC[:, n]) for dC in steps]
        changes = {name: (ends[0][name] - ends[1][name]) / (2 * step) for name in constants}
    rows = zip(data["constants"], data["constant_values"], data["derivatives"], strict=True)
    for name, value, derivatives in rows:
        expected, terms = constants.get(name, np.nan), np.array(derivatives) * direction
        largest = max([abs(constants[other]) for other in constants if other[0] == name[0]], default=0.0)
        size = max(abs(expected), floor * largest, TINY)
        findings.compare(law, value, expected, size, f"sensitivities, {name}")
        if name in changes:
            scale = max(float(np.abs(terms).max()), size)
            findings.compare("sensitivities", terms.sum(), changes[name], scale, name)


def _entries(symbol: str, matrix: Float) -> dict[str, float]:
    return {f"{symbol}{i + 1}{j + 1}": float(value) for (i, j), value in np.ndenumerate(matrix)}


def _check_load(findings: Findings, cell: DiscreteCell, states: list[State], slope: Float, direction: Float) -> None:
    """Check strains x, stresses s and stored energy under one load, and their derivatives.

    With prescribed strains x_g and stresses s_f, d(x_g.s_g - x_f.s_f) / 2 is the derivative of the energy at fixed
    fields.  Under a temperature only the values are checked, because its conjugate is not in the files.
    """
    data, point = cell.files.document["sensitivities"], cell.files.document["load"]
    pairs = [*zip(*NAMES[len(point["strain"])], strict=True)]
    values = dict(zip(data["constants"], data["constant_values"], strict=True))
    derivatives = dict(zip(data["constants"], data["derivatives"], strict=True))
    answers = [[name for name in pair if name in values] for pair in pairs]
    is_complete = all(len(names) == 1 for names in answers) and "stored" in values
    findings.require("tables", is_complete, "sensitivities, constants of the load")
    if not is_complete:
        return
    stored_terms = np.array(derivatives["stored"]) * direction
    terms, rest = np.zeros_like(direction), stored_terms.copy()
    for (name,), strain, stress, (strain_name, _) in zip(answers, point["strain"], point["stress"], pairs, strict=True):
        value, conjugate, sign = (strain, stress, -1) if name == strain_name else (stress, strain, 1)
        size = max(map(abs, point["strain" if name == strain_name else "stress"]))
        findings.compare("constants", values[name], value, size, name)
        change = conjugate / 2 * np.array(derivatives[name]) * direction
        terms, rest = terms + sign * change, rest - change
    if states[0].temperature:
        data.leaves_open("derivatives")
        return
    energy = _energies(cell, states, cell.files.case)[0, 0] / 2
    findings.compare("constants", values["stored"], energy, max(abs(energy), TINY), "stored")
    scale = max(float(np.abs(terms).max()), float(np.abs(stored_terms).max()), abs(energy))
    off = [terms.sum() - slope[0, 0] / 2, rest.sum()]
    findings.record("sensitivities", relative(off, scale), lambda k: ("the load", "stored")[k])


def _place(case: Case, name: str) -> tuple[Any, str, tuple[int, ...]]:
    """Return the table and key of a parameter, and its array index, () for a scalar."""
    section, *keys = name.split(".")
    table: Any = case[section]
    if section == "material" or isinstance(table, list):
        first = keys.pop(0)
        table = table[int(first) - 1] if isinstance(table, list) else table[first]
    if isinstance(table[keys[0]], dict):
        table = table[keys.pop(0)]
    return table, keys[0], tuple(int(digit) - 1 for digit in "".join(keys[1:]) if digit.isdigit())


def _energies(cell: DiscreteCell, states: list[State], case: Mapping[str, Any]) -> Float:
    """Compute the matrix <sigma_j : eps_i> plus spring work between states, (v, v) or (6, 7), for a `case`.

    Rows i are the states under strains, in the order of components; columns j end with the state under temperature.
    """
    files, phases = cell.files, cell.files.phases
    growth = float(np.log(case["cell"].get("fibre_fraction", 1.0) / files.case["cell"].get("fibre_fraction", 1.0))) / 2
    x, V = files.mesh.points, np.zeros_like(files.mesh.points)
    fibres, images = files.fibres, np.array([[i, j] for i in (-1, 0, 1) for j in (-1, 0, 1)]) * files.size
    # If radii grow, nodes around a fibre move with its circle, by amounts that fall to 0 halfway to the next fibre;
    # u - E x at the nodes does not change.
    for c, R in zip(fibres.centre, fibres.radius, strict=True) if growth else ():
        gaps = np.linalg.norm(fibres.centre[:, None] + images - c, axis=2) - fibres.radius[:, None] - R
        half = np.partition(gaps.ravel(), 1)[1] / 2  # the least gap, -2 R, is to the fibre itself
        d = from_centre(x, c, files.size)
        r = np.hypot(*d.T)
        V += growth * d * (R / np.maximum(r, R) * np.clip(1 - (r - R) / half, 0.0, 1.0))[:, None]
    mesh = replace(files.mesh, points=x + V)
    states = [replace(state, displacement=state.displacement + V @ gradient(state.strain).T) for state in states]
    stiffnesses, free = laws(case, phases)
    # Elements keep their kind, even if equal constants become different.
    elements = Elements(mesh, stiffnesses, mixed_phases(files.case, phases))
    none, lengths = np.zeros_like(states[0].jump), files.interface.length[:, None]
    flexibility = law_at(replace(files, document=Section({"case": case}))).jumps(none + 1.0)
    springs = np.divide(lengths, flexibility, out=none, where=flexibility > 0.0)
    strains, columns = [state for state in states if not state.temperature], []
    strains.sort(key=lambda state: int(np.abs(state.strain).argmax()))  # in the order of components
    for state in (*strains, *(state for state in states if state.temperature)):
        free_strain = state.temperature * free
        fields = elements.fields(state.displacement, np.abs(state.displacement), state.along, free_strain)
        out = float(elements.area @ fields.stress[:, 2]) if files.is_spatial else 0.0
        columns.append([float((other.displacement * fields.force).sum()) + other.along * out for other in strains])
        for row, other in enumerate(strains):
            acts = np.repeat((other.status == Status.BONDED)[:, None], other.jump.shape[1], axis=1)
            acts[other.status == Status.CLOSED, 0] = True  # springs of closed faces act in compression
            columns[-1][row] += float((springs * other.jump * state.jump)[acts].sum())
    return np.array(columns).T / cell.area
