"""Differentiate stiffness and conductivity with respect to constants of the case, without further solves.

Let e_i be the strains and the other uniform loads under the unit load i, and [u]_i the jumps at springs of stiffness k.
A linear cell of area |UC|, with laws A of the phases, has the stiffness C,

    |UC| C_ij = sum_phases A : int e_i (x) e_j + sum_rows [u]_i k [u]_j,

and because the fields make C_ij stationary, dC_ij has dA and dk in place of A and k, exactly for the discrete cell.
Bodies enter only by the integrals, one per phase.  A cell with contact is linear as long as no face opens or closes.

If all radii R grow, the fibre fraction f changes at the rate d f / d ln R = 2 f, and the stiffness at the rate of the
energy on a moving mesh with fixed nodal u - E x.  This is exact for the mesh, however nodes between the fibres move.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.case import Case, cell_section, material_sections
from feti_homog.fem import CONDUCTION, assembly, shape_functions
from feti_homog.homogenization import phase_laws
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.domain_partition import ROUNDING, CellSummary
from feti_homog.homogenization.recovered_fields import with_displacements
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.materials import material_derivatives
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Float

IMAGES = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class Derivative:
    """The derivatives of the stresses under unit loads with respect to one constant.

    Attributes:
        name: the key with its section, such as `material.fibre.young`.
        value: value of the constant.
        energies: for each problem, the derivatives (v, v) of the stresses under its unit loads.
    """

    name: str
    value: float
    energies: tuple[Float, ...]


def derivatives(cells: Sequence[TornCell], responses: Sequence[Sequence[Response]]) -> list[Derivative]:
    """Differentiate the stiffness by all constants, from responses to unit loads in each problem.  Collective."""
    case, area = cells[0].case, cells[0].summary.area
    integrals = [_integrals(cell, group) for cell, group in zip(cells, responses, strict=True)]
    changes, is_heated = list[Derivative](), "temperature" in cells[0].solver.problem.loads
    for phase in integrals[0][0]:
        for change in material_derivatives.law_changes(case.materials[phase], case.analysis.plane):
            if is_heated or not change.name.startswith("expansion"):
                laws = phase_laws.law_derivatives(case, phase, change.stiffness, change.expansion)
                pairs = zip(laws, integrals, strict=True)
                energies = tuple(np.einsum("ab,aibj->ij", dA, grams[phase]) / area for dA, (grams, _) in pairs)
                changes.append(Derivative(f"material.{phase}.{change.name}", change.value, energies))
    springs = list[Float]()
    for cell, group in zip(cells, responses, strict=True):
        # Sums lam_i C lam_j over bonds: (sections, components, k, k).
        nodes, k = cell.solver.jump_operator.nodes, len(group)
        work = np.zeros((len(case.interfaces), cell.solver.problem.components, k, k))
        lam = np.stack([response.scale * response.state.solution.lam for response in group], axis=1)
        for section, component in np.ndindex(work.shape[:2]):
            rows = nodes.row[nodes.pair == section] + component
            work[section, component] = lam[rows].T @ (group[0].state.solution.compliance[rows, None] * lam[rows])
        springs.append(distributed_arrays.allreduce_sum(cell.comm, work))
    for number, bond in enumerate(case.interfaces):
        label = f"interface.{number + 1}" if len(case.interfaces) > 1 else "interface"
        # The components, in each problem, of the springs that have a stiffness.
        axial = [0] if bond.axial_stiffness is None else []  # by default axial springs have the tangential stiffness
        places = {"normal_stiffness": [[0], []], "tangential_stiffness": [[1], axial], "axial_stiffness": [[], [0]]}
        if cells[0].solver.problem == CONDUCTION:
            places = {"conductance": [[0]]}
        for key, components in places.items():
            value = getattr(bond, key)
            if value is not None and np.isfinite(value):
                works = [work[number, c].sum(axis=0, initial=0.0) for work, c in zip(springs, components, strict=False)]
                changes.append(Derivative(f"{label}.{key}", value, tuple(work / (value * area) for work in works)))
    f = _growing_fraction(case)
    if f is not None:
        changes.append(Derivative("cell.fibre_fraction", f, tuple(growth / (2 * f * area) for _, growth in integrals)))
    return changes


def _integrals(cell: TornCell, responses: Sequence[Response]) -> tuple[dict[str, Float], Float]:
    """Integrate the strain products and the energy change with fibre growth.  Collective.

    Return int e_i (x) e_j (v, k, v, k) by material for k unit loads, and the derivatives (k, k) of |UC| C with respect
    to ln R of all fibres, which are 0 without a `_growing_fraction`.
    """
    problem = cell.solver.problem
    loads = np.stack([response.all_loads for response in responses], axis=1)[: len(problem.loads)]
    inside = np.stack([response.inside for response in with_displacements(cell, responses)], axis=1)
    m, (v, k) = problem.strains, loads.shape
    # T maps [strains of displacements, 1], whose products are summed, to [strains of displacements, other loads].
    T = np.zeros((m * k + 1, v * k))
    T[: m * k, : m * k] = np.eye(m * k)
    T[-1, m * k :] = loads[m:].ravel()
    materials = dict.fromkeys(material_sections.provider(phase, cell.case.materials) for phase in cell.summary.phases)
    sums = {material: np.zeros((m * k + 1,) * 2) for material in materials}
    growth = np.zeros((k, k))
    for part, displacement in cell.by_part(inside):
        mesh, u = part.mesh, displacement.reshape(-1, problem.components, k)
        V = None if _growing_fraction(cell.case) is None else _velocity(mesh.points, cell.summary)
        for first in range(0, len(mesh.triangles), assembly.ELEMENTS_AT_ONCE):
            nodes = mesh.triangles[first : first + assembly.ELEMENTS_AT_ONCE]
            of_nodes = mesh.points[nodes], u[mesh.node_class[nodes]]
            fields = shape_functions.ElementFields.of(problem, *of_nodes, part.L, loads[:m], part.is_mixed)
            sums[material_sections.provider(part.submesh.phase, cell.case.materials)] += _products(fields)
            if V is not None:
                growth += fields.change(part.L, loads[m:], V[nodes])
    grams = {
        name: (T.T @ distributed_arrays.allreduce_sum(cell.comm, gram) @ T).reshape(v, k, v, k)
        for name, gram in sums.items()
    }
    return grams, distributed_arrays.allreduce_sum(cell.comm, growth)


def _products(fields: shape_functions.ElementFields) -> Float:
    """Integrate f f^T (mk + 1, mk + 1) of f = [strains, 1], less r^2 / 2 (`ElementFields`) in products of 11 and 22."""
    *points, _, k = fields.strain.shape
    gram = _gram(np.concatenate([fields.strain.reshape(*points, -1), np.ones((*points, 1))], axis=2), fields.weights)
    if fields.rest is not None:  # isotropic dA: -d lambda r^2 in the products of 11 and 22
        change = _gram(fields.rest, fields.weights) / 2
        gram[:k, k : 2 * k] -= change
        gram[k : 2 * k, :k] -= change
    return gram


def _gram(fields: Float, weights: Float) -> Float:
    """Integrate the products f f^T (n, n) of fields f (e, q, n) with integration weights (e, q)."""
    flat = fields.reshape(weights.size, -1)
    return np.asarray(flat.T @ (weights.reshape(-1, 1) * flat))


def _growing_fraction(case: Case) -> float | None:
    """Return the fibre fraction if the cell is a lattice of equal, uncoated, bonded fibres; else None."""
    cell = case.cell
    is_bare = cell.geometry in cell_section.LATTICES and cell.coating is None and not case.interfaces
    return cell.fibre_fraction if is_bare else None


def _velocity(points: Float, cell: CellSummary) -> Float:
    """Return the velocity V = dx / d ln R (n, 2) of points (n, 2) while the radii R of all fibres grow.

    In a fibre with centre c, V is x - c; outside, V falls to 0 halfway to the next fibre.
    """
    centres, radii, period = cell.centres[cell.is_fibre], cell.radii[cell.is_fibre], cell.shift
    V = np.zeros_like(points)
    for number, (centre, radius) in enumerate(zip(centres, radii, strict=True)):
        gaps = np.linalg.norm(centres[:, None] + IMAGES * period - centre, axis=2) - radii[:, None] - radius
        gaps[number, (IMAGES == 0).all(axis=1)] = np.inf
        reach = gaps.min() / 2  # so that at most one fibre moves a node
        offset = points - centre
        offset -= period * np.round(offset / period)
        distance = np.linalg.norm(offset, axis=1, keepdims=True)
        fraction = np.clip((radius + reach - distance) / reach, 0.0, 1.0) * radius / np.maximum(distance, radius)
        V += offset * np.where(distance <= radius * (1 + ROUNDING), 1.0, fraction)
    return V
