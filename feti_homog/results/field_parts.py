"""Convert the torn cell and its responses into this rank's parts of result.h5."""

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog import __version__
from feti_homog.fem import GENERALIZED
from feti_homog.homogenization import averaging, phase_laws, recovered_fields, unit_cell
from feti_homog.materials import laws, voigt
from feti_homog.results.field_layout import FibrePart, Header, InterfacePart, MeshPart, SpatialStatePart, StatePart
from feti_homog.typing import Float


def header(cell: unit_cell.TornCell) -> Header:
    """Return the attributes of result.h5 for a cell."""
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
        origin=plan.origin,
        case=json.dumps(case.resolved(), default=os.fspath),
    )


def mesh_part(cell: unit_cell.TornCell) -> MeshPart:
    """Concatenate the refined meshes of this rank's one-body parts; nodes are numbered from 0 on each rank."""
    subdomains = cell.parts
    nodes = np.cumsum([0, *(len(s.mesh.points) for s in subdomains)])
    columns = 3 * cell.case.cell.order
    sizes = [len(s.mesh.triangles) for s in subdomains]
    triangles = [s.mesh.triangles + n for s, n in zip(subdomains, nodes, strict=False)]
    phase = [cell.summary.phases.index(s.submesh.phase) for s in subdomains]
    return MeshPart(
        points=np.concatenate([s.mesh.points for s in subdomains] or [np.zeros((0, 2))]) + cell.summary.origin,
        triangles=np.concatenate(triangles or [np.zeros((0, columns), np.int64)]),
        body=np.repeat([s.submesh.body for s in subdomains], sizes).astype(np.int32),
        subdomain=np.repeat([s.submesh.index for s in subdomains], sizes).astype(np.int32),
        rank=np.full(sum(sizes), cell.comm.rank, np.int32),
        phase=np.repeat(phase, sizes).astype(np.int32),
        fibre_number=np.repeat([cell.summary.numbers[s.submesh.body] for s in subdomains], sizes).astype(np.int32),
    )


def fibre_part(cell: unit_cell.TornCell) -> FibrePart:
    """Return all fibres on rank 0, and no fibre on other ranks."""
    summary = cell.summary
    body = summary.fibre_bodies if cell.comm.rank == 0 else summary.fibre_bodies[:0]
    return FibrePart(
        number=summary.numbers[body],
        body=body,
        phase=summary.constituent_phase[body],
        centre=summary.centres[body] + summary.origin,
        radius=summary.radii[body],
        strength=cell.strength_factors[: len(body)],
    )


def interface_part(cell: unit_cell.TornCell) -> InterfacePart:
    """Return the interface nodes whose multipliers this rank owns.  Collective."""
    jumps, nodes = cell.jumps, cell.jumps.nodes
    first = cell.comm.exscan(sum(len(s.mesh.points) for s in cell.parts)) or 0
    numbers = first + cell.class_nodes
    return InterfacePart(
        points=nodes.points + cell.summary.origin,
        normal=nodes.normal,
        length=nodes.length,
        fibre=nodes.fibre,
        fibre_number=cell.summary.numbers[nodes.fibre],
        pair=nodes.pair,
        fibre_node=numbers[nodes.fibre_node],
        vertex=(cell.comm.exscan(len(nodes.row)) or 0) + np.arange(len(nodes.row))[:, None],
        matrix_node=jumps.from_outer(numbers),
    )


def state_parts(
    cell: unit_cell.TornCell,
    states: Mapping[str, Sequence[averaging.Response | None]],
    load_factor: float,
    point: int,
    fields: recovered_fields.RecoveredFields,
) -> Iterator[StatePart]:
    """Yield this rank's part of each state, from its responses and the recovered `fields`.  Collective.

    `states` maps labels to the responses in the plane problem and, if there is one, in the axial problem; conduction
    takes the place of the axial problem.  A problem without a response (None) has zero fields; a state has at least one
    response.  `load_factor` and `point` are as in `StatePart`.
    """
    axial_cell = cell.axial or cell
    for number, (label, responses) in enumerate(states.items()):
        plane, axial = responses if len(responses) == 2 else (responses[0], None)
        present, stress = [part for part in responses if part is not None], fields.stress[number]
        shares = [part.shares for part in present if part.shares is not None]
        errors = np.sum(shares or [np.full(stress.shape[1], np.nan)], axis=0)
        u = [x[:, number] for x in fields.displacement]
        problem = cell.solver.problem if cell.solver.problem.turns else GENERALIZED
        in_plane = recovered_fields.nodal_fields(cell, plane, u[0], problem)
        common: dict[str, Any] = {"load_factor": load_factor, "point": point, "label": label}
        energy = sum(2 * part.stored for part in present)  # E . Sigma
        common["mesh_error"] = (errors / (energy if energy > 0 else 1.0)).astype(np.float32)
        common["stress_33"] = stress[2]
        common["stress"] = stress[voigt.IN_PLANE].T
        if plane is not None and cell.axial is None:
            laws_of = [cell.case.material_of(s.submesh.phase) for s in cell.parts]
            rules = np.reshape([laws.out_of_plane(law, cell.case.analysis.plane)[0] for law in laws_of], (-1, 3))
            rules = np.repeat(rules, [len(s.mesh.triangles) for s in cell.parts], axis=0)  # a row for each element
            common["stress_33"] = np.einsum("ev,ev->e", common["stress"], rules)
            common |= _at_nodes(cell, present[0], in_plane)
            yield StatePart(strain=plane.strain, stress_mean=plane.stress, **common)
            continue
        along = recovered_fields.nodal_fields(axial_cell, axial, u[-1], axial_cell.solver.problem)
        yield SpatialStatePart(
            strain=phase_laws.spatial_vector(*(r if r is None else r.strain for r in (plane, axial))),
            stress_mean=phase_laws.spatial_vector(*(r if r is None else r.stress for r in (plane, axial))),
            temperature=0.0 if plane is None or len(plane.strain) == 4 else float(plane.strain[4]),
            axial_displacement=along.displacement[:, 0],
            axial_stress=stress[[3, 4]].T,
            axial_traction=along.traction[:, 0],
            axial_jump=along.jump[:, 0],
            **common,
            **_at_nodes(cell, present[0], in_plane, along),
        )


def _at_nodes(
    cell: unit_cell.TornCell,
    response: averaging.Response,
    in_plane: recovered_fields.NodalFields,
    along: recovered_fields.NodalFields | None = None,
) -> dict[str, Any]:
    """Return displacements, and fields at interface nodes, by dataset name; without `along`, 0 along x3.

    If subdomains extend across materials, all interface nodes are bonded.
    """
    nodes, state, is_across = cell.jumps.nodes, response.state, cell.summary.across
    u3, traction3, jump3 = (None,) * 3 if along is None else (along.displacement, along.traction, along.jump)
    opening = _vectors(_in_axes(nodes.normal, in_plane.jump), jump3)
    fibre = _vectors(in_plane.displacement, u3)[cell.class_nodes[nodes.fibre_node]]
    zeros = np.zeros(len(nodes.row), np.int8)
    return {
        "displacement": in_plane.displacement,
        "traction": in_plane.traction,
        "jump": in_plane.jump,
        "traction_vector": _vectors(_in_axes(nodes.normal, in_plane.traction), traction3),
        "jump_vector": opening,
        "displacement_fibre": fibre,
        "displacement_matrix": fibre + opening,
        "status": zeros if is_across else state.status,
        "damage": zeros.astype(float) if is_across else response.damage,
        "sliding": zeros if is_across else state.bonds.sliding_signs,
    }


def _in_axes(normal: Float, pairs: Float) -> Float:
    """Rotate normal and tangential components `pairs` (k, 2) into components (k, 2) along x1 and x2."""
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    return np.asarray(pairs[:, :1] * normal + pairs[:, 1:] * tangent)


def _vectors(in_plane: Float, along: Float | None = None) -> Float:
    """Join components in the plane (k, 2) and along x3 (k, 1), by default 0, to vectors (k, 3)."""
    return np.pad(in_plane, [(0, 0), (0, 1)]) if along is None else np.hstack([in_plane, along])
