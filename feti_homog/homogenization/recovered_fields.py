"""The response fields, and the largest stresses in each phase.

Fields are nodal displacements, element means of strains and stresses, tractions and jumps.  The largest stresses are
those at the integration points: one point in a linear element, six points in a quadratic element.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from feti_homog.fem import assembly, stress_recovery
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.domain_partition import in_cell
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.materials import laws, material_forms, strength, voigt
from feti_homog.typing import Float

MEASURES = ("principal", "von_mises", "hydrostatic", "utilisation")
# Relative difference below which values are equal except for rounding, as at symmetric positions.
TIE = 1e-6
# Fraction of the stresses L |E| of a part below which its stresses are rounding errors, as in a free body.
ROUNDING = 1e4 * np.finfo(float).eps


@dataclass(frozen=True)
class RecoveredFields:
    """The response fields on this rank, with c displacements and v loads.

    Attributes:
        displacement, fluctuation: (n, c) total H y + u*, Eq. (14), and u* at the plane nodes of the parts.
        strain, stress: (m, v) means over each element of the local loads and of the conjugate stresses.
        traction, jump: (k, c) at interface nodes.
        shares: (m,) contribution of each element to the estimated error of E . Sigma; NaN without an estimate.
    """

    displacement: Float
    fluctuation: Float
    strain: Float
    stress: Float
    traction: Float
    jump: Float
    shares: Float


def recover(cell: TornCell, response: Response | None) -> RecoveredFields:
    """Recover the response fields; all fields are zero without a response.  Collective."""
    nodes, problem = cell.jumps.nodes, cell.solver.problem
    m, (c, v) = problem.strains, (problem.components, len(problem.loads))
    if response is None:
        n, e = sum(len(s.mesh.points) for s in cell.parts), sum(len(s.mesh.triangles) for s in cell.parts)
        points, elements, pairs = np.zeros((n, c)), np.zeros((e, v)), np.zeros((len(nodes.row), c))
        return RecoveredFields(points, points, elements, elements, pairs, pairs, np.zeros(e))
    solution, loads, shares = response.state.solution, response.strain, response.shares
    u = cell.displacement(solution)
    lam, opening = (response.scale * rows for rows in cell.across_bonds(solution, u))
    pair, u, H = nodes.row[:, None] + np.arange(c), response.scale * u, problem.gradient(loads[:m])
    totals, fluctuations = [np.zeros((0, c))], [np.zeros((0, c))]
    strains, stresses = [np.zeros((0, v))], [np.zeros((0, v))]
    for s, offset in zip(cell.parts, cell.offsets, strict=False):
        of_part = u[offset : offset + len(s.dofs)].reshape(-1, c)
        fluctuations.append(of_part[s.mesh.node_class])
        totals.append(s.mesh.points @ H.T + fluctuations[-1])
        plane = assembly.element_strain(s.mesh.points, s.mesh.triangles, s.mesh.node_class, of_part, problem)[0]
        strains.append(np.column_stack([loads[:m] + plane, np.tile(loads[m:], (len(plane), 1))]))
        stresses.append(strains[-1] @ s.L)
    total, fluctuation, strain, stress = (np.concatenate(rows) for rows in (totals, fluctuations, strains, stresses))
    if shares is None and cell.case.output.mesh_error:
        from feti_homog.homogenization.mesh_estimate import energy_errors  # cases may forgo it

        shares = energy_errors(cell, [response]).shares[:, 0]
    shares = np.full(len(strain), np.nan) if shares is None else shares
    traction = lam[pair] / nodes.length[:, None]
    return RecoveredFields(total, fluctuation, strain, stress, traction, opening[pair], shares)


def out_of_plane_stress(cell: TornCell, stress: Float) -> Float:
    """Return the stresses S33 (m,) from the stresses (m, 3) in the plane."""
    plane = cell.case.analysis.plane
    rules = [laws.out_of_plane(cell.case.material_of(s.submesh.phase), plane)[0] for s in cell.parts]
    sizes = [len(s.mesh.triangles) for s in cell.parts]
    return np.asarray(np.einsum("ev,ev->e", stress, np.repeat(np.reshape(rules, (-1, 3)), sizes, axis=0)))


class Largest(NamedTuple):
    """The largest value (4,) of each measure, -inf without values, and its position (4, 2)."""

    value: Float
    position: Float


def largest_stresses(cell: TornCell, plane: Response | None, axial: Response | None) -> dict[str, Largest]:
    """Find the largest stresses of each phase in a state.  Collective.

    The principal stress is the largest with its sign, the hydrostatic stress a third of the trace.  Phases whose
    constants leave S33 open have no entry.

    Args:
        plane, axial: responses of both problems; a problem without a response has zero stresses.
    """
    in_plane = None if plane is None else _stresses(cell, plane)
    along = None if axial is None or cell.axial is None else _stresses(cell.axial, axial)
    parts_of_problems = [problem.parts for problem in cell.problems]  # on all ranks, also on ranks without parts
    by_phase: dict[str, list[Largest]] = {phase: [] for phase in cell.summary.phases}
    for part in parts_of_problems[0]:
        fields = [None if stresses is None else next(stresses) for stresses in (in_plane, along)]
        points = next(field[0] for field in fields if field is not None)
        material, stress = cell.case.material_of(part.submesh.phase), np.zeros((len(points), 6))
        if fields[0] is not None:
            plane_stress = fields[0][1]
            stress[:, voigt.IN_PLANE] = plane_stress[:, :3]
            rule = laws.out_of_plane(material, cell.case.analysis.plane)[0] if cell.axial is None else None
            stress[:, 2] = plane_stress[:, 3] if rule is None else plane_stress[:, :3] @ rule
        if fields[1] is not None:
            stress[:, [4, 3]] = fields[1][1]
        if not np.isnan(stress).any():
            values, inside = _measures(material, stress), in_cell(points, cell.summary.period)
            by_phase[part.submesh.phase].append(_largest(values, np.repeat(inside[:, None], len(MEASURES), axis=1)))
    of_ranks = cell.comm.allgather({phase: _joined(parts) for phase, parts in by_phase.items() if parts})
    gathered = {phase: [parts[phase] for parts in of_ranks if phase in parts] for phase in by_phase}
    return {phase: _joined(parts) for phase, parts in gathered.items() if parts}


def singularities(cell: TornCell, plane: Response | None) -> set[str]:
    """Name the places at which stresses grow without limit on finer meshes."""
    corners = np.isnan(cell.summary.frames[cell.summary.fibre_bodies]).any()
    rigid = any(bond.normal_stiffness is None for bond in cell.case.interfaces)
    tips = plane is not None and rigid and plane.debonded > 0 < plane.counts["bonded"]
    return {name for name, exists in (("corners of fibres", corners), ("tips of debonding", tips)) if exists}


def _stresses(cell: TornCell, response: Response) -> Iterator[tuple[Float, Float]]:
    """Yield the points (n, 2) and the stresses (n, v), conjugate to the loads, of each part."""
    loads = response.strain[:, None]
    for part, u in cell.displacements(response.u[:, None], loads):
        displacement = u.reshape(-1, part.problem.components, 1)
        elements = stress_recovery.RecoveredStress.on(
            part.mesh, part.L, part.problem, displacement, loads, part.is_mixed
        ).elements
        m, L = part.problem.strains, part.L
        points = np.concatenate([chunk.points.reshape(-1, 2) for chunk in elements])
        stress = np.concatenate([chunk.stress.reshape(-1, m) for chunk in elements])
        # Stresses conjugate to the other loads, such as S33 to E33, follow from the strains of the first loads.
        strain = np.linalg.solve(L[:m, :m], (stress - L[:m, m:] @ response.strain[m:]).T).T
        stress = np.hstack([stress, strain @ L[:m, m:] + L[m:, m:] @ response.strain[m:]])
        size = (np.abs(L) @ np.abs(response.strain))[: part.problem.stresses].max()
        yield points, np.where(np.abs(stress) < ROUNDING * size, 0.0, stress)


def _measures(material: material_forms.Material, stress: Float) -> Float:
    """Return the `MEASURES` (n, 4) of stresses (n, 6), with lower bounds for small principal stresses."""
    in_plane, S33, shears = stress[:, voigt.IN_PLANE], stress[:, 2], stress[:, [3, 4]]
    von_mises, hydrostatic = voigt.spatial_von_mises(in_plane, S33, shears), stress[:, :3].mean(axis=1)
    # The largest eigenvalue of the deviator is between vm / 3 and 2 vm / 3.
    principal = hydrostatic + von_mises / 3
    near = hydrostatic + 2 / 3 * von_mises >= principal.max()
    if shears.any():
        principal[near] = voigt.spatial_principal(in_plane[near], S33[near], shears[near])[:, 0]
    else:
        principal = voigt.principal(in_plane, S33)[:, 0]
    used = np.full(len(stress), -np.inf)
    if material.strength is not None:
        used = strength.utilisation(material.strength, stress, principal, von_mises)
    return np.stack([principal, von_mises, hydrostatic, used], axis=1)


def _largest(values: Float, points: Float) -> Largest:
    """Find the largest of the values (n, 4) at points (n, 4, 2); ties take the first by x, then y."""
    peak, positions = values.max(axis=0), np.zeros((values.shape[1], 2))
    for number, (column, top) in enumerate(zip(values.T, peak, strict=True)):
        tied = points[column >= top - TIE * abs(top), number] if np.isfinite(top) else points[:1, number]
        size = np.abs(points).max()
        positions[number] = tied[np.lexsort(np.round(tied / size, 6).T[::-1])[0]]
    return Largest(peak, positions)


def _joined(parts: Sequence[Largest]) -> Largest:
    """Find the largest values of several parts."""
    return _largest(np.stack([part.value for part in parts]), np.stack([part.position for part in parts]))
