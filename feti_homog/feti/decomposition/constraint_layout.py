"""The layout of the jump operator B on one rank, and the interface nodes, where bonds can break."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import block_diag, helmert
from scipy.sparse import coo_matrix, csr_matrix

from feti_homog.feti.decomposition.shared_entities import SharedEntities, along, side_lengths
from feti_homog.mesh import FineMesh, ReferenceLattice, Submesh, refinement
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Bool, Float, Int


class Meshed(Protocol):
    """A subdomain, or a part of one, with its coarse mesh and its refined mesh."""

    @property
    def submesh(self) -> Submesh: ...

    @property
    def mesh(self) -> FineMesh: ...


@dataclass(frozen=True)
class InterfaceNodes:
    """The k interface nodes whose multipliers this rank owns.

    Attributes:
        row: (k,) first row of the bond among the owned rows: in the plane the normal row, before the tangential row.
        points: (k, 2) position of the fibre's copy, in the coordinates of `Submesh.points`.
        normal: (k, 2) unit normal from the inner to the outer body; the tangent is (-n_y, n_x).
        length: (k,) tributary interface length: traction = nodal force / length.
        fibre: (k,) constituent number of the fibre.
        pair: (k,) number of the interface in the case.
        bodies: (k, 2) outer body and fibre body.
        precracked: (k,) whether the node is debonded in the mesh.
        fibre_node: (k,) local fine node number of the copy in the fibre.
    """

    row: Int
    points: Float
    normal: Float
    length: Float
    fibre: Int
    pair: Int
    bodies: Int
    precracked: Bool
    fibre_node: Int


class ConstraintLayout:
    """The layout of B on one rank: rows and columns of the n shared entities.

    Attributes:
        components: number c of rows of a vector constraint.
        count: (n,) number of rows at an entity.
        first: (n,) first local row at an entity.
        rows: (local rows,) global row numbers.
        dofs: (subdomains + 1,) first local dof of every subdomain, then the number of local dofs.
        owned: half-open range of the global rows that this rank owns.
        base: (sharers,) local number of the sharer's first fine node on the entity; -1 for sharers on other ranks.
    """

    def __init__(
        self, shared: SharedEntities, subdomains: Sequence[Meshed], lattice: ReferenceLattice, components: int
    ) -> None:
        self.shared, self.subdomains, self.lattice = shared, subdomains, lattice
        self.components = components
        begin, end = shared.owned
        self.owned = components * begin, components * end
        # Whether this rank owns the rows of an entity, and the first row of the entity among the owned rows.
        self._is_owned = (shared.first >= begin) & (shared.first < end)
        self._owned_row = components * (shared.first - begin)
        copies = shared.copies
        self.count = components * shared.nodes * (copies - 1)
        self.first = np.cumsum(self.count) - self.count
        self.rows = distributed_arrays.ranges(components * shared.first, self.count)
        self.dofs = np.cumsum([0, *(components * s.mesh.n_classes for s in subdomains)])
        self.base = np.full(len(shared.sharer), -1)
        entity = np.repeat(np.arange(len(shared.key)), copies)
        for subdomain, offset in zip(subdomains, self.dofs // components, strict=False):
            submesh = subdomain.submesh
            mine = np.flatnonzero(shared.sharer == submesh.index)
            key, is_edge = shared.key[entity[mine]], shared.is_edge[entity[mine]]
            place = np.searchsorted(submesh.edge_keys, key)
            edge = refinement.edge_node(len(submesh.class_keys), place, np.ones_like(key), lattice)
            self.base[mine] = offset + np.where(is_edge, edge, np.searchsorted(submesh.class_keys, key))

    def matrix(self) -> csr_matrix:
        """Assemble B (local rows, local dofs)."""
        shared, c = self.shared, self.components
        component, identity = np.arange(c), np.eye(c)
        none = np.zeros(0, np.int64)
        rows, columns, values = [none], [none], [none.astype(float)]
        # Entities with equal codes form a group: their bodies have equal numbers of copies, and all or none of their
        # bonds can break.  Bits mark the first copy of every body, the end of the copies, and breakable bonds.
        entity, copy = expand(np.arange(len(shared.key)), shared.copies)
        codes = np.zeros((len(shared.key), shared.copies.max(initial=0) + 2), bool)
        codes[entity, copy] = (copy == 0) | (np.diff(shared.body, prepend=-1) != 0)
        codes[np.arange(len(codes)), shared.copies], codes[:, -1] = True, shared.fibre >= 0
        codes, group = np.unique(codes, axis=0, return_inverse=True)
        for number, code in enumerate(codes):
            # (k - 1, k) orthonormal contrasts between the copies in each of two bodies, and between the body means.
            # One body, or more than two bodies, cannot part and count as one body.
            sizes = np.diff(np.flatnonzero(code[:-1]))
            k = int(sizes.sum())
            contrasts = helmert(k)
            if len(sizes) == 2:
                contrasts = np.vstack([block_diag(*map(helmert, sizes)), np.repeat([1.0, -1.0] / sizes, sizes)])
            members = np.flatnonzero(group.ravel() == number)
            entity, p = expand(members, shared.nodes[members])
            first, frame = self.first[entity] + p * c * (k - 1), np.tile(identity, (len(entity), 1, 1))
            if code[-1] and c == 2:
                n = self._normals(entity, p)
                frame = np.stack([n, np.stack([-n[:, 1], n[:, 0]], axis=1)], axis=1)
            for r, j in np.argwhere(contrasts):
                base = self.base[shared.pointer[entity] + j]
                local = base >= 0
                dof = (c * (base + p)[local])[:, None, None] + component
                row = (first[local] + c * r)[:, None, None] + component[:, None]
                block = contrasts[r, j] * (frame[local] if r == k - 2 else identity)
                for entries, part in ((rows, row), (columns, dof), (values, block)):
                    entries.append(np.broadcast_to(part, (len(dof), c, c)).ravel())
        parts = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        return coo_matrix(parts, shape=(len(self.rows), self.dofs[-1])).tocsr()

    def _places(self, entity: Int, p: Int) -> Float:
        """Compute positions s (i,) in [0, 1] of fine nodes p (i,) along edges `entity` (i,); 0 at vertices."""
        return np.where(self.shared.is_edge[entity], (p + 1) / self.lattice.intervals, 0.0)

    def _normals(self, entity: Int, p: Int) -> Float:
        """Compute unit normals (i, 2) of interfaces at fine nodes p (i,) of entities `entity` (i,)."""
        shared = self.shared
        normal = along(shared.normal[entity], shared.turn[entity], self._places(entity, p))
        return np.asarray(normal / np.hypot(*normal.T)[:, None])

    def node_rows(self) -> tuple[Int, Int]:
        """Return the first row (position among owned rows) and row count of every owned fine node, both (nodes,)."""
        shared = self.shared
        mine = np.flatnonzero(self._is_owned)
        size = self.components * (shared.copies[mine] - 1)
        entity, p = expand(np.arange(len(mine)), shared.nodes[mine])
        return self._owned_row[mine][entity] + p * size[entity], size[entity]

    def interface_nodes(self) -> InterfaceNodes:
        """Collect the interface nodes whose rows this rank owns."""
        shared = self.shared
        breakable = np.flatnonzero(self._is_owned & (shared.fibre >= 0))
        entity, p = expand(breakable, shared.nodes[breakable])
        k = shared.copies[entity]
        positions = np.zeros((self.dofs[-1] // self.components, 2))
        for offset, mesh in zip(self.dofs // self.components, (s.mesh for s in self.subdomains), strict=False):
            positions[offset + mesh.node_class] = mesh.points
        # Sharers are sorted inwards: the last sharer belongs to the fibre, and to this rank, which owns the rows.
        copy = self.base[shared.pointer[entity + 1] - 1] + p
        # The length of a node is int N ds along the curve on both sides; half of both sides for linear elements.
        normal, turn, place = shared.normal[entity], shared.turn[entity], self._places(entity, p)
        order = self.lattice.order
        side = order / self.lattice.intervals
        before, after = (side_lengths(normal, turn, start, order, side) for start in (place - side, place))
        around = side_lengths(normal, turn, place - side / 2, order, side)
        in_middle = shared.is_edge[entity] & (p % 2 == 0) & (order == 2)
        on_edge = np.where(in_middle, around[:, 1], before[:, -1] + after[:, 0])
        return InterfaceNodes(
            row=self._owned_row[entity] + self.components * ((p + 1) * (k - 1) - 1),
            points=positions[copy],
            normal=self._normals(entity, p),
            length=np.where(shared.is_edge[entity], on_edge, np.hypot(*normal[:, 0].T)),
            fibre=shared.fibre[entity],
            pair=shared.pair[entity],
            bodies=shared.body[np.stack([shared.pointer[entity], shared.pointer[entity + 1] - 1], axis=1)],
            precracked=shared.precracked[entity],
            fibre_node=copy,
        )

    def facing(self) -> tuple[Int, Int]:
        """Count the node copies in the outer and the inner body at every row that connects two bodies.

        Returns:
            (local rows, 2) copies in the outer and the inner body, and (local rows,) number of the inner body; rows
            that do not connect two bodies have 0 copies and body -1.
        """
        shared = self.shared
        entity = np.repeat(np.arange(len(shared.key)), shared.copies)
        # Sharers are sorted inwards: the first sharer belongs to the outer body.
        outer, inner = shared.body[shared.pointer[:-1]], shared.body[shared.pointer[1:] - 1]
        of_outer = np.bincount(entity[shared.body == outer[entity]], minlength=len(outer))
        of_inner = np.bincount(entity[shared.body == inner[entity]], minlength=len(inner))
        two = np.flatnonzero((outer != inner) & (of_outer + of_inner == shared.copies))
        e, p = expand(two, shared.nodes[two])
        row = self.first[e] + self.components * ((p + 1) * (shared.copies[e] - 1) - 1)
        copies, inside = np.zeros((len(self.rows), 2), np.int64), np.full(len(self.rows), -1)
        for component in range(self.components):
            copies[row + component] = np.stack([of_outer[e], of_inner[e]], axis=1)
            inside[row + component] = inner[e]
        return copies, inside

    def outer_copies(self) -> tuple[Int, Int]:
        """Find the m interface nodes whose first copy is on this rank; the first copy is in the outer body.

        Returns the first local row (m,) of each bond, and the local node number (m,) of each first copy.
        """
        shared = self.shared
        first = self.base[shared.pointer[:-1]]
        local = np.flatnonzero((shared.fibre >= 0) & (first >= 0))
        entity, p = expand(local, shared.nodes[local])
        return self.first[entity] + self.components * ((p + 1) * (shared.copies[entity] - 1) - 1), first[entity] + p


def expand(entities: Int, nodes: Int) -> tuple[Int, Int]:
    """Return the entity and position p of all fine nodes, for entities (e,) with `nodes` (e,) fine nodes each."""
    return np.repeat(entities, nodes), distributed_arrays.ranges(np.zeros_like(nodes), nodes)
