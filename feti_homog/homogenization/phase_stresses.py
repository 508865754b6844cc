"""The largest stresses of each phase, with their positions, and the utilisation of its strength.

Stresses are those at the integration points of the elements: one of linear elements, six of quadratic ones.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from feti_homog.fem import stress_recovery
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.domain_partition import in_cell
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.materials import laws, strength, voigt
from feti_homog.materials.material_forms import Material
from feti_homog.typing import Float

MEASURES = ("principal", "von_mises", "hydrostatic", "utilisation")
# Values that differ relatively by less are equal but for rounding, as of symmetric positions.
TIE = 1e-6
# Stresses of a free body, relative to the macroscopic ones, are rounding below this.
ROUNDING = 1e-9


class Largest(NamedTuple):
    """The largest value of each measure (4,), -inf without one, and its position (4, 2)."""

    value: Float
    position: Float


def largest(cell: TornCell, plane: Response | None, axial: Response | None) -> dict[str, Largest]:
    """Find the largest stresses of each phase in a state.  Collective.

    The principal stress is the largest with its sign, the hydrostatic stress a third of the trace.  Phases whose
    constants leave S33 open have no entry.

    Args:
        plane, axial: responses of both problems; a problem without a response has no stresses.
    """
    in_plane = None if plane is None else _stresses(cell, plane)
    along = None if axial is None or cell.axial is None else _stresses(cell.axial, axial)
    noise = ROUNDING * max(np.abs(response.stress).max() for response in (plane, axial) if response is not None)
    by_phase: dict[str, list[Largest]] = {phase: [] for phase in cell.summary.phases}
    for part in cell.parts:
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
            stress[np.abs(stress) < noise] = 0.0
            values, inside = _measures(material, stress), in_cell(points, cell.summary.period)
            by_phase[part.submesh.phase].append(_largest(values, np.repeat(inside[:, None], len(MEASURES), axis=1)))
    of_ranks = cell.comm.allgather({phase: _joined(parts) for phase, parts in by_phase.items() if parts})
    gathered = {phase: [parts[phase] for parts in of_ranks if phase in parts] for phase in by_phase}
    return {phase: _joined(parts) for phase, parts in gathered.items() if parts}


def singularities(cell: TornCell, plane: Response | None) -> set[str]:
    """Name the places of a state beside which stresses grow without limit on finer meshes."""
    corners = np.isnan(cell.summary.frames[cell.summary.fibre_bodies]).any()
    rigid = any(bond.normal_stiffness is None for bond in cell.case.interfaces)
    tips = plane is not None and rigid and plane.debonded > 0 < plane.counts["bonded"]
    return {name for name, is_there in (("corners of fibres", corners), ("tips of debonding", tips)) if is_there}


def _stresses(cell: TornCell, response: Response) -> Iterator[tuple[Float, Float]]:
    """Yield points (n, 2) and stresses (n, v), conjugate to the loads of the problem, of each part."""
    loads = response.strain[:, None]
    for part, u in cell.displacements(response.u[:, None], loads):
        displacement = u.reshape(-1, part.problem.components, 1)
        elements = stress_recovery.RecoveredStress.on(
            part.mesh, part.L, part.problem, displacement, loads, part.is_mixed
        ).elements
        m, L = part.problem.strains, part.L
        points = np.concatenate([chunk.points.reshape(-1, 2) for chunk in elements])
        stress = np.concatenate([chunk.stress.reshape(-1, m) for chunk in elements])
        # Stresses that are conjugate to the other loads, as S33 to E33, follow from the strains of the first.
        strain = np.linalg.solve(L[:m, :m], (stress - L[:m, m:] @ response.strain[m:]).T).T
        yield points, np.hstack([stress, strain @ L[:m, m:] + L[m:, m:] @ response.strain[m:]])


def _measures(material: Material, stress: Float) -> Float:
    """Return the `MEASURES` (n, 4) of stresses (n, 6); principal stresses far from the largest are lower bounds."""
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
    """Find the largest of values (n, 4) at points (n, 4, 2); of almost equal values the first position by x, then y."""
    peak, positions = values.max(axis=0), np.zeros((values.shape[1], 2))
    for number, (column, top) in enumerate(zip(values.T, peak, strict=True)):
        tied = points[column >= top - TIE * abs(top), number] if np.isfinite(top) else points[:1, number]
        size = np.abs(points).max()
        positions[number] = tied[np.lexsort(np.round(tied / size, 6).T[::-1])[0]]
    return Largest(peak, positions)


def _joined(parts: Sequence[Largest]) -> Largest:
    """Find the largest values of several parts."""
    return _largest(np.stack([part.value for part in parts]), np.stack([part.position for part in parts]))
