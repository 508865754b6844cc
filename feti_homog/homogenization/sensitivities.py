"""Derivatives of a stiffness by the constants of phases and of elastic interfaces, without further solves.

With e_i the strains of the unit load i, its other uniform loads behind, the stiffness of a linear cell is

    |UC| C_ij = sum_phases A : int e_i (x) e_j + sum_rows [u]_i k [u]_j,

and since its fields make it stationary, dC_ij is the same with dA and dk: exact for the discrete cell.  Bodies need
the integrals alone, once per phase.  With faces in contact the cell is linear as long as none opens or closes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.case.case import Case
from feti_homog.case.material_sections import provider
from feti_homog.fem import bubble
from feti_homog.fem.assembly import ELEMENTS_AT_ONCE
from feti_homog.fem.problem import Problem
from feti_homog.fem.shape_functions import gradients
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.homogenization import phase_laws, shape_derivative
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.materials.derivatives import law_changes
from feti_homog.parallel.distributed_arrays import allreduce_sum
from feti_homog.typing import Float

GROWTH = 1e-5  # of radii


@dataclass(frozen=True)
class Derivative:
    """Derivatives of the stresses under unit loads by one constant.

    Attributes:
        name: the key with its section, such as `material.fibre.young`.
        value: the constant.
        energies: of each problem (v, v), as its stresses under its unit loads.
    """

    name: str
    value: float
    energies: tuple[Float, ...]


def derivatives(cells: Sequence[TornCell], responses: Sequence[Sequence[Response]]) -> list[Derivative]:
    """Return the derivatives by all constants, from the responses of each problem to its unit loads.  Collective."""
    case, area = cells[0].case, cells[0].summary.area
    grams = [_grams(cell, own) for cell, own in zip(cells, responses, strict=True)]
    springs = [_stretched_springs(cell, own) for cell, own in zip(cells, responses, strict=True)]
    found = list[Derivative]()
    for phase in grams[0]:
        for change in law_changes(case.materials[phase], case.analysis.plane):
            if change.name.startswith("expansion") and "temperature" not in cells[0].solver.problem.loads:
                continue
            laws = phase_laws.law_derivatives(case, phase, change)
            pairs = zip(laws, (own[phase] for own in grams), strict=True)
            energies = tuple(np.einsum("ab,aibj->ij", dA, gram) / area for dA, gram in pairs)
            found.append(Derivative(f"material.{phase}.{change.name}", change.value, energies))
    for name, value, places in _spring_constants(case):
        energies = tuple(
            sum((own[place] for place in here), np.zeros(own.shape[2:])) / (value * area)
            for own, here in zip(springs, places, strict=False)
        )
        found.append(Derivative(name, value, energies))
    return [*found, *_by_fraction(cells, responses)]


def _by_fraction(cells: Sequence[TornCell], responses: Sequence[Sequence[Response]]) -> Iterator[Derivative]:
    """Yield the derivative by the fraction of a pattern of equal fibres, whose nodes move.  Collective."""
    laws: tuple[Callable[[Case, str], Float], ...] = (phase_laws.plane_law, phase_laws.axial_law)
    for f in shape_derivative.fractions(cells[0].case):
        triples = zip(cells, responses, laws, strict=False)
        changes = [_change(cell, own, law) / (2 * f * cell.summary.area) for cell, own, law in triples]
        yield Derivative("cell.fibre_fraction", f, tuple(changes))


def _change(cell: TornCell, responses: Sequence[Response], law: Callable[[Case, str], Float]) -> Float:
    """(k, k) derivative of the energies of unit loads by ln R of all fibres.  Collective."""
    above, below = (_grams(cell, responses, growth) for growth in (GROWTH, -GROWTH))
    parts = [np.einsum("ab,aibj->ij", law(cell.case, phase), above[phase] - below[phase]) for phase in above]
    return np.asarray(np.sum(parts, axis=0) / (2 * GROWTH))


def _grams(cell: TornCell, responses: Sequence[Response], growth: float = 0.0) -> dict[str, Float]:
    """(v, k, v, k) int e_i (x) e_j over the bodies of each material under k unit loads, where fibres grow.

    Collective.
    """
    problem, loads = cell.solver.problem, np.stack([response.strain for response in responses], axis=1)
    u = np.stack([r.scale * cell.solver.displacement(r.state.solution) for r in responses], axis=1)
    m, (v, k) = problem.strains, loads.shape
    # Of [strains of displacements, 1], whose products are summed, to [those strains, the other loads].
    whole = np.zeros((m * k + 1, v * k))
    whole[: m * k, : m * k], whole[-1, m * k :] = np.eye(m * k), loads[m:].ravel()
    materials = dict.fromkeys(provider(phase, cell.case.materials) for phase in cell.summary.phases)
    sums = {material: np.zeros((m * k + 1,) * 2) for material in materials}
    for s, offset in zip(cell.subdomains, cell.offsets, strict=False):
        own = u[offset : offset + s.n_dofs].reshape(-1, problem.components, k)
        points = s.mesh.points
        points = points + growth * shape_derivative.velocity(points, cell.summary) if growth else points
        sums[provider(s.submesh.phase, cell.case.materials)] += _products(s, points, own, loads[:m])
    return {name: (whole.T @ allreduce_sum(cell.comm, own) @ whole).reshape(v, k, v, k) for name, own in sums.items()}


def _products(subdomain: Subdomain, places: Float, u: Float, loads: Float) -> Float:
    """(mk + 1, mk + 1) int f f^T, f the strains of displacements u (n, c, k) at places (n, 2), and the loads (m, k).

    In mixed elements the energy is stationary for the bubble too, and the pressure lambda Pi div u: the products of 11
    and 22 are such that an isotropic dA has d lambda (Pi div u)^2.
    """
    problem, mesh = subdomain.problem, subdomain.mesh
    m, k = loads.shape
    found = np.zeros((m * k + 1,) * 2)
    for first in range(0, len(mesh.triangles), ELEMENTS_AT_ONCE):
        nodes = mesh.triangles[first : first + ELEMENTS_AT_ONCE]
        points, own = places[nodes], u[mesh.node_class[nodes]]
        if subdomain.is_mixed:
            elements = bubble.Elements.of(points, subdomain.L)
            own, w = elements.with_bubble(own), elements.weights
            strain = elements.strain(own) + loads
            dilatations = strain[:, :, 0] + strain[:, :, 1], elements.dilatation(own) + loads[0] + loads[1]
            change = sum(sign * _gram(of, w) for sign, of in zip((-0.5, 0.5), dilatations, strict=True))
            found[:k, k : 2 * k] += change
            found[k : 2 * k, :k] += change
        else:
            g, w = gradients(points)
            strain = _strains(g, own, problem) + loads
        ones = np.ones((*w.shape, 1))
        found += _gram(np.concatenate([strain.reshape(*w.shape, -1), ones], axis=2), w)
    return found


def _strains(g: Float, u: Float, problem: Problem) -> Float:
    """(e, q, m, k) strains of displacements u (e, a, c, k) by the gradients g (e, q, a, 2)."""
    e, q, a, _ = g.shape
    slopes = g.transpose(0, 1, 3, 2).reshape(e, 2 * q, a) @ u.reshape(e, a, -1)
    slopes = slopes.reshape(e, q, 2, *u.shape[2:])
    strain = np.zeros((e, q, problem.strains, u.shape[3]))
    for (i, d), number in np.ndenumerate(problem.voigt):
        strain[:, :, number] += slopes[:, :, d, i]
    return strain


def _gram(fields: Float, weights: Float) -> Float:
    """(n, n) int f f^T of fields (e, q, ...) of n numbers."""
    flat = fields.reshape(weights.size, -1)
    return np.asarray(flat.T @ (weights.reshape(-1, 1) * flat))


def _stretched_springs(cell: TornCell, responses: Sequence[Response]) -> Float:
    """(sections, components, k, k) sums of [u]_i k [u]_j = lam_i C lam_j over the rows of bonds.  Collective."""
    nodes, c, k = cell.solver.jump_operator.nodes, cell.solver.problem.components, len(responses)
    found = np.zeros((len(cell.case.interfaces), c, k, k))
    lam = np.stack([response.scale * response.state.solution.lam for response in responses], axis=1)
    for section, component in np.ndindex(found.shape[:2]):
        rows = nodes.row[nodes.pair == section] + component
        C = responses[0].state.solution.compliance[rows]
        found[section, component] = lam[rows].T @ (C[:, None] * lam[rows])
    return np.asarray(allreduce_sum(cell.comm, found))


def _spring_constants(case: Case) -> Iterator[tuple[str, float, tuple[list[tuple[int, int]], list[tuple[int, int]]]]]:
    """Yield each finite stiffness of an interface, and of which sections and components it is in each problem."""
    several = len(case.interfaces) > 1
    for number, bond in enumerate(case.interfaces):
        section = f"interface.{number + 1}" if several else "interface"
        along = [(number, 0)]
        around = along if bond.axial_stiffness is None else []
        places = {
            "normal_stiffness": ([(number, 0)], []),
            "tangential_stiffness": ([(number, 1)], around),
            "axial_stiffness": ([], along),
        }
        for name, own in places.items():
            value = getattr(bond, name)
            if value is not None and np.isfinite(value):
                yield f"{section}.{name}", value, own
