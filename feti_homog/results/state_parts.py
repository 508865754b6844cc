"""Responses of the torn cell as the states of result.h5, what this rank has of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.fem.assembly import element_strain
from feti_homog.homogenization import phase_laws
from feti_homog.homogenization.averaging import Response, displacement, fluctuation
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.materials import laws, voigt
from feti_homog.results.field_layout import StatePart
from feti_homog.results.field_layout import SpatialStatePart
from feti_homog.typing import Float, Float32


def state_part(cell: TornCell, response: Response, load_factor: float, label: str, point: int) -> StatePart:
    """The fields of a response in plane strain or stress.  Collective when first called."""
    fields, nodes = _fields_of(cell, response), cell.solver.jump_operator.nodes
    stress, (S33, E33) = fields.stress, _out_of_plane(cell, fields.stress)
    first, second, third = voigt.principal(stress, S33).T
    opening = _in_axes(nodes.normal, fields.jump)
    fibre = fields.displacement[cell.class_nodes[nodes.fibre_node]]
    return StatePart(
        strain=response.strain,
        stress_mean=response.stress,
        load_factor=load_factor,
        point=point,
        label=label,
        displacement=fields.displacement,
        fluctuation=fields.fluctuation,
        stress=stress,
        stress_33=S33,
        element_strain=_single(np.column_stack([fields.strain * [1.0, 1.0, 0.5], E33])),
        von_mises=_single(voigt.von_mises(stress, S33)),
        principal_1=_single(first),
        principal_2=_single(second),
        principal_3=_single(third),
        traction=fields.traction,
        jump=fields.jump,
        traction_vector=_vectors(_in_axes(nodes.normal, fields.traction)),
        jump_vector=_vectors(opening),
        displacement_fibre=_vectors(fibre),
        displacement_matrix=_vectors(fibre + opening),
        status=response.state.status,
    )


def spatial_state_part(
    cell: TornCell, plane: Response | None, axial: Response | None, load_factor: float, label: str, point: int
) -> SpatialStatePart:
    """The fields of the responses of the plane problem and of the axial one in generalized plane strain; those of one
    that is None are zero.  Collective when first called.

    Raises:
        ValueError: there is no response, or no axial problem.
    """
    response = plane or axial
    if response is None or cell.axial is None:
        raise ValueError("expected a response of a cell with an axial problem")
    in_plane, along = _fields_of(cell, plane), _fields_of(cell.axial, axial)
    stress, S33 = in_plane.stress[:, :3], in_plane.stress[:, 3]
    # The axial problem has [13, 23], the file [23, 13].
    shears = np.ascontiguousarray(along.stress[:, ::-1])
    first, second, third = voigt.spatial_principal(stress, S33, shears).T
    nodes = cell.solver.jump_operator.nodes
    opening = _vectors(_in_axes(nodes.normal, in_plane.jump), along.jump)
    fibre = _vectors(in_plane.displacement, along.displacement)[cell.class_nodes[nodes.fibre_node]]
    return SpatialStatePart(
        strain=phase_laws.spatial_vector(*(r if r is None else r.strain for r in (plane, axial))),
        stress_mean=phase_laws.spatial_vector(*(r if r is None else r.stress for r in (plane, axial))),
        temperature=0.0 if plane is None or len(plane.strain) == 4 else float(plane.strain[4]),
        load_factor=load_factor,
        point=point,
        label=label,
        displacement=in_plane.displacement,
        fluctuation=in_plane.fluctuation,
        stress=stress,
        stress_33=S33,
        element_strain=_single(in_plane.strain[:, :4] * [1.0, 1.0, 0.5, 1.0]),
        von_mises=_single(voigt.spatial_von_mises(stress, S33, shears)),
        principal_1=_single(first),
        principal_2=_single(second),
        principal_3=_single(third),
        axial_displacement=along.displacement[:, 0],
        axial_fluctuation=along.fluctuation[:, 0],
        axial_stress=shears,
        axial_strain=_single(along.strain[:, ::-1] / 2),
        traction=in_plane.traction,
        jump=in_plane.jump,
        axial_traction=along.traction[:, 0],
        axial_jump=along.jump[:, 0],
        traction_vector=_vectors(_in_axes(nodes.normal, in_plane.traction), along.traction),
        jump_vector=opening,
        displacement_fibre=fibre,
        displacement_matrix=fibre + opening,
        status=response.state.status,
    )


@dataclass(frozen=True)
class _Fields:
    """What a response makes of the c displacements of a problem with v loads.

    Attributes:
        displacement, fluctuation: (n, c).
        strain, stress: (m, v) means over the elements: the loads in each, and what works on them.
        traction, jump: (k, c).
    """

    displacement: Float
    fluctuation: Float
    strain: Float
    stress: Float
    traction: Float
    jump: Float


def _fields_of(cell: TornCell, response: Response | None) -> _Fields:
    """The fields of a response, zero without one."""
    nodes, problem = cell.solver.jump_operator.nodes, cell.solver.problem
    if response is None:
        c, v = problem.components, len(problem.loads)
        n, m = (sum(sizes) for sizes in zip(*_sizes(cell), strict=True)) if cell.subdomains else (0, 0)
        points, elements, pairs = np.zeros((n, c)), np.zeros((m, v)), np.zeros((len(nodes.row), c))
        return _Fields(points, points, elements, elements, pairs, pairs)
    solution = response.state.solution
    u = response.scale * cell.solver.displacement(solution)
    pair = nodes.row[:, None] + np.arange(problem.components)
    return _Fields(
        displacement(cell, response.strain, u),
        fluctuation(cell, u),
        *_element_fields(cell, response.strain, u),
        response.scale * solution.lam[pair] / nodes.length[:, None],
        response.scale * cell.solver.opening(solution)[pair],
    )


def _sizes(cell: TornCell) -> list[tuple[int, int]]:
    """Nodes and elements of this rank's subdomains."""
    return [(len(s.mesh.points), len(s.mesh.triangles)) for s in cell.subdomains]


def _element_fields(cell: TornCell, loads: Float, u: Float) -> tuple[Float, Float]:
    """Means over the elements under the loads (v,): strains with the other loads, and what works on them, (m, v)."""
    problem = cell.solver.problem
    of_displacements, others = loads[: problem.strains], loads[problem.strains :]
    strains, stresses = ([np.zeros((0, len(loads)))] for _ in range(2))
    for s, offset in zip(cell.subdomains, cell.offsets, strict=False):
        own = u[offset : offset + len(s.Q)].reshape(-1, problem.components)
        strain = of_displacements + element_strain(
            s.mesh.points, s.mesh.triangles, s.mesh.node_class, own, problem
        )[0]  # fmt: skip
        strain = np.column_stack([strain, np.tile(others, (len(strain), 1))])
        strains.append(strain)
        stresses.append(strain @ s.L)
    return np.concatenate(strains), np.concatenate(stresses)


def _out_of_plane(cell: TornCell, stress: Float) -> tuple[Float, Float]:
    """Stresses 33 and strains 33 (m,) of the stresses (m, 3) in plane strain or stress."""
    sizes = [elements for _, elements in _sizes(cell)]
    rules = [
        laws.out_of_plane(cell.case.material_of(s.submesh.phase), cell.case.analysis.plane)
        for s in cell.subdomains
    ]
    parts = zip(np.split(stress, np.cumsum(sizes)), rules, strict=False)
    found = [(own @ to_S33, own @ to_E33) for own, (to_S33, to_E33) in parts]
    S33, E33 = zip(*found, strict=True) if found else ((), ())
    return np.concatenate([np.zeros(0), *S33]), np.concatenate([np.zeros(0), *E33])


def _in_axes(normal: Float, pairs: Float) -> Float:
    """(k, 2) components along x and y of vectors (k, 2) that are normal and tangential; normals (k, 2)."""
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    return np.asarray(pairs[:, :1] * normal + pairs[:, 1:] * tangent)


def _vectors(in_plane: Float, along: Float | None = None) -> Float:
    """(k, 3) vectors of components (k, 2) in the plane and (k, 1) along x3, by default 0."""
    return np.pad(in_plane, [(0, 0), (0, 1)]) if along is None else np.hstack([in_plane, along])


def _single(values: Float) -> Float32:
    """In single precision: these follow from displacements and stresses, and are made to be looked at."""
    with np.errstate(over="ignore"):  # to infinity
        return values.astype(np.float32)
