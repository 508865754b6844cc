"""`analysis.type = "envelope"`: the onset of debonding in a plane of macroscopic stresses or strains.

The cell is linear, so tractions of all loads are superposed from those of the unit loads: no direction costs a solve.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from feti_homog.analysis.constants import constants
from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.criteria import criterion_of
from feti_homog.analysis.mesh_errors import mesh_error, unit_errors
from feti_homog.analysis.registry import Analysis
from feti_homog.analysis.result_records import EnvelopePoint
from feti_homog.analysis.tip_records import DIRECTION_DIGITS, bond_directions
from feti_homog.case.loads import Envelope
from feti_homog.errors import CaseError
from feti_homog.homogenization.averaging import Response, asymmetry
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.path.onset import Onset
from feti_homog.interface.path.path_points import UTILISATION_TIE
from feti_homog.materials.voigt import voigt_names
from feti_homog.typing import Float, Int

# Bonds times directions that are looked at together.
CHUNK = 200_000
# A cosine that is smaller than this is what rounding leaves of zero.
COSINE_ROUNDING = 1e-15


@dataclass(frozen=True)
class Rays:
    """Macroscopic states before + f ahead, f >= 0, on each of n rays.

    Attributes:
        strain, stress: (n, m) for f = 1, without `before`.
        strain_before, stress_before: (m,) after the change of temperature.
        temperature: that change.
    """

    strain: Float
    stress: Float
    strain_before: Float
    stress_before: Float
    temperature: float

    def at(self, number: int, factor: float) -> dict[str, Any]:
        """Return the factor, strain (m,) and stress (m,) on a ray."""
        strain = self.strain_before + factor * self.strain[number]
        return {"factor": factor, "strain": strain, "stress": self.stress_before + factor * self.stress[number]}


def run(context: AnalysisContext) -> dict[str, Any]:
    """Return `envelope`, `effective_stiffness` and, if a temperature is a load, `thermal_stress`.

    `envelope` is a list of directions with the load at which the first bond breaks; the others follow from unit loads.

    Raises:
        CaseError: faces of the mesh are debonded and may touch.
    """
    section, bonds = context.case.section, context.bonds(None)
    assert isinstance(section, Envelope)
    if not context.plane.interface.is_linear(bonds.status):
        raise CaseError(
            '[interface] contact: expected false with a debonded curve of the mesh; [analysis] type = "envelope" '
            "superposes loads, which contact forbids"
        )
    columns, responses = context.unit_responses("", bonds, context.loads.zero_multipliers(), 1.0)
    errors, responses = unit_errors(context, responses)
    context.record_unit_states(responses, 1.0, "", 0)
    stiffness = columns.pop("stiffness")
    context.checks.require("L^ef", {"symmetry": asymmetry(stiffness)})
    angles = 360.0 * np.arange(section.directions) / section.directions
    rays = rays_of(section.plane, angles, stiffness, columns.get("thermal_stress"), section.temperature or 0.0)
    law = criterion_of(context.cell)
    finder = _Finder(context, responses, law, Onset.of(law, context.loads.interfaces, bonds))
    pairs = zip(angles, finder.points(rays), strict=True)
    points = tuple(EnvelopePoint(angle=float(angle), **point) for angle, point in pairs)
    secants: dict[str, Any] = {"effective_stiffness": stiffness} | columns
    secants |= constants(context.cell, secants)
    return {"envelope": points} | secants | mesh_error(context, secants, errors, [])


def rays_of(
    plane: Sequence[str], angles: Float, stiffness: Float, thermal_stress: Float | None, temperature: float
) -> Rays:
    """Return the rays in directions (n,), degrees, of a plane whose axes have these names.

    They are of stresses at E = C^-1 S, with no other stresses, or of strains; after a change of temperature at zero
    stress, or strain.
    """
    strains, stresses = voigt_names(len(stiffness))
    of_stresses = plane[0] in stresses
    names = stresses if of_stresses else strains
    unit = np.stack([np.cos(np.radians(angles)), np.sin(np.radians(angles))], axis=1)
    loads = np.zeros((len(angles), len(names)))
    loads[:, [names.index(name) for name in plane]] = np.where(np.abs(unit) < COSINE_ROUNDING, 0.0, unit)
    of_temperature = np.zeros(len(names)) if thermal_stress is None else temperature * thermal_stress
    nothing = np.zeros(len(names))
    if of_stresses:
        by_cooling = -np.linalg.solve(stiffness, of_temperature)
        return Rays(np.linalg.solve(stiffness, loads.T).T, loads, by_cooling, nothing, temperature)
    return Rays(loads, loads @ stiffness.T, nothing, of_temperature, temperature)


class _Finder:
    """Finds the first bond that breaks on each ray."""

    def __init__(self, context: AnalysisContext, responses: Sequence[Response], law: BondLaw, onset: Onset) -> None:
        """Take the responses to the unit loads.  Collective."""
        cell = context.cell
        self._comm, self._law, self._onset, self._loads = cell.comm, law, onset, context.loads.names
        self._problems, self._noise = context.loads.interfaces.problems, context.plane.interface.scales.sign_noise
        self._unit = _tractions(context, responses)
        self._most = max(1, self._comm.allreduce(self._unit.shape[1], MPI.MAX))
        nodes = cell.solver.jump_operator.nodes
        self._direction, self._fibre = bond_directions(cell), cell.summary.fibre_number(nodes.fibre)
        self._pair, self._interfaces = nodes.pair, len(context.case.interfaces)
        self._order = np.lexsort((np.round(self._direction, DIRECTION_DIGITS), self._pair, self._fibre))

    def points(self, rays: Rays) -> Iterator[dict[str, Any]]:
        """Yield the entry of each ray in result.json, without its direction.  Collective."""
        names = voigt_names(rays.strain.shape[1])[0]
        at_start = self._tractions(rays.strain_before[None], rays.temperature, names)[0]
        before = at_start if rays.temperature else None
        node = np.arange(len(at_start))
        used = self._onset.utilisation(at_start, node)
        most = float(self._comm.allreduce(used.max(initial=0.0), MPI.MAX))
        size = max(1, CHUNK // self._most)
        for first in range(0, len(rays.strain), size):
            rows = slice(first, first + size)
            ahead = self._tractions(rays.strain[rows], 0.0, names)
            if most < 1.0:
                factors = self._onset.factors(ahead, self._least(rays.strain[rows], names, ahead.shape[2]), before)
            else:
                factors = np.tile(np.where(used >= most * (1.0 - UTILISATION_TIE), 0.0, np.inf), (len(ahead), 1))
            found = self._first(factors, at_start, ahead)
            for row, bond in enumerate(found, first):
                yield {} if np.isinf(bond[0]) else rays.at(row, float(bond[0])) | self._of_bond(bond)

    def _tractions(self, strain: Float, temperature: float, names: Sequence[str]) -> Float:
        """(n, k, c) under strains (n, m) of these names and a change of temperature."""
        return np.tensordot(self._unit_loads(strain, temperature, names), self._unit, axes=1)

    def _unit_loads(self, strain: Float, temperature: float, names: Sequence[str]) -> Float:
        """(n, l) how much of each unit load these are."""
        column = {name: strain[:, number] for number, name in enumerate(names)}
        column["temperature"] = np.full(len(strain), temperature)
        return np.stack([column[load] for load in self._loads], axis=1)

    def _least(self, strain: Float, names: Sequence[str], components: int) -> Float:
        """(n, k) utilisations that the solver's error makes under strains (n, m) of these names.

        Of tractions that each problem has an error of at each bond. Collective.
        """
        loads, first, total = self._unit_loads(strain, 0.0, names), 0, np.zeros((len(strain), len(self._fibre)))
        parts = ((0, 1), (2,))[: len(self._problems)]
        for problem, part in zip(self._problems, parts, strict=True):
            end = first + len(problem.solver.problem.loads)
            of_one = np.zeros((len(self._fibre), components))
            of_one[:, part] = 1.0
            total += problem.scales.bond_stress(loads[:, first:end].T).T * self._law.share(of_one)
            first = end
        return self._noise * total

    def _first(self, factors: Float, before: Float, ahead: Float) -> Float:
        """(n, 4 + d) least factor of each ray, fibre, interface and direction of its bond, and how it breaks.

        Of those that break together the one of the first fibre and interface and the least direction. Collective.
        """
        n, d = len(factors), len(self._break_names(ahead.shape[2]))
        least = factors.min(axis=1, initial=np.inf)
        self._comm.Allreduce(MPI.IN_PLACE, least, MPI.MIN)
        own = np.full((n, 4 + d), np.inf)
        own[:, 0] = least
        together = factors[:, self._order] <= least[:, None] * (1.0 + UTILISATION_TIE)
        rays = np.flatnonzero(together.any(axis=1) & np.isfinite(least))
        node: Int = self._order[together[rays].argmax(axis=1)] if len(rays) else np.zeros(0, np.int64)
        own[rays, 1:4] = np.column_stack([self._fibre[node], self._pair[node], self._direction[node]])
        own[rays, 4:] = self._breaks(node, before[node] + least[rays, None] * ahead[rays, node])
        table = np.stack(self._comm.allgather(own))
        first = np.lexsort((np.round(table[:, :, 3], DIRECTION_DIGITS), table[:, :, 2], table[:, :, 1]), axis=0)[0]
        return np.asarray(table[first, np.arange(n)])

    def _of_bond(self, bond: Float) -> dict[str, Any]:
        """Return where a bond is, and how it breaks."""
        names = self._break_names(self._unit.shape[2])
        pair = {"interface": int(bond[2]) + 1} if self._interfaces > 1 else {}
        where = {"fibre": int(bond[1])} | pair | {"bond_angle": float(bond[3])}
        return where | dict(zip(names, bond[4:].tolist(), strict=True))

    def _break_names(self, components: int) -> tuple[str, ...]:
        """Return the keys of a break under a traction with this number of components."""
        return tuple(self._law.break_names)[:components]

    def _breaks(self, node: Int, traction: Float) -> Float:
        """(p, d) the same for tractions (p, c) at the nodes (p,)."""
        return self._law.at(node).breaks(traction)


def _tractions(context: AnalysisContext, responses: Sequence[Response]) -> Float:
    """(l, k, c) tractions of this rank's nodes under each unit load.

    Normal and tangential, and along the fibres if there is such a problem.
    """
    components = [problem.cell.solver.problem.components for problem in context.loads.problems]
    found, first, column = list[Float](), 0, 0
    for problem, own in zip(context.loads.problems, components, strict=True):
        beside = [(0, 0), (column, sum(components) - column - own)]
        for response in responses[first : first + len(problem.loads)]:
            found.append(np.pad(problem.interface.traction(response.state.solution), beside))
        first, column = first + len(problem.loads), column + own
    return np.stack(found)


ANALYSIS = Analysis(run, table=True)
