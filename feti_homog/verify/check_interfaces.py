"""Laws of the interfaces in one state: jumps, bonds, contact."""

from __future__ import annotations

import numpy as np

from feti_homog.verify.bonds import law_at
from feti_homog.verify.check_fields import in_axes, largest_displacement
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.reading import State

BONDED, CLOSED, OPEN = 0, 1, 2


def check_interface_state(findings: Findings, cell: DiscreteCell, state: State) -> None:
    """Check that jumps are those of the displacements, bonds hold, and debonded faces obey the contact conditions."""
    at = f"{state.name}, interface node {{}}".format
    values = state.fluctuation[cell.nodes.node]
    parted = cell.faces.means(values, of_fibre=False) - cell.faces.means(values, of_fibre=True)
    largest = largest_displacement(cell, state)
    findings.record("jump", relative(np.abs(in_axes(cell, state.jump) - parted).max(axis=1, initial=0.0), largest), at)
    slack = state.jump - law_at(cell.files).jumps(state.traction)
    findings.record("bond", relative(np.where(state.status != OPEN, np.abs(slack[:, 0]), 0.0), largest), at)
    findings.record(
        "bond", relative(np.where(state.status == BONDED, np.abs(slack[:, 1:]).max(axis=1), 0.0), largest), at
    )
    if (state.status != BONDED).any():
        _check_contact(findings, cell, state)


def _check_contact(findings: Findings, cell: DiscreteCell, state: State) -> None:
    """gap >= 0, traction <= 0, gap traction = 0, and no other force on debonded faces."""
    at = f"{state.name}, interface node {{}}".format
    debonded, closed = state.status != BONDED, state.status == CLOSED
    gap = (state.jump - law_at(cell.files).jumps(state.traction))[:, 0]
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
