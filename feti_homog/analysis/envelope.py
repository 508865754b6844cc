"""`analysis.type = "envelope"`: debonding onset in a macroscopic stress or strain plane.

The cell is linear, so tractions under all loads are superposed from unit loads: no direction costs a solve.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from feti_homog.analysis.constants import constants, mesh_error, unit_errors
from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.result_records import EnvelopePoint
from feti_homog.analysis.tip_records import DIRECTION_DIGITS, bond_directions, criterion_of
from feti_homog.case import load_sections
from feti_homog.errors import CaseError
from feti_homog.homogenization import averaging
from feti_homog.interface.laws import BondLaw
from feti_homog.interface.path import onsets, path_points
from feti_homog.materials import voigt
from feti_homog.typing import Float, Int

# Bonds times directions that are looked at together.
CHUNK = 200_000
# A cosine that is smaller than this is what rounding leaves of zero.
COSINE_ROUNDING = 1e-15


@dataclass(frozen=True)
class Rays:
    """Macroscopic states on n rays: a start plus f times a direction, f >= 0.

    Attributes:
        strain, stress: (n, m) directions.
        strain_before, stress_before: (m,) starts, after the temperature change.
        temperature: the change.
    """

    strain: Float
    stress: Float
    strain_before: Float
    stress_before: Float
    temperature: float

    def at(self, number: int, factor: float) -> dict[str, Any]:
        """Return factor, strain (m,) and stress (m,) on a ray."""
        strain = self.strain_before + factor * self.strain[number]
        return {"factor": factor, "strain": strain, "stress": self.stress_before + factor * self.stress[number]}


def run(context: AnalysisContext) -> dict[str, Any]:
    """Return `envelope`, `effective_stiffness` and, if a temperature is a load, `thermal_stress`.

    `envelope` lists directions with the load at which the first bond breaks; the other entries follow from unit loads.

    Raises:
        CaseError: faces in the mesh are debonded and may touch.
    """
    section, bonds = context.case.section, context.bonds(None)
    assert isinstance(section, load_sections.Envelope)
    if not context.plane.interface.is_linear(bonds.status):
        raise CaseError(
            '[interface] contact: expected false with a debonded curve of the mesh; [analysis] type = "envelope" '
            "superposes loads, which contact forbids"
        )
    columns, responses = context.unit_responses("", bonds, context.loads.zero_multipliers(), 1.0)
    errors, responses = unit_errors(context, responses)
    context.record_unit_states(responses, 1.0, "", 0)
    stiffness = columns.pop("stiffness")
    context.checks.require("L^ef", {"symmetry": averaging.asymmetry(stiffness)})
    angles = 360.0 * np.arange(section.directions) / section.directions
    rays = rays_of(section.plane, angles, stiffness, columns.get("thermal_stress"), section.temperature or 0.0)
    law = criterion_of(context.cell)
    finder = _Finder(context, responses, law, onsets.Onset.of(law, context.loads.interfaces, bonds))
    pairs = zip(angles, finder.points(rays), strict=True)
    points = tuple(EnvelopePoint(angle=float(angle), **point) for angle, point in pairs)
    secants: dict[str, Any] = {"effective_stiffness": stiffness} | columns
    secants |= constants(context.cell, secants)
    return {"envelope": points} | secants | mesh_error(context, secants, errors, [])


def rays_of(
    plane: Sequence[str], angles: Float, stiffness: Float, thermal_stress: Float | None, temperature: float
) -> Rays:
    """Return the rays in directions (n,), degrees, between axes `plane`.

    Stress rays have E = C^-1 S and begin at zero stress after a temperature change, strain rays begin at zero strain.
    """
    strains, stresses = voigt.voigt_names(len(stiffness))
    by_stress = plane[0] in stresses
    names = stresses if by_stress else strains
    unit = np.stack([np.cos(np.radians(angles)), np.sin(np.radians(angles))], axis=1)
    loads, zero = np.zeros((len(angles), len(names))), np.zeros(len(names))
    loads[:, [names.index(name) for name in plane]] = np.where(np.abs(unit) < COSINE_ROUNDING, 0.0, unit)
    heat_stress = zero if thermal_stress is None else temperature * thermal_stress
    if by_stress:
        heat_strain = -np.linalg.solve(stiffness, heat_stress)
        return Rays(np.linalg.solve(stiffness, loads.T).T, loads, heat_strain, zero, temperature)
    return Rays(loads, loads @ stiffness.T, zero, heat_stress, temperature)


class _Finder:
    """Finds the first bond that breaks on each ray."""

    def __init__(
        self, context: AnalysisContext, responses: Sequence[averaging.Response], law: BondLaw, onset: onsets.Onset
    ) -> None:
        """Take the responses to the unit loads.  Collective."""
        cell = context.cell
        self._comm, self._law, self._onset, self._loads = cell.comm, law, onset, context.loads.names
        self._problems, self._noise = context.loads.interfaces.problems, context.plane.interface.scales.sign_noise
        # (l, k, c) tractions at this rank's nodes by unit load: normal, tangential, and axial in space.
        components = [problem.cell.solver.problem.components for problem in context.loads.problems]
        tractions, column, groups = list[Float](), 0, context.loads.by_problem(responses)
        for problem, c, group in zip(context.loads.problems, components, groups, strict=True):
            padding = [(0, 0), (column, sum(components) - column - c)]
            tractions += [np.pad(problem.interface.traction(r.state.solution), padding) for r in group]
            column += c
        self._unit = np.stack(tractions)
        # Keys of a break under a traction with this number of components.
        self._break_names = tuple(law.break_names)[: self._unit.shape[2]]
        self._chunk = max(1, CHUNK // max(1, self._comm.allreduce(self._unit.shape[1], MPI.MAX)))
        nodes = cell.solver.jump_operator.nodes
        self._direction, self._fibre = bond_directions(cell), cell.summary.fibre_number(nodes.fibre)
        self._pair, self._interfaces = nodes.pair, len(context.case.interfaces)
        self._order = np.lexsort((np.round(self._direction, DIRECTION_DIGITS), self._pair, self._fibre))

    def points(self, rays: Rays) -> Iterator[dict[str, Any]]:
        """Yield each ray's entry in result.json, without its direction.  Collective."""
        names = voigt.voigt_names(rays.strain.shape[1])[0]
        start = np.tensordot(self._unit_loads(rays.strain_before[None], rays.temperature, names), self._unit, axes=1)[0]
        used = self._onset.utilisation(start, np.arange(len(start)))
        largest = float(self._comm.allreduce(used.max(initial=0.0), MPI.MAX))
        for first in range(0, len(rays.strain), self._chunk):
            loads = self._unit_loads(rays.strain[first : first + self._chunk], 0.0, names)
            directions = np.tensordot(loads, self._unit, axes=1)
            if largest < 1.0:
                before = start if rays.temperature else None
                factors = self._onset.factors(directions, self._noise * self._error_utilisation(loads), before)
            else:
                factors = np.tile(
                    np.where(used >= largest * (1.0 - path_points.UTILISATION_TIE), 0.0, np.inf), (len(directions), 1)
                )
            for ray, (factor, fibre, pair, angle, *shares) in enumerate(self._first(factors, start, directions), first):
                if np.isinf(factor):
                    yield {}
                    continue
                section = {"interface": int(pair) + 1} if self._interfaces > 1 else {}
                place = {"fibre": int(fibre)} | section | {"bond_angle": float(angle)}
                yield rays.at(ray, float(factor)) | place | dict(zip(self._break_names, shares, strict=True))

    def _unit_loads(self, strain: Float, temperature: float, names: Sequence[str]) -> Float:
        """(n, l) each unit load's share in strains (n, m) with these names and a temperature change."""
        column = {name: strain[:, number] for number, name in enumerate(names)}
        column["temperature"] = np.full(len(strain), temperature)
        return np.stack([column[load] for load in self._loads], axis=1)

    def _error_utilisation(self, loads: Float) -> Float:
        """(n, k) utilisations by bond stresses under unit loads (n, l).  Collective."""
        first, total = 0, np.zeros((len(loads), len(self._fibre)))
        for problem, part in zip(self._problems, ((0, 1), (2,))[: len(self._problems)], strict=True):
            end = first + len(problem.solver.problem.loads)
            unit = np.zeros((len(self._fibre), self._unit.shape[2]))
            unit[:, part] = 1.0
            total += problem.scales.bond_stress(loads[:, first:end].T).T * self._law.share(unit)
            first = end
        return total

    def _first(self, factors: Float, before: Float, directions: Float) -> list[list[float]]:
        """Return each ray's least factor, its bond and break shares.

        In a row: factor, then fibre, interface and direction of the bond, then shares of the break.  Bonds that break
        together: lowest fibre, then interface, then angle.  Collective.
        """
        n = len(factors)
        smallest = factors.min(axis=1, initial=np.inf)
        self._comm.Allreduce(MPI.IN_PLACE, smallest, MPI.MIN)
        best = np.full((n, 4 + len(self._break_names)), np.inf)
        best[:, 0] = smallest
        together = factors[:, self._order] <= smallest[:, None] * (1.0 + path_points.UTILISATION_TIE)
        rays = np.flatnonzero(together.any(axis=1) & np.isfinite(smallest))
        node: Int = self._order[together[rays].argmax(axis=1)] if len(rays) else np.zeros(0, np.int64)
        best[rays, 1:4] = np.column_stack([self._fibre[node], self._pair[node], self._direction[node]])
        traction = before[node] + smallest[rays, None] * directions[rays, node]
        best[rays, 4:] = self._law.at(node).breaks(traction)
        table = np.stack(self._comm.allgather(best))
        first = np.lexsort((np.round(table[:, :, 3], DIRECTION_DIGITS), table[:, :, 2], table[:, :, 1]), axis=0)[0]
        bonds: list[list[float]] = table[first, np.arange(n)].tolist()
        return bonds
