"""The fields of a response: nodal displacements, element strains and stresses, tractions and jumps."""

from dataclasses import dataclass

import numpy as np

from feti_homog.fem import assembly
from feti_homog.homogenization.averaging import Response
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.materials import laws
from feti_homog.typing import Float


@dataclass(frozen=True)
class RecoveredFields:
    """The fields of a response on this rank, with c displacements and v loads.

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
    """Recover the fields of a response; all fields are zero without a response.  Collective."""
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
