"""Cut the coarse mesh into subdomains, with all data that a rank needs to refine them by itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from feti_homog.mesh.periodic_topology import Torus, present
from feti_homog.typing import Array, Bool, Float, Int


@dataclass(frozen=True)
class Submesh:
    """One subdomain: v plane vertices, e plane edges, t coarse triangles.

    A plane vertex belongs to a class, a plane edge to a torus edge; both are numbered locally, in
    ascending order of their global numbers `class_keys` and `edge_keys`.

    Attributes:
        index: the subdomain's number.
        body: constituent that it is a piece of; 0 for a piece across materials.
        phase: name of its material phase; empty for a piece across materials.
        constituent: (t,) that each triangle is in.
        points: (v, 2) vertices, in plane position.
        triangles: (t, 3) vertices, counter-clockwise.
        triangle_edges: (t, 3) edge from vertex k to vertex k + 1 (mod 3).
        backwards: (t, 3) true where the triangle runs along the edge against its direction.
        edges: (e, 2) vertices from start to end.
        circles: (e, 3) centre and radius of the circle that the edge lies on; radius NaN on ellipses, 0 if straight.
        turns: (e,) how far the parameter turns on it along the edge; 0 where the edge is straight.
        vertex_class: (v,) class by vertex.
        edge_class: (e,) torus edge by edge.
        at_void: (torus edges,) whether only one triangle in the whole cell has it, beside a void.
        debonded: (torus edges,) whether it is from the start.
        touching: (classes,) as `Torus.touching`.
        class_keys, edge_keys: global numbers for classes and torus edges.
        period: (2,) width and height.
        pinned: local class that is pinned against translating the whole cell, Eq. (15), or -1.
    """

    index: int
    body: int
    phase: str
    constituent: Int
    points: Float
    triangles: Int
    triangle_edges: Int
    backwards: Bool
    edges: Int
    circles: Float
    turns: Float
    vertex_class: Int
    edge_class: Int
    at_void: Bool
    debonded: Bool
    touching: Bool
    class_keys: Int
    edge_keys: Int
    period: Float
    pinned: int


@dataclass(frozen=True)
class SubdomainTable:
    """All s subdomains, known to every rank.

    Attributes:
        body: (s,) constituent that each is a piece of; 0 for pieces across materials.
        rank: (s,) that has it.
        nesting: (constituents,) places from the outermost to the innermost, as `Torus.nesting`.
        phase: (constituents,) number of its material phase.
        across: whether pieces are across materials.
    """

    body: Int
    rank: Int
    nesting: Int
    phase: Int
    across: bool = False

    @classmethod
    def of(cls, torus: Torus, subdomain: Int, rank: Int, across: bool = False) -> SubdomainTable:
        """Make the table for a whole cell whose triangles are in subdomains (m,), numbered from 0 without gaps."""
        first = np.unique(subdomain, return_index=True)[1]
        body = np.zeros(len(first), np.int64) if across else torus.constituent[first]
        return cls(body, rank, torus.nesting, torus.constituent_phase, across)


@dataclass(frozen=True)
class SubmeshesOfRank:
    """One rank's subdomains before it cuts them apart.

    Attributes:
        whole: all their triangles as one submesh.
        member: (t,) subdomain that each triangle is in.
        index, body, phase: by subdomain, as in `Submesh`.
    """

    whole: Submesh
    member: Int
    index: Int
    body: Int
    phase: tuple[str, ...]

    @property
    def loads(self) -> Int:
        """Number of coarse triangles in each subdomain."""
        return np.bincount(self.member, minlength=len(self.index))

    def cut(self) -> list[Submesh]:
        """Cut the subdomains apart."""
        order = np.argsort(self.member, kind="stable")
        members = np.split(order, np.cumsum(self.loads))[:-1]
        pieces = [part(self.whole, triangles) for triangles in members]
        rank = zip(pieces, self.index.tolist(), self.body.tolist(), self.phase, strict=True)
        return [replace(piece, index=index, body=body, phase=phase) for piece, index, body, phase in rank]


def cut_for_ranks(
    torus: Torus, subdomain: Int, table: SubdomainTable, n_ranks: int, pinned: int
) -> Iterator[SubmeshesOfRank]:
    """Yield the submeshes of each rank; `subdomain` (m,) is the subdomain of each triangle.

    `pinned` is the key of the pinned class.
    """
    everything = _whole(torus, pinned)
    for r in range(n_ranks):
        members = np.flatnonzero(table.rank[subdomain] == r)
        index, member = np.unique(subdomain[members], return_inverse=True)
        body = table.body[index]
        phase = tuple("" if table.across else torus.mesh.phases[k] for k in table.phase[body].tolist())
        yield SubmeshesOfRank(part(everything, members), member, index, body, phase)


def cut_bodies(torus: Torus, members: Int) -> Iterator[Submesh]:
    """Yield the triangles `members` (m,) as one submesh per constituent; none is pinned."""
    order = members[np.argsort(torus.constituent[members], kind="stable")]
    ends = np.flatnonzero(np.diff(torus.constituent[order])) + 1
    everything = _whole(torus, -1)
    for some in np.split(order, ends) if len(order) else ():
        yield replace(part(everything, some), body=int(torus.constituent[some[0]]))


def part(submesh: Submesh, members: Int) -> Submesh:
    """Restrict a submesh to the coarse triangles `members` (m,)."""
    vertices, triangles = present(submesh.triangles[members], len(submesh.points))
    edges, triangle_edges = present(submesh.triangle_edges[members], len(submesh.edges))
    classes, vertex_class = present(submesh.vertex_class[vertices], len(submesh.class_keys))
    torus_edges, edge_class = present(submesh.edge_class[edges], len(submesh.edge_keys))
    pinned_here = np.flatnonzero(classes == submesh.pinned)
    return replace(
        submesh,
        constituent=submesh.constituent[members],
        points=submesh.points[vertices],
        triangles=triangles,
        triangle_edges=triangle_edges,
        backwards=submesh.backwards[members],
        edges=np.searchsorted(vertices, submesh.edges[edges]),
        circles=submesh.circles[edges],
        turns=submesh.turns[edges],
        vertex_class=vertex_class,
        edge_class=edge_class,
        at_void=submesh.at_void[torus_edges],
        debonded=submesh.debonded[torus_edges],
        touching=submesh.touching[classes],
        class_keys=submesh.class_keys[classes],
        edge_keys=submesh.edge_keys[torus_edges],
        pinned=int(pinned_here[0]) if len(pinned_here) else -1,
    )


def pinned_class(torus: Torus) -> int:
    """Return the pinned class, Eq. (15): inside the matrix, nearest to the cell's corner.

    A pinned class on an interface would hold faces together that must be able to part, and one in a fibre would keep
    that from moving when all of its bonds are broken.  u* is the same up to a constant.
    """
    outside = np.zeros(len(torus.class_keys), bool)
    outside[torus.node_class[torus.mesh.triangles[torus.constituent_phase[torus.constituent] > 0]]] = True
    # By preference inside the matrix, else where bodies never part, else inside any body.
    ((*_, key),) = pinning(torus, np.select([torus.never_part, torus.meeting == 2, outside], [1, 3, 2], 0))
    return key


def pinning(torus: Torus, unfit: Int) -> list[tuple[int, float, int]]:
    """Find the class that is best pinned: its unfitness, its distance from the cell's corner, its key.

    The least triple is best; `unfit` (classes,) is larger for classes that are less fit. Nothing without classes.
    """
    mesh = torus.mesh
    away = mesh.points - np.round(mesh.points / mesh.period) * mesh.period
    distance = np.full(len(torus.class_keys), np.inf)
    np.minimum.at(distance, torus.node_class, np.hypot(*away.T))
    best = np.lexsort((distance, unfit))[:1].tolist()
    return [(int(unfit[k]), float(distance[k]), int(torus.class_keys[k])) for k in best]


def _whole(torus: Torus, pinned: int) -> Submesh:
    """Make one submesh of all triangles, without body and phase; `pinned` is the pinned class key."""
    mesh = torus.mesh
    pinned_here = np.flatnonzero(torus.class_keys == pinned)
    return Submesh(
        index=0,
        body=0,
        phase="",
        constituent=torus.constituent,
        points=mesh.points,
        triangles=mesh.triangles.astype(np.int64),
        triangle_edges=torus.triangle_edges,
        backwards=torus.edges[torus.triangle_edges, 0] != mesh.triangles,
        edges=torus.edges,
        circles=torus.edge_circles,
        turns=torus.edge_turns,
        vertex_class=torus.node_class,
        edge_class=torus.torus_edge,
        at_void=torus.at_void,
        debonded=torus.debonded,
        touching=torus.touching,
        class_keys=torus.class_keys,
        edge_keys=torus.edge_keys,
        period=mesh.period,
        pinned=int(pinned_here[0]) if len(pinned_here) else -1,
    )


def joined(parts: Sequence[SubmeshesOfRank]) -> SubmeshesOfRank:
    """Join the subdomains of all parts, in ascending order."""
    index = _all(parts, "index")
    order = np.argsort(index)
    phase = [name for part in parts for name in part.phase]
    return SubmeshesOfRank(
        whole=joined_meshes([part.whole for part in parts]),
        member=np.argsort(order)[_numbers(parts, "member", "index")],
        index=index[order],
        body=_all(parts, "body")[order],
        phase=tuple(phase[k] for k in order.tolist()),
    )


def joined_meshes(meshes: list[Submesh]) -> Submesh:
    """Join all triangles; classes and torus edges are identified, plane vertices and edges are not."""
    class_keys, first_class, class_of = np.unique(_all(meshes, "class_keys"), return_index=True, return_inverse=True)
    edge_keys, first, edge_of = np.unique(_all(meshes, "edge_keys"), return_index=True, return_inverse=True)
    pinned = [np.searchsorted(class_keys, mesh.class_keys[mesh.pinned]) for mesh in meshes if mesh.pinned >= 0]
    return replace(
        meshes[0],
        constituent=_all(meshes, "constituent"),
        points=_all(meshes, "points"),
        triangles=_numbers(meshes, "triangles", "points"),
        triangle_edges=_numbers(meshes, "triangle_edges", "edges"),
        backwards=_all(meshes, "backwards"),
        edges=_numbers(meshes, "edges", "points"),
        circles=_all(meshes, "circles"),
        turns=_all(meshes, "turns"),
        vertex_class=class_of[_numbers(meshes, "vertex_class", "class_keys")],
        edge_class=edge_of[_numbers(meshes, "edge_class", "edge_keys")],
        at_void=_all(meshes, "at_void")[first],
        debonded=_all(meshes, "debonded")[first],
        touching=_all(meshes, "touching")[first_class],
        class_keys=class_keys,
        edge_keys=edge_keys,
        pinned=int(pinned[0]) if pinned else -1,
    )


def _all(parts: Sequence[object], name: str) -> Array:
    """Concatenate the arrays `name` of all parts."""
    return np.concatenate([getattr(part, name) for part in parts])


def _numbers(parts: Sequence[object], name: str, of: str) -> Int:
    """Concatenate index arrays, shifted by the number of `of` entries before."""
    ends = np.cumsum([0, *(len(getattr(part, of)) for part in parts)])
    return np.concatenate([getattr(part, name) + end for part, end in zip(parts, ends, strict=False)])
