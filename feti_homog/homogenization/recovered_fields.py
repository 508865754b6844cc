"""Recovery of fields from a response: displacements at nodes, strains and stresses of elements, tractions and jumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.fem.assembly import element_strain
from feti_homog.homogenization.averaging import Response, displacement, fluctuation
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.materials import laws
from feti_homog.typing import Float


@dataclass(frozen=True)
class RecoveredFields:
    """This rank's fields of a response, of c displacements and v loads.

    Attributes:
        displacement, fluctuation: (n, c).
        strain, stress: (m, v) means over the elements: the loads in each, and what works on them.
        traction, jump: (k, c).
        shares: (m,) what each has of the estimated error of E . Sigma; NaN if the case asks for no estimate.
    """

    displacement: Float
    fluctuation: Float
    strain: Float
    stress: Float
    traction: Float
    jump: Float
    shares: Float


def recover(cell: TornCell, response: Response | None) -> RecoveredFields:
    """Recover the fields of a response; zero without one.  Collective."""
    nodes, problem = cell.jumps.nodes, cell.solver.problem
    if response is None:
        c, v = problem.components, len(problem.loads)
        n, m = (sum(sizes) for sizes in zip(*_sizes(cell), strict=True)) if cell.parts else (0, 0)
        points, elements, pairs = np.zeros((n, c)), np.zeros((m, v)), np.zeros((len(nodes.row), c))
        return RecoveredFields(points, points, elements, elements, pairs, pairs, np.zeros(m))
    solution = response.state.solution
    u = cell.displacement(solution)
    lam, opening = (response.scale * each for each in cell.across_bonds(solution, u))
    u *= response.scale
    pair = nodes.row[:, None] + np.arange(problem.components)
    return RecoveredFields(
        displacement(cell, response.strain, u),
        fluctuation(cell, u),
        *_element_fields(cell, response.strain, u),
        lam[pair] / nodes.length[:, None],
        opening[pair],
        _shares(cell, response),
    )


def _shares(cell: TornCell, response: Response) -> Float:
    if response.shares is not None:
        return response.shares
    if not cell.case.output.mesh_error:
        return np.full(sum(len(s.mesh.triangles) for s in cell.parts), np.nan)
    from feti_homog.homogenization.mesh_error import energy_errors  # cases may forgo it

    return energy_errors(cell, [response]).shares[:, 0]


def _sizes(cell: TornCell) -> list[tuple[int, int]]:
    """Nodes and elements of this rank's parts."""
    return [(len(s.mesh.points), len(s.mesh.triangles)) for s in cell.parts]


def _element_fields(cell: TornCell, loads: Float, u: Float) -> tuple[Float, Float]:
    """Means over the elements under the loads (v,): strains with the other loads, and what works on them, (m, v)."""
    problem = cell.solver.problem
    of_displacements, others = loads[: problem.strains], loads[problem.strains :]
    strains, stresses = ([np.zeros((0, len(loads)))] for _ in range(2))
    for s, offset in zip(cell.parts, cell.offsets, strict=False):
        own = u[offset : offset + len(s.dofs)].reshape(-1, problem.components)
        strain = of_displacements + element_strain(
            s.mesh.points, s.mesh.triangles, s.mesh.node_class, own, problem
        )[0]  # fmt: skip
        strain = np.column_stack([strain, np.tile(others, (len(strain), 1))])
        strains.append(strain)
        stresses.append(strain @ s.L)
    return np.concatenate(strains), np.concatenate(stresses)


def out_of_plane_stress(cell: TornCell, stress: Float) -> Float:
    """Stresses 33 (m,) of the stresses (m, 3) in plane strain or stress."""
    plane = cell.case.analysis.plane
    rules = [laws.out_of_plane(cell.case.material_of(s.submesh.phase), plane)[0] for s in cell.parts]
    sizes = [elements for _, elements in _sizes(cell)]
    return np.asarray(np.einsum("ev,ev->e", stress, np.repeat(np.reshape(rules, (-1, 3)), sizes, axis=0)))
