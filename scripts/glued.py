"""Glue the bonded cell together again for solvers of one global matrix: distributed, periodic, pinned.

A fine node on the torus is a vertex class, a place on a torus edge, or a place inside a coarse triangle, so coarse
numbers alone give its number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from feti_homog.fem.problem import Problem
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.typing import Float, Int

ADD = PETSc.InsertMode.ADD_VALUES


@dataclass(frozen=True)
class Nodes:
    """The n nodes of this rank on the torus.

    Attributes:
        local: for each subdomain, (c,) number on this rank of each of its classes.
        number: (n,) global number; the numbers that a rank owns are contiguous.
        owned: (n,) whether this rank owns it.
    """

    local: list[Int]
    number: Int
    owned: NDArray[np.bool_]

    @classmethod
    def of(cls, comm: MPI.Intracomm, subdomains: list[Subdomain], lattice: ReferenceLattice) -> Nodes:
        """Assign numbers to the nodes; the lowest rank that holds a node owns it.  Collective."""
        keys, several = _keys(comm, subdomains, lattice)
        sizes = np.cumsum([len(k) for k in keys])[:-1]
        unique, first, which = np.unique(np.concatenate(keys), return_index=True, return_inverse=True)
        # In the order in which the subdomains come, so that numbers near each other are so in place.
        order = np.argsort(first)
        place = np.empty_like(order)
        place[order] = np.arange(len(order))
        held = unique[order]
        owner = np.full(several, comm.size)
        owner[held[held < several]] = comm.rank
        comm.Allreduce(MPI.IN_PLACE, owner, MPI.MIN)
        owned = held >= several
        owned[~owned] = owner[held[~owned]] == comm.rank
        end = comm.scan(int(owned.sum()))
        number = np.full(len(held), -1)
        number[owned] = np.arange(end - owned.sum(), end)
        shared_number = np.full(several, -1)
        shared_number[held[held < several]] = number[held < several]
        comm.Allreduce(MPI.IN_PLACE, shared_number, MPI.MAX)
        number[~owned] = shared_number[held[~owned]]
        return cls(np.split(place[which], sizes), number, owned)


def _keys(comm: MPI.Intracomm, subdomains: list[Subdomain], lattice: ReferenceLattice) -> tuple[list[Int], int]:
    """Return a key for each class of each subdomain, and the first key that is not shared.

    A node has the same key in all subdomains.
    """
    inner = lattice.intervals - 1
    inside = [s.mesh.n_classes - len(s.submesh.class_keys) - len(s.submesh.edge_keys) * inner for s in subdomains]
    classes, edges = (
        np.unique(np.concatenate(comm.allgather(np.unique(np.concatenate(own)))))
        for own in ([s.submesh.class_keys for s in subdomains], [s.submesh.edge_keys for s in subdomains])
    )
    several = len(classes) + len(edges) * inner
    ends = several + comm.scan(sum(inside)) - sum(inside) + np.cumsum(inside)
    keys = [
        np.concatenate(
            [
                np.searchsorted(classes, s.submesh.class_keys),
                (
                    len(classes) + np.searchsorted(edges, s.submesh.edge_keys)[:, None] * inner + np.arange(inner)
                ).ravel(),
                np.arange(end - count, end),
            ]
        )
        for s, count, end in zip(subdomains, inside, ends, strict=True)
    ]
    return keys, several


@dataclass(frozen=True)
class Glued:
    """The system A u = -Q E on all ranks; the diagonal of A holds the pinned class.

    Attributes:
        A: MATIS, with the sum of a rank's subdomains as its local matrix.
        Q: a vector for each of the v unit loads.
        stiffness: (v, v) sum |Omega_s| L_s of all subdomains.
        points: (owned nodes, 2) where they are in the plane.
        problem: the displacements and the unit loads.
    """

    A: PETSc.Mat
    Q: list[PETSc.Vec]
    stiffness: Float
    points: Float
    problem: Problem

    def rigid(self) -> PETSc.NullSpace:
        """Return the orthonormal translations and, in the plane, a rotation, which jumps at the cell's sides.

        Orthonormal.
        """
        values = [np.tile(translation, (len(self.points), 1)) for translation in np.eye(self.problem.components)]
        if self.problem.turns:
            values.append((self.points - 0.5) @ np.array([[0.0, 1.0], [-1.0, 0.0]]))
        modes = [self.A.createVecLeft() for _ in values]
        for mode, own in zip(modes, values, strict=True):
            mode.setArray(own.ravel())
        for i, mode in enumerate(modes):
            for before in modes[:i]:
                mode.axpy(-before.dot(mode), before)
            mode.normalize()
        return PETSc.NullSpace().create(vectors=modes, comm=self.A.comm)

    def stress(self, u: PETSc.Vec) -> Float:
        """Return int sigma (v,) of the fluctuation alone, without `stiffness` times the unit load."""
        return np.array([q.dot(u) for q in self.Q])


def glue(comm: MPI.Intracomm, subdomains: list[Subdomain], nodes: Nodes) -> Glued:
    """Glue the subdomains; take them from the list one by one to save memory.  Collective."""
    problem, n = subdomains[0].problem, len(nodes.number)
    c, loads = problem.components, range(len(problem.loads))
    entries, Q, x = np.zeros(c * n, np.int32), np.zeros((c * n, len(loads))), np.zeros((n, 2))
    stiffness = np.asarray(comm.allreduce(sum(s.area * s.L for s in subdomains)))
    matrices = [s.take_stiffness() for s in subdomains]
    dofs = [problem.dofs(local).astype(np.int32) for local in nodes.local]
    for s, matrix, local, own in zip(subdomains, matrices, nodes.local, dofs, strict=True):
        entries[own] += np.diff(matrix.indptr)
        Q[own] += s.Q
        x[local[s.mesh.node_class]] = s.mesh.points
    K = PETSc.Mat().createAIJ((c * n, c * n), nnz=entries, comm=PETSc.COMM_SELF)
    K.setBlockSize(c)
    while subdomains:
        subdomains.pop()
        matrix, own = matrices.pop(), dofs.pop()
        K.setValuesIJV(matrix.indptr, own[matrix.indices], matrix.data, ADD, own)
    K.assemble()
    lgmap = PETSc.LGMap().create(nodes.number.astype(np.int32), c, comm)
    size = (c * int(nodes.owned.sum()), None)
    A = PETSc.Mat().create(comm)
    A.setSizes((size, size), c)
    A.setType(PETSc.Mat.Type.IS)
    A.setLGMap(lgmap, lgmap)
    A.setISLocalMat(K)
    A.assemble()
    A.setOption(PETSc.Mat.Option.SPD, True)
    vectors = [A.createVecLeft() for _ in loads]
    for vector, q in zip(vectors, Q.T, strict=True):
        vector.setValuesBlocked(nodes.number.astype(np.int32), q, ADD)
        vector.assemble()
    return Glued(A, vectors, stiffness, x[nodes.owned], problem)
