"""A structured mesh of the unit square with a square fibre, and fields on it, as ranks hand them over."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.results.field_file import FieldFile
from feti_homog.results.field_layout import (
    FibrePart,
    Header,
    InterfacePart,
    MeshPart,
    SpatialStatePart,
    StatePart,
    rows_of,
    tables,
)
from feti_homog.results.result_json import SCHEMA

GRADIENTS = tuple(np.array([[a, b], [b, c]]) for a, b, c in ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.5, 0.0)))

VECTORS = ("traction_vector", "jump_vector", "displacement_fibre", "displacement_matrix")


@dataclass(frozen=True)
class Sample:
    header: Header
    mesh: MeshPart
    fibres: FibrePart
    interface: InterfacePart
    states: tuple[StatePart, ...]


def sample(cells: int = 8, refine: int = 0, order: int = 1) -> Sample:
    """Return the unit square on `cells` x `cells` coarse squares of two triangles; the fibre is the middle quarter.

    Body 0, the matrix, is torn in two (left, right of x = 1/2); body 1 is the fibre. 4 divides `cells`.
    """
    corners, phase = _coarse(cells)
    submesh = np.where(phase == 1, 2, (corners.mean(axis=1)[:, 0] > 0.5).astype(int))
    corners, submesh = corners[np.argsort(submesh, kind="stable")], np.sort(submesh)
    for _ in range(refine):
        corners = _split(corners)
    submesh = np.repeat(submesh, 4**refine)
    if order == 2:
        mids = 0.5 * (corners + np.roll(corners, -1, axis=1))
        corners = np.concatenate([corners, mids], axis=1)
    points, triangles = _merge(corners, submesh)
    phase = (submesh == 2).astype(int)
    mesh = MeshPart(points, triangles, body=phase, subdomain=submesh, rank=phase, phase=phase, fibre_number=phase)
    header = Header("sample", "0", 1.0, 1.0, order, refine, ("matrix", "fibre"), "mm", "GPa")
    one = np.array([1])
    fibres = FibrePart(one, one, one, np.array([[0.5, 0.5]]), np.array([np.nan]), np.ones(1))
    return Sample(
        header, mesh, fibres, _interface(mesh), tuple(_state(mesh, gradient, k) for k, gradient in enumerate(GRADIENTS))
    )


def write(directory: Path, whole: Sample, document: dict[str, Any] | None = None) -> Path:
    """Write result.h5, and result.json if a document is given; returns the path of result.h5."""
    from mpi4py import MPI

    with FieldFile(directory, MPI.COMM_SELF, whole.header, whole.mesh, whole.fibres, whole.interface) as file:
        for k, state in enumerate(whole.states):
            file.write_state(k, state)
    if document is not None:
        (directory / "result.json").write_text(json.dumps(document))
    return directory / "result.h5"


def part_of(whole: Sample, rank: int, size: int) -> Sample:
    """Return the share of a rank: subdomains are dealt out in order; ranks past the third have nothing."""
    mesh, last = whole.mesh, 2
    mine = [submesh for submesh in range(last + 1) if min(submesh, size - 1) == rank]
    rows = np.isin(mesh.subdomain, mine)
    nodes, triangles = np.unique(mesh.triangles[rows], return_inverse=True)
    labels = {name: getattr(mesh, name)[rows] for name in ("body", "subdomain", "rank", "phase", "fibre_number")}
    part = MeshPart(mesh.points[nodes], triangles.reshape(-1, mesh.triangles.shape[1]), **labels)
    owned = slice(None) if last in mine else slice(0)
    fibres = FibrePart(**{name: table[: 1 if rank == 0 else 0] for name, table in vars(whole.fibres).items()})
    interface = InterfacePart(**{name: table[owned] for name, table in vars(whole.interface).items()})
    states = tuple(_cut(state, nodes, rows, owned) for state in whole.states)
    return Sample(whole.header, part, fibres, interface, states)


def without_interface(whole: Sample) -> Sample:
    """Return the same with no interface nodes."""
    none = InterfacePart(**{name: table[:0] for name, table in vars(whole.interface).items()})
    states = (_cut(state, slice(None), slice(None), slice(0)) for state in whole.states)
    return replace(whole, interface=none, states=tuple(states))


def in_space(whole: Sample) -> Sample:
    """Return the same as states of generalized plane strain under E33 = 1, a temperature, and gamma13 = -1."""
    return replace(whole, states=tuple(_in_space(whole.mesh, state) for state in whole.states))


def _in_space(mesh: MeshPart, state: StatePart) -> SpatialStatePart:
    strain, place = np.zeros((3, 6)), state.stress[:, 0]
    strain[0, 2], strain[2, 4] = 1.0, -1.0
    plane, k = 0.0 if state.point == 2 else 1.0, np.arange(10.0)
    fields = vars(state) | {
        "strain": strain[state.point],
        "stress_mean": np.arange(6.0),
        "displacement": plane * state.displacement,
    }
    return SpatialStatePart(
        **fields,
        temperature=float(state.point == 1),
        axial_displacement=(plane - 1) * mesh.points[:, 0] + 0.1 * _bubble(mesh)[:, 0],
        axial_stress=np.stack([place, -place], axis=1),
        axial_traction=k,
        axial_jump=-k,
    )


def _coarse(cells: int) -> tuple[np.ndarray, np.ndarray]:
    i, j = (index.ravel() for index in np.meshgrid(np.arange(cells), np.arange(cells)))
    lower, upper = np.array([[0, 0], [1, 0], [1, 1]]), np.array([[0, 0], [1, 1], [0, 1]])
    base = np.stack([i, j], axis=1)[:, None, :]
    corners = np.concatenate([base + lower, base + upper]) / cells
    inside = (np.abs(corners.mean(axis=1) - 0.5) < 0.25).all(axis=1)
    return corners, inside.astype(int)


def _split(corners: np.ndarray) -> np.ndarray:
    """Each triangle in four, consecutive: at its corners 0, 1, 2, then the middle one."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    children = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.stack([np.stack(child, axis=1) for child in children], axis=1).reshape(-1, 3, 2)


def _merge(corners: np.ndarray, submesh: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nodes numbered piece by piece, shared within a piece only."""
    keys = np.concatenate([np.repeat(submesh, corners.shape[1])[:, None], corners.reshape(-1, 2)], axis=1)
    nodes, triangles = np.unique(keys.round(12), axis=0, return_inverse=True)
    return np.ascontiguousarray(nodes[:, 1:]), triangles.reshape(corners.shape[:2])


def _interface(mesh: MeshPart) -> InterfacePart:
    s = np.linspace(0.25, 0.75, 5)
    sides = [np.stack([s, 0 * s + 0.25], 1), np.stack([s, 0 * s + 0.75], 1)]
    normals = [np.tile([0.0, -1.0], (5, 1)), np.tile([0.0, 1.0], (5, 1))]
    points, length, fibre = np.concatenate(sides), np.full(10, 0.125), np.ones(10, int)
    in_fibre, in_matrix = (_nodes_at(mesh, points, body) for body in (1, 0))
    vertex = np.arange(10)[:, None]
    return InterfacePart(points, np.concatenate(normals), length, fibre, fibre, 0 * fibre, in_fibre, vertex, in_matrix)


def _nodes_at(mesh: MeshPart, points: np.ndarray, body: int) -> np.ndarray:
    """Return the nodes of a body at the points."""
    nodes = np.unique(mesh.triangles[mesh.body == body])
    away = np.abs(mesh.points[nodes][:, None] - points).max(axis=2)
    return nodes[away.argmin(axis=0)]


def _bubble(mesh: MeshPart) -> np.ndarray:
    return np.asarray(0.05 * np.sin(2 * np.pi * mesh.points)[:, ::-1])


def _state(mesh: MeshPart, gradient: np.ndarray, number: int) -> StatePart:
    """u = gradient x plus a bubble; the stress of an element is linear in its centre's position."""
    x = mesh.points
    centre = x[mesh.triangles[:, :3]].mean(axis=1)
    strain = np.array([gradient[0, 0], gradient[1, 1], 2 * gradient[0, 1]])
    stress = np.stack([1.0 + centre[:, 0], 2.0 + centre[:, 1], centre[:, 0] - centre[:, 1]], axis=1)
    k, place = np.arange(10.0), stress[:, 0]
    traction, jump, status = np.stack([k, -k], 1), np.stack([0.1 * k, 0.2 * k], 1), np.arange(10) % 3
    displacement = x @ gradient.T + _bubble(mesh)
    return StatePart(
        strain=strain,
        stress_mean=strain * 3,
        load_factor=1.0,
        point=number,
        label=f"state {number}",
        displacement=displacement,
        stress=stress,
        stress_33=4.0 + place,
        mesh_error=(0.01 * place**2).astype(np.float32),
        traction=traction,
        jump=jump,
        **{name: np.stack([n * k, k, 0 * k], axis=1) for n, name in enumerate(VECTORS)},
        status=status,
        damage=np.where(status == 0, 0.1 * np.arange(10) % 1.0, 1.0),
        sliding=np.where(status == 1, np.arange(10) % 3 - 1, 0),
    )


def _cut(state: StatePart, nodes: Any, rows: Any, owned: Any) -> StatePart:
    chosen = {"n": nodes, "m": rows, "k": owned}
    parts = {name: getattr(state, name)[chosen[rows_of(d)]] for name, d in tables(state).items()}
    return replace(state, **parts)


def path_of(strains: list[float]) -> dict[str, Any]:
    """Return the document of a path whose points have these strains E11."""
    counts = {"bonded": 5, "open": 3, "closed": 2, "broke": 1}
    points = [counts | {"load_factor": abs(e), "strain": [e, 0, 0], "stress": [3 * e, e, 0.5 * e]} for e in strains]
    section = {"strain": [1.0, 0.0, 0.0], "method": "events"}
    case = {"analysis": {"type": "path", "plane": "strain"}, "interface": {"contact": True}, "path": section}
    return {"schema": SCHEMA, "case": case | {"output": {"stress_unit": "GPa"}}, "path": points}
