"""`analysis.type = "envelope"`: debonding onset in a plane of macroscopic stresses or strains.

The cell is linear, so the tractions under any load are superposed from unit loads: a direction costs no solve.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from feti_homog.analysis.constants import constants, mesh_error
from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.result_records import EnvelopePoint
from feti_homog.analysis.tip_records import DIRECTION_DIGITS, bond_directions, criterion_of
from feti_homog.case import load_sections
from feti_homog.errors import CaseError
from feti_homog.homogenization import averaging
from feti_homog.interface.contact import BondState
from feti_homog.interface.laws import UTILISATION_TIE
from feti_homog.interface.path import onsets
from feti_homog.materials import voigt
from feti_homog.typing import Float, Int

# Largest number of bonds times directions in one evaluation, to bound memory.
CHUNK = 200_000


@dataclass(frozen=True)
class Rays:
    """The macroscopic states on n rays, start + f direction with a load factor f >= 0, in m = 3 or 6 components.

    Attributes:
        strain, stress: (n, m) directions.
        strain_before, stress_before: (m,) common start, after the temperature change.
        temperature: temperature change.
    """

    strain: Float
    stress: Float
    strain_before: Float
    stress_before: Float
    temperature: float


def run(context: AnalysisContext) -> dict[str, Any]:
    """Compute the `Result` entries `envelope`, `effective_stiffness` and its constants.  Collective.

    `envelope` lists directions with the load at which the first bond breaks; unit loads give all other entries.  Raises
    CaseError if debonded faces of the mesh may touch, or if the bond law needs another solver (`criterion_of`).
    """
    section, bonds = context.case.section, context.bonds(None)
    assert isinstance(section, load_sections.Envelope)
    if not context.plane.interface.is_linear(bonds.status):
        reason = '[analysis] type = "envelope" superposes loads, which contact forbids'
        cure = 'type = "path" finds the onset of one load'
        raise CaseError(f"[interface] contact: expected false with a debonded curve of the mesh; {reason}: {cure}")
    columns, errors, responses = context.unit_states(bonds, context.loads.zero_multipliers())
    stiffness = columns.pop("stiffness")
    context.checks.require("L^ef", {"symmetry": averaging.asymmetry(stiffness)})
    angles = 360.0 * np.arange(section.directions) / section.directions
    rays = rays_of(section.plane, angles, stiffness, columns.get("thermal_stress"), section.temperature or 0.0)
    pairs = zip(angles, _Finder(context, responses, bonds).points(rays), strict=True)
    points = tuple(EnvelopePoint(angle=float(angle), **point) for angle, point in pairs)
    if points[0].factor == 0.0:
        fault = "it breaks bonds alone, so that all loads at onset are 0; expected a smaller one"
        context.notes.append(f"[envelope] temperature = {section.temperature:g}: {fault}")
    secants: dict[str, Any] = {"effective_stiffness": stiffness} | columns
    secants |= constants(context.cell, secants)
    return {"envelope": points} | secants | mesh_error(context, secants, errors, [])


def rays_of(
    plane: Sequence[str], angles: Float, stiffness: Float, thermal_stress: Float | None, temperature: float
) -> Rays:
    """Construct the rays in a plane of two stresses or two strains, named by `plane`.

    `angles` (n,) are in degrees from the first axis.  Stress rays S begin at zero stress, with strains C^-1 S for the
    stiffness C; strain rays begin at zero strain; both after the temperature change, if `thermal_stress` exists.
    """
    strains, stresses = voigt.voigt_names(len(stiffness))
    by_stress = plane[0] in stresses
    names = stresses if by_stress else strains
    unit = np.stack([np.cos(np.radians(angles)), np.sin(np.radians(angles))], axis=1)
    loads, zero = np.zeros((len(angles), len(names))), np.zeros(len(names))
    loads[:, [names.index(name) for name in plane]] = np.where(np.abs(unit) < np.finfo(float).eps, 0.0, unit)
    heat_stress = zero if thermal_stress is None else temperature * thermal_stress
    if by_stress:
        strain = np.asarray(np.linalg.solve(stiffness, loads.T), float).T
        heat_strain = np.asarray(np.linalg.solve(stiffness, -heat_stress), float)
        return Rays(strain, loads, heat_strain, zero, temperature)
    return Rays(loads, loads @ stiffness.T, zero, heat_stress, temperature)


class _Finder:
    """A search for the first bond that breaks on each ray."""

    def __init__(self, context: AnalysisContext, responses: Sequence[averaging.Response], bonds: BondState) -> None:
        """Collect the tractions on this rank's bonds under the unit loads.  Collective; raises like `criterion_of`."""
        cell, law = context.cell, criterion_of(context.cell)
        self._comm, self._loads, self._law = cell.comm, context.loads.names, law
        self._onset = onsets.Onset.of(law, context.loads.interfaces, bonds)
        self._problems, self._noise = context.loads.interfaces.problems, context.plane.interface.scales.sign_noise
        # (l, k, c) tractions at this rank's nodes by unit load: normal, tangential, and axial in space.
        components = [problem.cell.solver.problem.components for problem in context.loads.problems]
        tractions, column, groups = list[Float](), 0, context.loads.by_problem(responses)
        for problem, c, group in zip(context.loads.problems, components, groups, strict=True):
            padding = [(0, 0), (column, sum(components) - column - c)]
            tractions += [np.pad(problem.interface.traction(r.state.solution), padding) for r in group]
            column += c
        self._unit = np.stack(tractions)
        # The numbers with which the law describes a break; their count follows from the traction components.
        self._break_names = tuple(law.break_names)[: self._unit.shape[2]]
        self._chunk = max(1, CHUNK // max(1, self._comm.allreduce(self._unit.shape[1], MPI.MAX)))
        nodes = cell.solver.jump_operator.nodes
        self._direction, self._fibre = bond_directions(cell), cell.summary.numbers[nodes.fibre]
        self._pair, self._interfaces = nodes.pair, len(context.case.interfaces)
        self._order = np.lexsort((np.round(self._direction, DIRECTION_DIGITS), self._pair, self._fibre))

    def points(self, rays: Rays) -> Iterator[dict[str, Any]]:
        """Yield a dict for each ray: `EnvelopePoint` without its angle, {} if no bond breaks.  Collective."""
        names = voigt.voigt_names(rays.strain.shape[1])[0]
        start = np.tensordot(self._unit_loads(rays.strain_before[None], rays.temperature, names), self._unit, axes=1)[0]
        used = self._onset.utilisation(start, np.arange(len(start)))
        largest = float(self._comm.allreduce(used.max(initial=0.0), MPI.MAX))
        for first in range(0, len(rays.strain), self._chunk):
            loads = self._unit_loads(rays.strain[first : first + self._chunk], 0.0, names)
            directions = np.asarray(np.tensordot(loads, self._unit, axes=1), float)
            if largest < 1.0:
                # (n, k) utilisations by the bond stresses of the bonded cell, which scale the solver's noise.
                total, column = np.zeros((len(loads), len(self._fibre))), 0
                for problem, components in zip(self._problems, ((0, 1), (2,)), strict=False):
                    end = column + len(problem.solver.problem.loads)
                    unit = np.zeros((len(self._fibre), self._unit.shape[2]))
                    unit[:, components] = 1.0
                    total += problem.scales.bond_stress(loads[:, column:end].T).T * self._law.share(unit)
                    column = end
                factors = self._onset.factors(directions, self._noise * total, start if rays.temperature else None)
            else:
                breaks = used >= largest * (1.0 - UTILISATION_TIE)
                factors = np.tile(np.where(breaks, 0.0, np.inf), (len(directions), 1))
            for ray, (factor, fibre, pair, angle, *shares) in enumerate(self._first(factors, start, directions), first):
                if np.isinf(factor):
                    yield {}
                    continue
                point = {
                    "factor": factor,
                    "strain": rays.strain_before + factor * rays.strain[ray],
                    "stress": rays.stress_before + factor * rays.stress[ray],
                    "fibre": int(fibre),
                    "bond_angle": angle,
                }
                section = {"interface": int(pair) + 1} if self._interfaces > 1 else {}
                yield point | section | dict(zip(self._break_names, shares, strict=True))

    def _unit_loads(self, strain: Float, temperature: float, names: Sequence[str]) -> Float:
        """Return the coefficients (n, l) of the l unit loads that combine to strains (n, m) and a temperature."""
        column = {name: strain[:, number] for number, name in enumerate(names)}
        column["temperature"] = np.full(len(strain), temperature)
        return np.stack([column[load] for load in self._loads], axis=1)

    def _first(self, factors: Float, before: Float, directions: Float) -> list[list[float]]:
        """Find the first break on each of n rays.  Collective.

        Returns a row for each ray: the least factor, inf without a break; fibre, interface and direction of the bond;
        the mode by `BondLaw.breaks`.  Ties: lowest fibre, then interface, then direction.

        Args:
            factors: (n, k) factors at which each bond breaks.
            before: (k, c) tractions at the starts of the rays.
            directions: (n, k, c) changes of traction per unit of the factor.
        """
        n = len(factors)
        smallest = factors.min(axis=1, initial=np.inf)
        self._comm.Allreduce(MPI.IN_PLACE, smallest, MPI.MIN)
        best = np.full((n, 4 + len(self._break_names)), np.inf)
        best[:, 0] = smallest
        together = factors[:, self._order] <= smallest[:, None] * (1.0 + UTILISATION_TIE)
        breaking = np.flatnonzero(together.any(axis=1) & np.isfinite(smallest))
        node: Int = self._order[together[breaking].argmax(axis=1)] if len(breaking) else np.zeros(0, np.int64)
        best[breaking, 1:4] = np.column_stack([self._fibre[node], self._pair[node], self._direction[node]])
        traction = before[node] + smallest[breaking, None] * directions[breaking, node]
        best[breaking, 4:] = self._law.at(node).breaks(traction)
        table = np.stack(self._comm.allgather(best))
        fibre, pair, direction = np.moveaxis(table[:, :, 1:4], 2, 0)
        first_rank = np.lexsort((np.round(direction, DIRECTION_DIGITS), pair, fibre), axis=0)[0]
        bonds: list[list[float]] = table[first_rank, np.arange(n)].tolist()
        return bonds
