"""Displacements inside bodies on a mesh that is refined less, from those of the boundaries.

Its nodes are among those of the mesh, and it has a quarter or a sixteenth of the elements.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from feti_homog.fem.assembly import assemble
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.operators.one_subdomain import Interior
from feti_homog.homogenization.uniform_parts import UniformPart
from feti_homog.mesh.refinement import FineMesh, ReferenceLattice, joined, refine
from feti_homog.typing import Float, Int

# Subdomains of so many elements at once: few enough for the processor's cache, many enough for NumPy.
ELEMENTS_AT_ONCE = 1 << 13
# Halvings from which on the mesh that is refined twice less serves.
REFINED_OFTEN = 3
# Largest lambda / mu there, of a Poisson's ratio of 0.4: beyond, errors of coarse elements are no guide.
LOCKING = 4.0
# What is not on a boundary.
INSIDE, PINNED = -2, -1


@dataclass(frozen=True)
class NestedInterior:
    """The coarser meshes of some subdomains of one phase, c displacements a node.

    Attributes:
        members: the subdomains.
        mesh: of all of them, one after the other.
        known: (c n,) displacements that are given: on the boundary, and 0 where a class is pinned.
        place: (known,) of each among those of all boundaries, -1 of what is pinned.
        interior: the others.
        loads: (others, v) forces Q of the unit loads on these; none but beside voids.
    """

    members: list[Subdomain]
    mesh: FineMesh
    known: Int
    place: Int
    interior: Interior
    loads: Float | None

    @classmethod
    def of(
        cls, places: Sequence[int], boundary: InterfaceOperators, lattice: ReferenceLattice, nested: Int
    ) -> NestedInterior:
        """Refine, assemble and factor; `nested` are the nodes of the lattice among those of the finer one."""
        members = [boundary.subdomains[place] for place in places]
        first, meshes = members[0], [refine(s.submesh, lattice) for s in members]
        numbers = [_boundary(s, mesh, boundary, k, nested) for k, s, mesh in zip(places, members, meshes, strict=True)]
        place = np.concatenate(numbers)
        known = np.flatnonzero(place != INSIDE)
        mesh = joined(meshes)
        body = assemble(mesh, first.L, first.problem, first.is_mixed)
        interior = Interior(body.K, known)
        loads = body.Q[interior.dofs] if any(s.submesh.at_void.any() for s in members) else None
        return cls(members, mesh, known, place[known], interior, loads)

    def displacement(self, u: Float, loads: Float) -> Float:
        """(classes, c, k) u* of u (boundary dofs, k) on all boundaries under the loads (v, k)."""
        problem = self.members[0].problem
        on_boundary = np.vstack([u, np.zeros((1, u.shape[1]))])[self.place]  # PINNED is the last row
        found = np.empty((len(self.known) + len(self.interior.dofs), u.shape[1]))
        found[self.known], found[self.interior.dofs] = on_boundary, self.interior.extend(on_boundary)
        if self.loads is not None:
            found[self.interior.dofs] -= self.interior.solve(self.loads @ loads)
        return found.reshape(-1, problem.components, u.shape[1])


def locks(subdomains: Sequence[Subdomain | UniformPart], comm: MPI.Intracomm) -> bool:
    """Return whether linear elements of a phase of any rank hardly change their volume.  Collective."""
    own = any(s.problem.components == 2 and s.L[0, 1] > LOCKING * s.L[2, 2] for s in subdomains)
    return bool(comm.allreduce(own, MPI.LOR))


def nested_lattice(
    lattice: ReferenceLattice, subdomains: Sequence[Subdomain], comm: MPI.Intracomm, across: bool
) -> ReferenceLattice:
    """Return the lattice of the coarser mesh: refined once less, or twice where that is often and no phase locks.

    Of the subdomains of all ranks; not twice if they reach across materials.  Collective.
    """
    often = not locks(subdomains, comm) and lattice.halvings >= REFINED_OFTEN and not across
    return lattice.coarser(2 if often else 1)


def nested_interiors(
    boundary: InterfaceOperators, lattice: ReferenceLattice, coarser: ReferenceLattice
) -> Iterator[NestedInterior]:
    """Yield those of this rank's subdomains, which the lattice refines, on the coarser one, some at a time."""
    nested = coarser.within(lattice)
    for group in groups(boundary.subdomains, coarser):
        yield NestedInterior.of(group, boundary, coarser, nested)


def groups(subdomains: Sequence[Subdomain | UniformPart], lattice: ReferenceLattice) -> Iterator[list[int]]:
    """Yield the places of subdomains that follow each other, of one phase, and of ELEMENTS_AT_ONCE elements at most."""
    group, elements = list[int](), 0
    for place, s in enumerate(subdomains):
        own = len(s.mesh.nodes) * len(lattice.triangles)
        elements += own
        if group and (elements > ELEMENTS_AT_ONCE or s.submesh.phase != subdomains[group[0]].submesh.phase):
            yield group
            group, elements = [], own
        group.append(place)
    if group:
        yield group


def _boundary(s: Subdomain, mesh: FineMesh, boundary: InterfaceOperators, k: int, nested: Int) -> Int:
    """(c n,) places of a coarser mesh's displacements among those of all boundaries, or what else these are."""
    of_fine = np.full(s.n_dofs, INSIDE)
    of_fine[boundary.dofs[k]] = boundary.offsets[k] + np.arange(len(boundary.dofs[k]))
    if s.submesh.pinned >= 0:
        of_fine[s.problem.dofs(np.array([s.submesh.pinned]))] = PINNED
    fine = np.empty(mesh.n_classes, np.int64)
    fine[mesh.node_class[mesh.nodes]] = s.mesh.node_class[s.mesh.nodes[:, nested]]
    return of_fine[s.problem.dofs(fine)]
