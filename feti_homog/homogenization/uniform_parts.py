"""Parts of subdomains that lie in one body each, for averages of phases and estimates.

A subdomain of one material is a part itself; one across materials has a part for each body that it reaches.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.fem.assembly import assemble
from feti_homog.fem.problem import Problem
from feti_homog.feti.decomposition.jump_operator import JumpOperator, NodeBlocks
from feti_homog.feti.decomposition.shared_entities import SharedEntities, share_entities
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.mesh.periodic_topology import present
from feti_homog.mesh.refinement import FineMesh, ReferenceLattice, joined
from feti_homog.mesh.submesh import SubdomainTable, Submesh, SubmeshesOfRank, joined_meshes, part
from feti_homog.typing import Float, Int


@dataclass(frozen=True, eq=False)
class UniformPart:
    """A part of a subdomain, of one material.

    Attributes:
        place: of the subdomain among those of its rank.
        submesh, mesh: of the part.
        dofs: (cn,) the degrees of freedom of the subdomain that are the part's.
        L, problem: as of `Subdomain`.
        is_mixed: whether its elements have a bubble and a pressure of their own.
    """

    place: int
    submesh: Submesh
    mesh: FineMesh
    dofs: Int
    L: Float
    problem: Problem
    is_mixed: bool


def parts_of(subdomains: Sequence[Subdomain], phase_of: Sequence[str]) -> Iterator[UniformPart]:
    """Yield the parts of one subdomain after the other, with its index, those of one phase together.

    `phase_of` (constituents,) are the names of phases.
    """
    for place, s in enumerate(subdomains):
        if s.material is None:
            yield UniformPart(place, s.submesh, s.mesh, np.arange(s.n_dofs), s.L, s.problem, s.is_mixed)
            continue
        order = np.lexsort((s.submesh.constituent, s.material))
        bodies = s.submesh.constituent[order]
        for members in np.split(order, np.flatnonzero(np.diff(bodies)) + 1):
            body, law, is_mixed = int(s.submesh.constituent[members[0]]), *_law(s, members)
            submesh = replace(part(s.submesh, members), body=body, phase=phase_of[body])
            mesh, classes = _restricted(s.mesh, members)
            yield UniformPart(place, submesh, mesh, s.problem.dofs(classes), law, s.problem, is_mixed)


def nodes_of_parts(s: Subdomain) -> int:
    """Return the number of plane nodes of all parts of a subdomain; those of several count for each."""
    body, nodes = np.repeat(s.submesh.constituent, s.mesh.nodes.shape[1]), s.mesh.nodes.ravel()
    one = np.empty(len(s.mesh.points), np.int64)
    one[nodes] = body
    others = np.flatnonzero(one[nodes] != body)
    return len(one) + len(np.unique(nodes[others].astype(np.int64) * (int(body.max()) + 1) + body[others]))


def parts_of_phases(subdomains: Sequence[Subdomain], lattice: ReferenceLattice, elements: int) -> Iterator[UniformPart]:
    """Yield the parts of subdomains across materials in the same order, several bodies of one phase together.

    So many that a part has no more than `elements`, and none that touch.  They keep all nodes and edges of the
    subdomain; their elements are those of a `lattice` of no more halvings than its own.
    """
    for place, s in enumerate(subdomains):
        assert s.material is not None
        corners = s.submesh.vertex_class[s.submesh.triangles]
        order = np.lexsort((s.submesh.constituent, s.material))
        bodies = np.split(order, np.flatnonzero(np.diff(s.submesh.constituent[order])) + 1)
        for members in _apart(bodies, corners, s.material, elements // len(lattice.triangles)):
            names = ("constituent", "triangles", "triangle_edges", "backwards")
            submesh = replace(s.submesh, **{name: getattr(s.submesh, name)[members] for name in names})
            nodes = s.mesh.nodes[members]
            nodes = nodes if lattice is s.mesh.lattice else nodes[:, lattice.within(s.mesh.lattice)]
            mesh = replace(s.mesh, nodes=nodes, curved=s.mesh.curved[members], lattice=lattice)
            law, is_mixed = _law(s, members)
            yield UniformPart(place, submesh, mesh, np.arange(s.n_dofs), law, s.problem, is_mixed)


def _law(s: Subdomain, members: Int) -> tuple[Float, bool]:
    """Return the stiffness of coarse triangles of one material, and whether their elements are mixed."""
    assert s.material is not None
    number = s.material[members[0]]
    return s.laws[number], bool(np.broadcast_to(s.mixed, len(s.laws))[number])


def _apart(bodies: Sequence[Int], corners: Int, material: Int, most: int) -> Iterator[Int]:
    """Yield the triangles of bodies, of several if they are of one material, touch nowhere and are at most `most`."""
    group, size, seen = list[Int](), 0, np.full(int(corners.max()) + 1, -1)
    for number, own in enumerate(bodies):
        touches = (seen[corners[own]] >= number - len(group)).any()
        if group and (touches or size + len(own) > most or material[own[0]] != material[group[0][0]]):
            yield np.concatenate(group)
            group, size = [], 0
        seen[corners[own]] = number
        group.append(own)
        size += len(own)
    yield np.concatenate(group)


def _restricted(mesh: FineMesh, members: Int) -> tuple[FineMesh, Int]:
    """Return the coarse triangles `members` (t,) of a mesh as a mesh of its own, and (c,) the classes that it has."""
    nodes, local = present(mesh.nodes[members], len(mesh.points))
    classes, node_class = present(mesh.node_class[nodes], mesh.n_classes)
    own = local.astype(np.int32), node_class.astype(np.int32)
    return FineMesh(mesh.points[nodes], own[0], mesh.curved[members], own[1], len(classes), mesh.lattice), classes


def numbered(comm: MPI.Intracomm, parts: Sequence[UniformPart]) -> list[UniformPart]:
    """Return parts with numbers of their own among those of all ranks.  Collective."""
    first = comm.exscan(len(parts)) or 0
    return [replace(p, submesh=replace(p.submesh, index=first + k)) for k, p in enumerate(parts)]


def share_parts(
    comm: MPI.Intracomm, parts: Sequence[UniformPart], table: SubdomainTable, pairs: Int, lattice: ReferenceLattice
) -> SharedEntities:
    """Return what parts share, as `share_entities` does of subdomains; of these there is the `table`.  Collective."""
    body = np.array([p.submesh.body for p in parts])
    member = np.repeat(np.arange(len(parts)), [len(p.mesh.nodes) for p in parts])
    index, phase = np.array([p.submesh.index for p in parts]), tuple(p.submesh.phase for p in parts)
    own = SubmeshesOfRank(joined_meshes([p.submesh for p in parts]), member, index, body, phase)
    bodies = comm.allgather(body)
    rank = np.repeat(np.arange(comm.size), [len(each) for each in bodies])
    return share_entities(
        comm, own, SubdomainTable(np.concatenate(bodies), rank, table.nesting, table.phase), pairs, lattice
    )


class ForcesBetweenParts:
    """Multipliers of the constraints between parts, by which each is in equilibrium with its displacements."""

    def __init__(self, comm: MPI.Intracomm, parts: Sequence[UniformPart], jumps: JumpOperator) -> None:
        """Assemble the coarse triangles at constraints, of one problem.  Collective."""
        self._jumps, problem = jumps, jumps.problem
        torn, nodes = joined([p.mesh for p in parts]), problem.nodes(np.flatnonzero(jumps.B.getnnz(axis=0)))
        is_shared = np.zeros(torn.n_classes, bool)
        is_shared[nodes] = True
        beside = np.flatnonzero(is_shared[torn.node_class[torn.nodes]].any(axis=1))
        mesh, classes = _restricted(torn, beside)
        law = np.repeat(np.arange(len(parts)), [len(p.mesh.nodes) for p in parts])[beside]
        used, material = np.unique(law, return_inverse=True)
        mixed = tuple(parts[k].is_mixed for k in used)
        found = assemble(mesh, np.stack([parts[k].L for k in used]), problem, mixed, material)
        self._dofs, self._K, self._Q = problem.dofs(classes), found.K, found.Q
        self._inverse = NodeBlocks(comm, jumps, csr_matrix(jumps.B @ jumps.B.T)).inverse(
            np.ones(jumps.owned[1] - jumps.owned[0])
        )

    def multipliers(self, u: Float, loads: Float) -> Float:
        """(owned rows,) lam = (B B^T)^-1 B f, f = -K u - Q E, of displacements u (dofs,) and loads E.  Collective."""
        forces = np.zeros(len(u))
        forces[self._dofs] = -self._K @ u[self._dofs] - self._Q @ loads
        return np.asarray(self._inverse @ self._jumps.sum(self._jumps.B @ forces))
