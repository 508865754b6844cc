"""The torn cell and its responses as the parts of result.h5 that this rank writes."""

from __future__ import annotations

import json
import os

import numpy as np

from feti_homog import __version__
from feti_homog.fem.assembly import element_strain
from feti_homog.homogenization.averaging import Response, displacement, fluctuation
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.output.files.field_layout import FibrePart, Header, InterfacePart, MeshPart, StatePart
from feti_homog.typing import Float, Int


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
    )


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
    jumps, numbers = cell.solver.jump_operator, _node_numbers(cell)
    nodes = jumps.nodes
    return InterfacePart(
        points=nodes.points,
        normal=nodes.normal,
        length=nodes.length,
        fibre=nodes.fibre,
        fibre_number=cell.summary.fibre_number(nodes.fibre),
        fibre_node=numbers[nodes.fibre_node],
        matrix_node=jumps.from_matrix(numbers),
    )


def state_part(cell: TornCell, response: Response, load_factor: float, label: str) -> StatePart:
    """The fields of a response; tractions and jumps are scaled like it."""
    nodes, solution = cell.solver.jump_operator.nodes, response.state.solution
    u = response.scale * cell.solver.displacement(solution)
    pair = nodes.row[:, None] + np.arange(2)
    return StatePart(
        strain=response.strain,
        stress_mean=response.stress,
        load_factor=load_factor,
        label=label,
        displacement=displacement(cell, response.strain, u),
        fluctuation=fluctuation(cell, u),
        stress=_element_stress(cell, response.strain, u),
        traction=response.scale * solution.lam[pair] / nodes.length[:, None],
        jump=response.scale * solution.jump[pair],
        status=response.state.status,
    )


def _node_numbers(cell: TornCell) -> Int:
    """(c,) number in the file of a node of each of this rank's classes, one subdomain after the other.  Collective."""
    meshes = [s.mesh for s in cell.subdomains]
    first = cell.comm.exscan(sum(len(m.points) for m in meshes)) or 0
    starts = first + np.cumsum([0, *(len(m.points) for m in meshes)])
    numbers = [np.zeros(0, np.int64)]
    for mesh, start in zip(meshes, starts, strict=False):
        own = np.empty(mesh.n_classes, np.int64)
        own[mesh.node_class] = start + np.arange(len(mesh.points))
        numbers.append(own)
    return np.concatenate(numbers)


def _element_stress(cell: TornCell, E: Float, u: Float) -> Float:
    """(elements, 3) mean stresses."""
    stresses = [np.zeros((0, 3))]
    for s, offset in zip(cell.subdomains, cell.offsets, strict=False):
        own = u[offset : offset + len(s.Q)].reshape(-1, 2)
        strain, _ = element_strain(s.mesh.points, s.mesh.triangles, s.mesh.node_class, own)
        stresses.append((strain + E) @ s.L)
    return np.concatenate(stresses)
