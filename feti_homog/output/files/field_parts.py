"""The torn cell and its responses as the parts of result.h5 that this rank writes."""

from __future__ import annotations

import json
import os

import numpy as np

from feti_homog import __version__
from feti_homog.config import materials
from feti_homog.fem.assembly import element_strain
from feti_homog.homogenization.averaging import Response, displacement, fluctuation
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.mechanics import stress_measures
from feti_homog.output.files.field_layout import FibrePart, Header, InterfacePart, MeshPart, StatePart
from feti_homog.typing import Float, Float32


def header(cell: TornCell) -> Header:
    """What the file says of the whole cell."""
    case, plan = cell.case, cell.summary
    return Header(
        title=case.name,
        version=__version__,
        width=plan.width,
        height=plan.height,
        order=case.cell.order,
        refine=case.cell.refine,
        phases=plan.phases,
        length_unit=case.output.length_unit,
        stress_unit=case.output.stress_unit,
        case=json.dumps(case.resolved(), default=os.fspath),
    )


def mesh_part(cell: TornCell) -> MeshPart:
    """The refined meshes of this rank's subdomains, one after the other."""
    subdomains = cell.subdomains
    nodes = np.cumsum([0, *(len(s.mesh.points) for s in subdomains)])
    columns = 3 * cell.case.cell.order
    sizes = [len(s.mesh.triangles) for s in subdomains]
    triangles = [s.mesh.triangles + n for s, n in zip(subdomains, nodes, strict=False)]
    phase = [cell.summary.phases.index(s.submesh.phase) for s in subdomains]
    return MeshPart(
        points=np.concatenate([s.mesh.points for s in subdomains] or [np.zeros((0, 2))]),
        triangles=np.concatenate(triangles or [np.zeros((0, columns), np.int64)]),
        body=np.repeat([s.submesh.body for s in subdomains], sizes).astype(np.int32),
        subdomain=np.repeat([s.submesh.index for s in subdomains], sizes).astype(np.int32),
        phase=np.repeat(phase, sizes).astype(np.int32),
        fibre_number=np.repeat([_fibre_number(cell, s.submesh.body) for s in subdomains], sizes).astype(np.int32),
    )


def _fibre_number(cell: TornCell, body: int) -> int:
    """The number of a body's fibre, 0 for the matrix."""
    return max(0, body - cell.summary.first_fibre + 1)


def fibre_part(cell: TornCell) -> FibrePart:
    """The fibres on rank 0, none on the others."""
    summary = cell.summary
    body = np.arange(summary.first_fibre, len(summary.centres) if cell.comm.rank == 0 else 0)
    return FibrePart(
        number=summary.fibre_number(body),
        body=body,
        phase=summary.constituent_phase[body],
        centre=summary.centres[body],
        radius=summary.radii[body],
    )


def interface_part(cell: TornCell) -> InterfacePart:
    """The interface nodes whose multipliers this rank owns.  Collective."""
    jumps, nodes = cell.solver.jump_operator, cell.solver.jump_operator.nodes
    first = cell.comm.exscan(sum(len(s.mesh.points) for s in cell.subdomains)) or 0
    numbers = first + cell.class_nodes
    return InterfacePart(
        points=nodes.points,
        normal=nodes.normal,
        length=nodes.length,
        fibre=nodes.fibre,
        fibre_number=cell.summary.fibre_number(nodes.fibre),
        fibre_node=numbers[nodes.fibre_node],
        vertex=(cell.comm.exscan(len(nodes.row)) or 0) + np.arange(len(nodes.row))[:, None],
        matrix_node=jumps.from_matrix(numbers),
    )


def state_part(
    cell: TornCell, response: Response, axial: Response | None, load_factor: float, label: str, point: int
) -> StatePart:
    """The fields of a response; tractions and jumps are scaled like it."""
    nodes, solution = cell.solver.jump_operator.nodes, response.state.solution
    u = response.scale * cell.solver.displacement(solution)
    pair = nodes.row[:, None] + np.arange(2)
    total = displacement(cell, response.strain, u)
    fibre = total[cell.class_nodes[nodes.fibre_node]]
    traction, jump = (
        response.scale * solution.lam[pair] / nodes.length[:, None],
        response.scale * cell.solver.opening(solution)[pair],
    )
    opening = _in_axes(nodes.normal, jump)
    strain, stress, stress_33 = _element_fields(cell, response.strain, u)
    first, second, third = stress_measures.principal(stress, stress_33).T
    return StatePart(
        strain=response.strain,
        stress_mean=response.stress,
        load_factor=load_factor,
        point=point,
        label=label,
        displacement=total,
        fluctuation=fluctuation(cell, u),
        stress=stress,
        stress_33=stress_33,
        element_strain=strain,
        von_mises=_single(stress_measures.von_mises(stress, stress_33)),
        principal_1=_single(first),
        principal_2=_single(second),
        principal_3=_single(third),
        traction=traction,
        jump=jump,
        traction_vector=_with_third(_in_axes(nodes.normal, traction)),
        jump_vector=_with_third(opening),
        displacement_fibre=_with_third(fibre),
        displacement_matrix=_with_third(fibre + opening),
        status=response.state.status,
    )


def _element_fields(cell: TornCell, E: Float, u: Float) -> tuple[Float32, Float, Float]:
    """Means over the elements: strains [11, 22, 12, 33] (m, 4), components of the tensor; stresses [11, 22, 12] (m, 3);
    stresses 33 (m,)."""
    strains, stresses, out_of_plane = [np.zeros((0, 4), np.float32)], [np.zeros((0, 3))], [np.zeros(0)]
    for s, offset in zip(cell.subdomains, cell.offsets, strict=False):
        own = u[offset : offset + len(s.Q)].reshape(-1, 2)
        strain = E + element_strain(s.mesh.points, s.mesh.triangles, s.mesh.node_class, own)[0]
        stress = strain @ s.L
        to_S33, to_E33 = materials.out_of_plane(cell.case.material_of(s.submesh.phase), cell.case.analysis.plane)
        strains.append(_single(np.column_stack([strain * [1.0, 1.0, 0.5], stress @ to_E33])))
        stresses.append(stress)
        out_of_plane.append(stress @ to_S33)
    return np.concatenate(strains), np.concatenate(stresses), np.concatenate(out_of_plane)


def _in_axes(normal: Float, pairs: Float) -> Float:
    """(k, 2) components along x and y of vectors (k, 2) that are normal and tangential; normals (k, 2)."""
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    return np.asarray(pairs[:, :1] * normal + pairs[:, 1:] * tangent)


def _with_third(vectors: Float) -> Float:
    """(k, 3) vectors (k, 2) with a third component 0."""
    return np.pad(vectors, [(0, 0), (0, 1)])


def _single(values: Float) -> Float32:
    """In single precision: these follow from displacements and stresses, and are made to be looked at."""
    with np.errstate(over="ignore"):  # to infinity
        return values.astype(np.float32)
