"""Laws of the interfaces in one state: jumps, bonds, contact."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.bonds import bonds_of
from feti_homog.verify.check_fields import in_axes, largest_displacement
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.reading import State

BONDED, CLOSED, OPEN = 0, 1, 2


def check_interface_state(findings: Findings, cell: DiscreteCell, state: State) -> None:
    """The jumps are those of the displacements; bonds hold; debonded faces obey the conditions of contact."""
    at = f"{state.name}, interface node {{}}".format
    values = state.fluctuation[cell.nodes.node]
    parted = cell.faces.means(values, of_fibre=False) - cell.faces.means(values, of_fibre=True)
    largest = largest_displacement(cell, state)
    findings.record("jump", relative(np.abs(in_axes(cell, state.jump) - parted).max(axis=1, initial=0.0), largest), at)
    slack = state.jump - spring_jumps(cell, state)
    findings.record("bond", relative(np.where(state.status != OPEN, np.abs(slack[:, 0]), 0.0), largest), at)
    findings.record(
        "bond", relative(np.where(state.status == BONDED, np.abs(slack[:, 1:]).max(axis=1), 0.0), largest), at
    )
    if (state.status != BONDED).any():
        _check_contact(findings, cell, state)


def spring_jumps(cell: DiscreteCell, state: State) -> Float:
    """(k, c) what elastic bonds give way: traction / stiffness."""
    stiffness = _along_fibres(bonds_of(cell.files), "stiffness")
    return np.asarray(state.traction / stiffness[..., : state.traction.shape[1]])


def _along_fibres(section: Mapping[str, Any], what: str) -> Float:
    """(3,) or (k, 3) normal, tangential and axial stiffness or strength; the last is by default the second."""
    normal, tangential = (section.get(f"{name}_{what}", np.inf) for name in ("normal", "tangential"))
    components = normal, tangential, section.get(f"axial_{what}", tangential)
    return np.stack(np.broadcast_arrays(*(np.asarray(value, float) for value in components)), axis=-1)


def utilisation(section: Mapping[str, Any], traction: Float) -> Float:
    """(k,) share of their strength that tractions (k, 2), or with that along the fibre (k, 3), use; compression uses
    none."""
    if section.get("criterion") == "energy":
        return _energy_share(section, traction)
    used = shares(section, traction)
    if section.get("criterion") == "quadratic":
        return np.asarray(np.sqrt(np.square(used).sum(axis=1)))
    return np.asarray(used.max(axis=1, initial=0.0))


def shares(section: Mapping[str, Any], traction: Float) -> Float:
    """(k, c) what each component uses of its strength."""
    return np.asarray(_pulls(traction) / _along_fibres(section, "strength")[..., : traction.shape[1]])


def _pulls(traction: Float) -> Float:
    """(k, c) sizes of the components that count: not of compression."""
    return np.column_stack([np.maximum(traction[:, 0], 0.0), np.abs(traction[:, 1:])])


def spring_energies(section: Mapping[str, Any], traction: Float) -> Float:
    """(k, 2) G_I = <t_n>^2 / (2 k_n) and G_II = t_t^2 / (2 k_t) of tractions (k, 2); t_a^2 / (2 k_a) adds to the
    latter."""
    energies = _pulls(traction) ** 2 / (2 * _along_fibres(section, "stiffness")[..., : traction.shape[1]])
    return np.column_stack([energies[:, 0], energies[:, 1:].sum(axis=1)])


def mode(section: Mapping[str, Any], traction: Float) -> Float:
    """(k,) psi of tractions (k, 2), tan^2 psi = G_II / G_I."""
    first, second = np.sqrt(spring_energies(section, traction)).T
    return np.asarray(np.arctan2(second, first))


def toughness(section: Mapping[str, Any], psi: Float) -> Float:
    """(k,) G_c = G_Ic [1 + tan^2((1 - lambda) psi)]."""
    turned = (1 - np.asarray(section["mode_sensitivity"], float)) * psi
    return np.asarray(np.asarray(section["toughness"], float) * (1 + np.tan(turned) ** 2))


def _energy_share(section: Mapping[str, Any], traction: Float) -> Float:
    """(k,) sqrt(G / G_c) of the springs' energies G = G_I + G_II."""
    return np.asarray(
        np.sqrt(spring_energies(section, traction).sum(axis=1) / toughness(section, mode(section, traction)))
    )


def _check_contact(findings: Findings, cell: DiscreteCell, state: State) -> None:
    """gap >= 0, traction <= 0, gap traction = 0, and no other force on debonded faces."""
    at = f"{state.name}, interface node {{}}".format
    debonded, closed = state.status != BONDED, state.status == CLOSED
    gap = (state.jump - spring_jumps(cell, state))[:, 0]
    normal, shear = state.traction[:, 0], np.abs(state.traction[:, 1:]).max(axis=1)
    length, imposed, least = cell.files.interface.length, cell.imposed(state), cell.least_stress(state)
    pull, force = max(float(np.abs(state.traction).max()), least), np.abs(normal) * length
    push = max(float(force.max()), least * float(length.max()))
    free = np.where(debonded, shear, 0.0) + np.where(state.status == OPEN, np.abs(normal), 0.0)
    findings.record("free faces", relative(free, pull), at)
    if cell.files.contact:
        findings.record("penetration", relative(np.where(debonded, np.maximum(-gap, 0.0), 0.0), imposed), at)
        findings.record("tension", relative(np.where(closed, np.maximum(normal, 0.0), 0.0), pull), at)
        findings.record("complementarity", relative(np.where(debonded, force * gap, 0.0), push * imposed), at)
