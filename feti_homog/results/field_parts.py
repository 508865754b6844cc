"""The torn cell as the parts of result.h5 that this rank writes; `state_parts` has those of its responses."""

from __future__ import annotations

import json
import os

import numpy as np

from feti_homog.version import __version__
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.results.field_layout import FibrePart, Header, InterfacePart, MeshPart


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
        fibre_number=np.repeat([cell.summary.numbers[s.submesh.body] for s in subdomains], sizes).astype(np.int32),
    )


def fibre_part(cell: TornCell) -> FibrePart:
    """The fibres on rank 0, none on the others."""
    summary = cell.summary
    body = summary.fibre_bodies[: None if cell.comm.rank == 0 else 0]
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
        pair=nodes.pair,
        fibre_node=numbers[nodes.fibre_node],
        vertex=(cell.comm.exscan(len(nodes.row)) or 0) + np.arange(len(nodes.row))[:, None],
        matrix_node=jumps.from_matrix(numbers),
    )
