"""Split subdomains into one-body parts, and find displacements on coarser meshes.

A subdomain in one material is one part; a subdomain across materials has one part for each body.  A coarser mesh has a
quarter or a sixteenth of the elements, and its nodes are also nodes of the finer mesh.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.fem import Problem, assembly
from feti_homog.feti.decomposition import JumpOperator, SharedEntities, Subdomain, jump_operator, shared_entities
from feti_homog.feti.operators import interface_operators, one_subdomain
from feti_homog.mesh import FineMesh, ReferenceLattice, Submesh, periodic_topology, refinement, submeshes
from feti_homog.typing import Float, Int

# Number of elements in a group of subdomains: small enough for the processor's cache, large enough for NumPy.
ELEMENTS_AT_ONCE = 1 << 13
# Least number of halvings at which the coarser mesh has two fewer, except across materials and if a phase locks.
REFINED_OFTEN = 3
# Largest lambda / mu on such a mesh, and in subdomains across materials: the value at Poisson's ratio 0.4.  Above it,
# coarse elements lock, and their errors say little about the fine mesh.
LOCKING = 4.0
# Position of a displacement that is not on a boundary: the last position, where the displacement is zero.
NONE = -1


@dataclass(frozen=True, eq=False)
class UniformPart:
    """The part of a subdomain in one body.

    Attributes:
        place: subdomain number on this rank.
        submesh, mesh: coarse triangles and refined mesh of the part.
        dofs: (k,) degrees of freedom of the part in the subdomain.
        L, problem: as in `Subdomain`.
        is_mixed: whether each element has a bubble and a pressure.
    """

    place: int
    submesh: Submesh
    mesh: FineMesh
    dofs: Int
    L: Float
    problem: Problem
    is_mixed: bool


def parts_of(subdomains: Sequence[Subdomain], phase_of: Sequence[str]) -> Iterator[UniformPart]:
    """Yield the one-body parts of each subdomain, by phase and body; `phase_of` (constituents,) names phases."""
    for number, s in enumerate(subdomains):
        if s.material is None:
            yield UniformPart(number, s.submesh, s.mesh, np.arange(s.n_dofs), s.L, s.problem, s.is_mixed)
            continue
        order = np.lexsort((s.submesh.constituent, s.material))
        bodies = s.submesh.constituent[order]
        for members in np.split(order, np.flatnonzero(np.diff(bodies)) + 1):
            body, law = int(s.submesh.constituent[members[0]]), s.material[members[0]]
            submesh = replace(submeshes.part(s.submesh, members), body=body, phase=phase_of[body])
            mesh, classes = _restricted(s.mesh, members)
            is_mixed = bool(np.broadcast_to(s.mixed, len(s.laws))[law])
            yield UniformPart(number, submesh, mesh, s.problem.dofs(classes), s.laws[law], s.problem, is_mixed)


def nodes_of_parts(s: Subdomain) -> int:
    """Count the plane nodes in all parts of a subdomain across materials; shared nodes count in each part."""
    body, nodes = np.repeat(s.submesh.constituent, s.mesh.nodes.shape[1]), s.mesh.nodes.ravel()
    last = np.empty(len(s.mesh.points), np.int64)
    last[nodes] = body
    repeated = np.flatnonzero(last[nodes] != body)
    return len(last) + len(np.unique(nodes[repeated].astype(np.int64) * (int(body.max()) + 1) + body[repeated]))


def _restricted(mesh: FineMesh, members: Int) -> tuple[FineMesh, Int]:
    """Return the mesh of the coarse triangles `members` (t,), and the original numbers (c,) of its classes."""
    nodes, local = periodic_topology.present(mesh.nodes[members], len(mesh.points))
    classes, node_class = periodic_topology.present(mesh.node_class[nodes], mesh.n_classes)
    triangles, numbers = local.astype(np.int32), node_class.astype(np.int32)
    return FineMesh(mesh.points[nodes], triangles, mesh.curved[members], numbers, len(classes), mesh.lattice), classes


def share_parts(
    comm: MPI.Intracomm,
    parts: Sequence[UniformPart],
    table: submeshes.SubdomainTable,
    pairs: Int,
    lattice: ReferenceLattice,
) -> SharedEntities:
    """Find the shared nodes of parts, as `share_entities` does for subdomains.  Collective."""
    body = np.array([p.submesh.body for p in parts])
    member = np.repeat(np.arange(len(parts)), [len(p.mesh.nodes) for p in parts])
    index, phase = np.array([p.submesh.index for p in parts]), tuple(p.submesh.phase for p in parts)
    joined = submeshes.SubmeshesOfRank(submeshes.joined_meshes([p.submesh for p in parts]), member, index, body, phase)
    bodies = comm.allgather(body)
    rank = np.repeat(np.arange(comm.size), [len(bodies_of_rank) for bodies_of_rank in bodies])
    table = submeshes.SubdomainTable(np.concatenate(bodies), rank, table.nesting, table.phase)
    return shared_entities.share_entities(comm, joined, table, pairs, lattice)


class ForcesBetweenParts:
    """The operator from displacements to multipliers that keep parts in equilibrium; B is their jump operator."""

    def __init__(self, comm: MPI.Intracomm, parts: Sequence[UniformPart], jumps: JumpOperator) -> None:
        """Assemble stiffness K and load forces Q of the coarse triangles at shared nodes.  Collective."""
        self._jumps, problem = jumps, jumps.problem
        torn = refinement.joined([p.mesh for p in parts])
        is_shared = np.zeros(torn.n_classes, bool)
        is_shared[problem.nodes(np.flatnonzero(jumps.B.getnnz(axis=0)))] = True
        touching = np.flatnonzero(is_shared[torn.node_class[torn.nodes]].any(axis=1))
        mesh, classes = _restricted(torn, touching)
        kinds = {(p.L.tobytes(), p.is_mixed): p for p in parts}  # few, unlike the parts
        numbers = dict(zip(kinds, range(len(kinds)), strict=True))
        material = np.repeat([numbers[p.L.tobytes(), p.is_mixed] for p in parts], [len(p.mesh.nodes) for p in parts])
        L, mixed = np.stack([p.L for p in kinds.values()]), tuple(p.is_mixed for p in kinds.values())
        body = assembly.assemble(mesh, L, problem, mixed, material[touching])
        sides = np.concatenate([assembly.side_loads(p.submesh, p.mesh, problem) for p in parts])
        self._dofs, self._K = problem.dofs(classes), body.K
        self._Q = np.hstack([body.Q, sides[self._dofs]])
        blocks = jump_operator.NodeBlocks(comm, jumps, csr_matrix(jumps.B @ jumps.B.T))
        self._inverse = blocks.inverse(np.ones(jumps.owned[1] - jumps.owned[0]))

    def multipliers(self, u: Float, loads: Float) -> Float:
        """Return multipliers (B B^T)^-1 B (-K u - Q E) (owned rows,) under u (dofs,) and `loads` E.  Collective."""
        forces = np.zeros(len(u))
        forces[self._dofs] = -self._K @ u[self._dofs] - self._Q @ loads
        return np.asarray(self._inverse @ self._jumps.sum(self._jumps.B @ forces))


def locks(subdomains: Sequence[Subdomain | UniformPart], comm: MPI.Intracomm) -> bool:
    """Return whether any phase is nearly incompressible, so that coarse elements lock.  Collective."""
    locking = any(s.problem.components == 2 and s.L[0, 1] > LOCKING * s.L[2, 2] for s in subdomains)
    return bool(comm.allreduce(locking, MPI.LOR))


def nested_interiors(
    boundary: interface_operators.InterfaceOperators,
    lattice: ReferenceLattice,
    coarser: ReferenceLattice,
    u: Float,
    loads: Float,
) -> Iterator[tuple[list[Subdomain], FineMesh, Float, Int]]:
    """Extend u (boundary dofs, k) under the loads (v, k) to u* on the lattice `coarser`, for groups with one phase.

    Yields the subdomains of each group, their joined mesh with c displacements per node, u* (classes, c, k), and the
    positions (c classes,) of these displacements among those on all boundaries: NONE inside, and where a class is
    pinned, so that u* = 0.
    """
    nested, inside, of_place = coarser.within(lattice), NONE - 1, np.vstack([u, np.zeros((1, u.shape[1]))])
    for group in groups(boundary.subdomains, coarser):
        members = [boundary.subdomains[k] for k in group]
        meshes = [refinement.refine(s.submesh, coarser) for s in members]
        first, numbers = members[0], list[Int]()
        for k, s, mesh in zip(group, members, meshes, strict=True):
            of_fine = np.full(s.n_dofs, inside)
            of_fine[boundary.dofs[k]] = boundary.offsets[k] + np.arange(len(boundary.dofs[k]))
            of_fine[s.problem.dofs(s.held)] = NONE
            fine = np.empty(mesh.n_classes, np.int64)
            fine[mesh.node_class[mesh.nodes]] = s.mesh.node_class[s.mesh.nodes[:, nested]]
            numbers.append(of_fine[s.problem.dofs(fine)])
        position = np.concatenate(numbers)
        fixed = np.flatnonzero(position != inside)
        position[position == inside] = NONE
        mesh, displacement = refinement.joined(meshes), of_place[position]  # NONE takes the last row
        body = assembly.assemble(mesh, first.L, first.problem, first.is_mixed)
        interior, load = one_subdomain.Interior(body.K, fixed), None
        sides = [assembly.side_loads(s.submesh, mesh, s.problem) for s, mesh in zip(members, meshes, strict=True)]
        if sides[0].size or any(s.submesh.at_void.any() for s in members):
            load = np.hstack([body.Q, np.concatenate(sides)])[interior.dofs] @ loads
        displacement[interior.dofs] = interior.extend(displacement[fixed], load)
        yield members, mesh, displacement.reshape(-1, first.problem.components, u.shape[1]), position


def groups(subdomains: Sequence[Subdomain | UniformPart], lattice: ReferenceLattice) -> Iterator[list[int]]:
    """Group the indices of consecutive subdomains of one phase; several have at most ELEMENTS_AT_ONCE elements."""
    group, elements = list[int](), 0
    for number, s in enumerate(subdomains):
        count = len(s.mesh.nodes) * len(lattice.triangles)
        elements += count
        if group and (elements > ELEMENTS_AT_ONCE or s.submesh.phase != subdomains[group[0]].submesh.phase):
            yield group
            group, elements = [], count
        group.append(number)
    if group:
        yield group
