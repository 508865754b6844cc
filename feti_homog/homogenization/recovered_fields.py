"""Recover the fields of responses, and find the largest stresses in each phase.

Fields are nodal displacements, element means of stresses, tractions and jumps.  The largest stresses are at the
integration points: one point in a linear element, six points in a quadratic element.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from feti_homog.fem import Problem, stress_recovery
from feti_homog.homogenization import phase_laws
from feti_homog.homogenization.averaging import FibreInterfaces, Response
from feti_homog.homogenization.domain_partition import in_cell
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact import Contact
from feti_homog.materials import laws, material_forms, voigt
from feti_homog.typing import Float

MEASURES = ("principal", "von_mises", "hydrostatic", "utilisation")
# Relative difference below which values are equal except for rounding, as at symmetric positions.
TIE = 1e-6
# Fraction of the stresses L |E| of a part below which its stresses are rounding errors, as in a free body.
ROUNDING = 1e4 * np.finfo(float).eps


Largest = tuple[Float, Float]
"""The largest value (v,) of each measure, with one utilisation per mode, and the position (v, 2) of each value."""


@dataclass(frozen=True)
class RecoveredFields:
    """The fields of s states on this rank, and the largest stresses on all ranks.

    Attributes:
        displacement: for each problem, u* (dofs, s) of this rank's parts; 0 in states without a response.
        stress: (s, 6, e) element means of `voigt.SPATIAL_STRESSES`; in conduction, minus the flux at 13, 23 and 33.
        largest: largest stresses in each phase, for each state.  The principal stress is the largest one, signed; the
            hydrostatic stress is a third of the trace.  Phases without a determined S33, or in conduction, are absent.
    """

    displacement: list[Float]
    stress: Float
    largest: list[dict[str, Largest]]


@dataclass(frozen=True)
class NodalFields:
    """The nodal fields of a state in the plane or the axial problem, with c displacements per node.

    `displacement` (n, c) is H y + u*, Eq. (14), at the positions y of the parts' plane nodes, with the macroscopic
    gradient H; `traction` and `jump` (k, c) are at the interface nodes.
    """

    displacement: Float
    traction: Float
    jump: Float


def with_displacements(cell: TornCell, responses: Sequence[Response]) -> list[Response]:
    """Return the responses with u* inside the subdomains, in copies unless all have it.  Collective."""
    if all(len(response.inside) == cell.offsets[-1] for response in responses):
        return list(responses)
    u = np.stack([response.u for response in responses], axis=1)
    columns = cell.extended(u, np.stack([response.all_loads for response in responses], axis=1)).T
    return [replace(response, inside=column) for response, column in zip(responses, columns, strict=True)]


def recover(cell: TornCell, states: Sequence[Sequence[Response | None]]) -> RecoveredFields:
    """Recover the fields of all states, in one pass over the parts.  Collective.

    `states` has the responses of each problem in each state; a problem without a response has zero fields.
    """
    # Conduction has its responses in the place of the axial problem.
    by_problem = [*zip((cell, cell.axial or cell), zip(*states, strict=True), strict=False)]
    u = [np.zeros((torn.offsets[-1], len(states))) for torn, _ in by_problem]
    passes = [_stresses(*pair, out) for pair, out in zip(by_problem, u, strict=True) if any(pair[1])]
    means = np.zeros((len(states), 6, sum(len(part.mesh.triangles) for part in cell.parts)))
    by_phase: list[dict[str, list[Largest]]] = [{phase: [] for phase in cell.summary.phases} for _ in states]
    first, is_scalar = 0, voigt.PLANE_STATES[cell.case.analysis.plane].is_scalar
    components = [*voigt.IN_PLANE, 2] if cell.solver.problem.turns and cell.axial is None else [*range(6)]
    # Ranks without parts must also start the generator of every problem, which is collective: hence `strict`.
    for chunks in zip(*passes, strict=True):
        phase, chunk = chunks[0][:2]
        stress, without_noise = sum(stresses for *_, stresses in chunks)
        weights = chunk.weights / chunk.weights.sum(axis=1, keepdims=True)
        last = first + len(weights)
        means[:, components, first:last] = (stress[:, components] * weights).sum(axis=-1)
        first = last
        if not is_scalar and not np.isnan(without_noise).any():
            places = in_cell(chunk.points.reshape(-1, 2), cell.summary.shift)[:, None]
            for largest, tensors in zip(by_phase, without_noise.reshape(*stress.shape[:2], -1), strict=True):
                largest[phase].append(_largest(_measures(cell.case.material_of(phase), tensors.T), places))
    by_state = zip(*cell.comm.allgather([*map(_joined, by_phase)]), strict=True)
    gathered = ({name: [rank[name] for rank in state if name in rank] for name in by_phase[0]} for state in by_state)
    return RecoveredFields(u, means, [*map(_joined, gathered)])


def nodal_fields(cell: TornCell, response: Response | None, u: Float, problem: Problem) -> NodalFields:
    """Compute the nodal fields of a response from the recovered u* (dofs,); zero without a response.  Collective."""
    nodes, c = cell.jumps.nodes, problem.components
    if response is None:
        n, k = sum(len(part.mesh.points) for part in cell.parts), len(nodes.row)
        return NodalFields(np.zeros((n, c)), np.zeros((k, c)), np.zeros((k, c)))
    lam, opening = cell.across_bonds(response.solution, u)
    H, totals = problem.gradient(response.strain[: problem.strains]), [np.zeros((0, c))]
    for part, of_part in cell.by_part(u):
        totals.append(part.mesh.points @ H.T + of_part.reshape(-1, c)[part.mesh.node_class])
    pair = nodes.row[:, None] + np.arange(c)
    return NodalFields(np.concatenate(totals), lam[pair] / nodes.length[:, None], opening[pair])


def singularities(cell: TornCell, states: Sequence[Response | None]) -> set[str]:
    """Name the places at which stresses of plane states would grow without limit on finer meshes.  Collective."""
    places = {"corners of phases"} if cell.summary.corner_edges else set[str]()
    nodes, rigid = cell.solver.jump_operator.nodes, np.array([b.normal_stiffness is None for b in cell.case.interfaces])
    masks = [s.state.status == Contact.BONDED for s in states if rigid.any() and s is not None and s.debonded]
    if masks:
        length, inner = FibreInterfaces(cell).length, cell.summary.is_fibre[nodes.fibre]
        sides = [rigid[nodes.pair] & side for side in (inner, ~inner)]  # a coated fibre may have two interfaces
        if any(np.minimum(length(bonded & side), length(~bonded & side)).any() for bonded in masks for side in sides):
            places.add("tips of debonding")
    return places


def _stresses(
    cell: TornCell, responses: Sequence[Response | None], out: Float
) -> Iterator[tuple[str, stress_recovery.ElementStresses, Float]]:
    """Yield the phase of each chunk of e elements, the chunk, and its stresses (2, s, 6, e, q).  Collective.

    Writes u* to `out` (dofs, s).  The stresses at the q points come as computed, then with 0 in place of rounding
    errors; they are 0 in states without a response.
    """
    columns = [number for number, response in enumerate(responses) if response is not None]
    present = with_displacements(cell, [response for response in responses if response is not None])
    out[:, columns] = np.stack([response.inside for response in present], axis=1)
    loads = np.stack([response.all_loads for response in present], axis=1)[: len(cell.solver.problem.loads)]
    for part, displacement in cell.by_part(out[:, columns]):
        L, problem, m = part.L, part.problem, part.problem.strains
        # The stresses in space follow from the stresses conjugate to strains of displacements.
        rows, constants = np.zeros((6, m)), np.zeros((6, len(columns)))
        rows[voigt.IN_PLANE if problem.turns else phase_laws.AXIAL_SHEAR] = np.eye(m)
        if len(loads) > m:  # S33 is conjugate to the load E33
            rows[2] = np.linalg.solve(L[:m, :m], L[:m, m])
            constants[2] = (L[m, m:] - rows[2] @ L[:m, m:]) @ loads[m:]
        elif problem.turns:
            rows[2] = laws.out_of_plane(cell.case.material_of(part.submesh.phase), cell.case.analysis.plane)[0]
        noise = ROUNDING * (np.abs(L) @ np.abs(loads))[: problem.stresses].max(axis=0)[:, None, None]
        u_of_part = displacement.reshape(-1, problem.components, len(columns))
        recovery = stress_recovery.RecoveredStress.on(part.mesh, L, problem, u_of_part, loads, part.is_mixed)
        for chunk in recovery.elements:
            stress = rows @ chunk.stress.reshape(-1, m, len(columns)).transpose(2, 1, 0) + constants.T[:, :, None]
            everywhere = np.zeros((2, len(responses), *stress.shape[1:]))  # also in states without a response
            everywhere[:, columns] = stress, np.where(np.abs(stress) < noise, 0.0, stress)
            yield part.submesh.phase, chunk, everywhere.reshape(*everywhere.shape[:3], *chunk.weights.shape)


def _measures(material: material_forms.Material, stress: Float) -> Float:
    """Compute `MEASURES` (n, 3 + strength modes) of stresses (n, 6); small principal stresses may be lower bounds."""
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
        values += [*material_forms.utilisation(material.strength, stress, principal, von_mises).T]
    return np.asarray(np.stack(values, axis=1))


def _largest(values: Float, points: Float) -> Largest:
    """Find the largest value of each column of (n, v), and its point in (n, v or 1, 2); ties: least x, then least y."""
    peak, positions = values.max(axis=0), np.zeros((values.shape[1], 2))
    for number, (column, top) in enumerate(zip(values.T, peak, strict=True)):
        tied = points[column >= top - TIE * abs(top), number % points.shape[1]]
        size = np.abs(tied).max() or 1.0
        positions[number] = tied[np.lexsort(np.round(tied / size, 6).T[::-1])[0]]
    return peak, positions


def _joined(parts: Mapping[str, Sequence[Largest]]) -> dict[str, Largest]:
    """Find the largest values over the parts of each phase; a phase without parts has no entry."""
    return {phase: _largest(*map(np.stack, zip(*largest, strict=True))) for phase, largest in parts.items() if largest}
