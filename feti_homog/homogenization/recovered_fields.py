"""The response fields, and the largest stresses in each phase.

Fields are nodal displacements, element means of strains and stresses, tractions and jumps.  The largest stresses are
those at the integration points: one point in a linear element, six points in a quadratic element.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.fem import Problem, assembly, stress_recovery
from feti_homog.homogenization import phase_laws
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


def recover(cell: TornCell, response: Response | None, problem: Problem | None = None) -> RecoveredFields:
    """Recover the fields of a response; without one, zero fields in `problem`, by default the cell's.  Collective."""
    nodes, problem = cell.jumps.nodes, problem or cell.solver.problem
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


Largest = tuple[Float, Float]
"""The largest value (v,) of each measure, of the utilisation in each mode, and its position (v, 2)."""


def largest_stresses(cell: TornCell, states: Sequence[Sequence[Response | None]]) -> list[dict[str, Largest]]:
    """Find the largest stresses of each phase in each state, in one pass.  Collective.

    The principal stress is the largest one, signed; the hydrostatic stress is a third of the trace.  Phases whose
    constants do not determine S33 have no entry.

    Args:
        states: responses of each problem in each state; a problem without a response has zero stresses.
    """
    by_problem = zip(cell.problems, zip(*states, strict=True), strict=False)
    fields = [_stresses(problem, responses) for problem, responses in by_problem if any(responses)]
    by_phase: list[dict[str, list[Largest]]] = [{phase: [] for phase in cell.summary.phases} for _ in states]
    # Ranks without parts, too, begin with all problems, whose parts are collective: so strict.
    for (phase, points, stress), *further in zip(*fields, strict=True):
        for *_, more in further:
            stress += more
        if not np.isnan(stress).any():
            places = in_cell(points, cell.summary.shift)[:, None]
            for largest, tensors in zip(by_phase, stress, strict=True):
                largest[phase].append(_largest(_measures(cell.case.material_of(phase), tensors.T), places))
    by_state = zip(*cell.comm.allgather([*map(_joined, by_phase)]), strict=True)
    gathered = ({name: [rank[name] for rank in state if name in rank] for name in by_phase[0]} for state in by_state)
    return [*map(_joined, gathered)]


def singularities(cell: TornCell, states: Sequence[Response | None]) -> set[str]:
    """Name the places at which stresses of plane states grow without limit on finer meshes."""
    corners = np.isnan(cell.summary.frames[cell.summary.fibre_bodies]).any()
    rigid = any(bond.normal_stiffness is None for bond in cell.case.interfaces)
    tips = rigid and any(plane is not None and plane.debonded > 0 < plane.counts["bonded"] for plane in states)
    return {name for name, exists in (("corners of fibres", corners), ("tips of debonding", tips)) if exists}


def _stresses(cell: TornCell, responses: Sequence[Response | None]) -> Iterator[tuple[str, Float, Float]]:
    """Yield phase, points (n, 2) and stresses (s, 6, n) of each chunk of elements."""
    at = [number for number, response in enumerate(responses) if response is not None]
    u, all_loads = (np.stack([getattr(responses[k], name) for k in at], axis=1) for name in ("u", "all_loads"))
    loads = all_loads[: len(cell.solver.problem.loads)]
    for part, displacement in cell.displacements(u, all_loads):
        L, problem, m = part.L, part.problem, part.problem.strains
        # The stresses in space follow from those conjugate to displacement strains.
        rows, constants = np.zeros((6, m)), np.zeros((6, len(at)))
        rows[voigt.IN_PLANE if problem.turns else phase_laws.AXIAL_SHEAR] = np.eye(m)
        if len(loads) > m:  # S33 is conjugate to the load E33
            rows[2] = np.linalg.solve(L[:m, :m], L[:m, m])
            constants[2] = (L[m, m:] - rows[2] @ L[:m, m:]) @ loads[m:]
        elif problem.turns:
            rows[2] = laws.out_of_plane(cell.case.material_of(part.submesh.phase), cell.case.analysis.plane)[0]
        noise = ROUNDING * (np.abs(L) @ np.abs(loads))[: problem.stresses].max(axis=0)[:, None, None]
        u_of_part = displacement.reshape(-1, problem.components, len(at))
        recovery = stress_recovery.RecoveredStress.on(part.mesh, L, problem, u_of_part, loads, part.is_mixed)
        for chunk in recovery.elements:
            stress = rows @ chunk.stress.reshape(-1, m, len(at)).transpose(2, 1, 0) + constants.T[:, :, None]
            everywhere = np.zeros((len(responses), *stress.shape[1:]))  # also in states without a response
            everywhere[at] = np.where(np.abs(stress) < noise, 0.0, stress)
            yield part.submesh.phase, chunk.points.reshape(-1, 2), everywhere


def _measures(material: material_forms.Material, stress: Float) -> Float:
    """Return the `MEASURES` (n, v) of stresses (n, 6), with lower bounds for small principal stresses."""
    in_plane, S33, shears = stress[:, voigt.IN_PLANE], stress[:, 2], stress[:, [3, 4]]
    von_mises, hydrostatic = voigt.spatial_von_mises(in_plane, S33, shears), stress[:, :3].mean(axis=1)
    if not shears.any():
        principal = voigt.principal(in_plane, S33)[:, 0]
    elif not (in_plane.any() or S33.any()):
        principal = von_mises / np.sqrt(3)
    else:
        # The largest eigenvalue of the deviator is between vm / 3 and 2 vm / 3.
        principal = hydrostatic + von_mises / 3
        near = hydrostatic + 2 / 3 * von_mises >= principal.max()
        principal[near] = voigt.spatial_principal(in_plane[near], S33[near], shears[near])[:, 0]
    values = [principal, von_mises, hydrostatic]
    if material.strength is not None:
        values += [*strength.utilisation(material.strength, stress, principal, von_mises).T]
    return np.asarray(np.stack(values, axis=1))


def _largest(values: Float, points: Float) -> Largest:
    """Find the largest of the values (n, v) at points (n, v or 1, 2); ties take the first by x, then y."""
    peak, positions = values.max(axis=0), np.zeros((values.shape[1], 2))
    for number, (column, top) in enumerate(zip(values.T, peak, strict=True)):
        tied = points[column >= top - TIE * abs(top), number % points.shape[1]]
        size = np.abs(tied).max() or 1.0
        positions[number] = tied[np.lexsort(np.round(tied / size, 6).T[::-1])[0]]
    return peak, positions


def _joined(parts: Mapping[str, Sequence[Largest]]) -> dict[str, Largest]:
    """Find the largest values of the parts of each phase; a phase without parts has no entry."""
    return {phase: _largest(*map(np.stack, zip(*largest, strict=True))) for phase, largest in parts.items() if largest}
