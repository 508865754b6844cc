"""Bonds of each interface node by the case, and the inner one of two bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from feti_homog.typing import AnyInt, Bool, Float, Int
from feti_homog.verify.bond_laws.law import BondLaw, law_of
from feti_homog.verify.cell_tables import Mesh, State
from feti_homog.verify.reading import ResultFiles
from feti_homog.verify.torus import TornSides

COATING = "coating"
NUMBERS = ("normal_stiffness", "tangential_stiffness", "axial_stiffness", "normal_strength", "tangential_strength",
           "axial_strength", "toughness", "mode_sensitivity", "normal_toughness", "tangential_toughness",
           "mixing_exponent")  # fmt: skip
DEFAULTS = {"axial_stiffness": "tangential_stiffness", "axial_strength": "tangential_strength"}


def law_at(files: ResultFiles, nodes: AnyInt | Bool | slice = slice(None), damage: Float | None = None) -> BondLaw:
    """Law of the bonds at some interface nodes; those of a state with the damage (k,) of all nodes.

    Its section has, of several or of fibres of different strengths, numbers (p,) of each node in place of one.
    """
    sections, strength = files.interfaces, files.fibres.strength
    section = {**sections[0]} if sections else {}
    if sections and (len(sections) > 1 or (strength != 1).any()):
        pair, factor = files.interface.pair[nodes], strength[files.interface.fibre[nodes] - 1]
        numbers = {name: np.array([_number(own, name) for own in sections])[pair] for name in NUMBERS}
        section |= numbers
        section |= {name: numbers[name] * factor for name in NUMBERS if name.endswith("strength")}
        section |= {name: numbers[name] * factor**2 for name in NUMBERS if name.endswith("toughness")}
    return law_of(section if damage is None else section | {"damage": damage[nodes]})


def friction_at(files: ResultFiles) -> Float:
    """(k,) coefficient of friction of the interface nodes."""
    return _of_pairs(files, [float(section.get("friction", 0.0)) for section in files.interfaces or [{}]])


def friction_of_damage_at(files: ResultFiles) -> Float:
    """(k,) coefficient of friction of the damaged share of bonds that hold."""
    on = [float(section.get("friction_on_damage", False)) for section in files.interfaces or [{}]]
    return _of_pairs(files, on) * friction_at(files)


def _of_pairs(files: ResultFiles, values: Sequence[float]) -> Float:
    """(k,) the value of the section of each interface node."""
    found: Float = np.array(values, float)[np.minimum(files.interface.pair, len(values) - 1)]
    return found


def rubbing_force(files: ResultFiles, state: State) -> Float:
    """(k,) shear on the damaged share of bonds that hold, where friction acts on it; 0 of others.

    The slip is C_0 traction + g, the force is traction - g / (C - C_0).
    """
    unit, none = np.ones_like(state.traction), np.zeros(len(state.damage))
    intact, whole = (law_at(files, damage=own).jumps(unit)[:, 1] for own in (none, state.damage))
    own = (state.status == 0) & (whole > intact) & (friction_of_damage_at(files) > 0.0)
    g = state.jump[:, 1] - intact * state.traction[:, 1]
    return np.where(own, state.traction[:, 1] - g / np.where(own, whole - intact, 1.0), 0.0)


def held_traction(files: ResultFiles, state: State) -> Float:
    """(k, c) tractions; of damaged bonds without that on their damaged share."""
    held = state.traction.copy()
    held[:, 1] -= state.damage * rubbing_force(files, state)
    return held


def energy_of_springs(files: ResultFiles, state: State) -> float:
    """Return what all springs store: of bonds that rub (1 - d) K s^2 / 2 and f^2 / (2 K) of the share d."""
    held, force = held_traction(files, state), rubbing_force(files, state)
    law = law_at(files, damage=state.damage)
    intact = law_at(files, damage=np.zeros(len(force))).jumps(np.ones_like(held))[:, 1]
    twice = (held * law.jumps(held)).sum(axis=1) + state.damage * intact * force**2
    return float(twice @ files.interface.length) / 2


def _number(section: Mapping[str, Any], name: str) -> float:
    """Return the value of a section, or of the key that it defaults to; inf if there is none."""
    value = section.get(name)
    value = section.get(DEFAULTS.get(name, name)) if value is None else value
    return np.inf if value is None else float(value)


def pairs_of(files: ResultFiles) -> Int:
    """(phases, phases) place of the section of the interfaces between two phases, -1 where they never part."""
    pairs = np.full((len(files.phases),) * 2, -1)
    for number, section in enumerate(files.interfaces or [{}]):
        if "between" not in section:
            pairs[0, 1:] = pairs[1:, 0] = number
        else:
            first, second = (files.phases.index(name) for name in section["between"])
            pairs[first, second] = pairs[second, first] = number
    return pairs


def inwardness(mesh: Mesh, phases: tuple[str, ...], sides: TornSides, part: Int) -> Int:
    """(parts,) ranks of parts, the larger, the farther inwards.

    They go by bodies between one and the matrix, then coatings before others, then by their labels; `part`
    (subdomains,) is that of each.
    """
    paired = np.flatnonzero(sides.partner >= 0)
    here, there = sides.element[paired], sides.element[sides.partner[paired]]
    ends = part[mesh.subdomain[here]], part[mesh.subdomain[there]]
    n = int(part.max()) + 1
    phase, label = np.zeros(n, np.int64), np.zeros(n, np.int64)
    phase[part[mesh.subdomain]], label[part[mesh.subdomain]] = mesh.phase, mesh.body
    graph = csr_matrix((np.ones(len(paired)), ends), shape=(n, n))
    steps = dijkstra(graph, directed=False, indices=np.flatnonzero(phase == 0), unweighted=True, min_only=True)
    coats = np.array([name == COATING for name in phases])[phase]
    place = np.empty(n, np.int64)
    place[np.lexsort((label, ~coats, steps))] = np.arange(n)
    return place
