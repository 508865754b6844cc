"""Cut the coarse mesh into submeshes of subdomains, which ranks refine without communication."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from feti_homog.mesh.coarse_mesh import on_sides
from feti_homog.mesh.periodic_topology import Torus, present
from feti_homog.typing import Array, Bool, Float, Int

# Arrays of `Submesh` that are no index arrays, with one row per triangle, vertex, plane edge, class or torus edge.
ROWS = (
    ("constituent",),
    ("points",),
    ("circles", "turns"),
    ("touching", "class_keys"),
    ("at_void", "debonded", "edge_keys"),
)


@dataclass(frozen=True)
class Submesh:
    """The coarse mesh of a subdomain: v plane vertices, e plane edges and t triangles or, before `halved`, pixels.

    Plane vertices belong to node classes, and plane edges to torus edges. The local numbers of classes and torus edges
    ascend with the global numbers `class_keys` and `edge_keys`.

    Attributes:
        index: number of the subdomain.
        body: constituent that contains the subdomain; 0 for a subdomain across materials.
        phase: name of the material phase; empty for a subdomain across materials.
        constituent: (t,) constituent of each triangle.
        points: (v, 2) positions of the vertices in the plane.
        triangles: (t, 3) vertices, counter-clockwise; (t, 4) for pixels.
        triangle_edges: (t, 3) edge from vertex k to vertex k + 1 (mod 3); (t, 4) for pixels.
        edges: (e, 2) start and end vertices.
        circles: (e, 3) centre and radius of the circle of each edge; radius NaN on ellipses, 0 for straight edges.
        turns: (e,) increment of the ellipse parameter along each edge; 0 for straight edges.
        vertex_class: (v,) class of each vertex.
        edge_class: (e,) torus edge of each plane edge.
        at_void, debonded: (torus edges,) masks of torus edges at voids and debonded from the start, as in `Torus`.
        touching: (classes,) as in `Torus.touching`.
        class_keys, edge_keys: global numbers of classes and torus edges.
        period, origin: (2,) width and height of the cell; its lower left corner in the coordinates of the user.
        pinned: local numbers of the classes that do not move: one class, against translations of the cell, Eq. (15),
            all classes on the cell sides, or none.
        boundary: conditions on the sides, as in `CoarseMesh`.
    """

    index: int
    body: int
    phase: str
    constituent: Int
    points: Float
    triangles: Int
    triangle_edges: Int
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
    origin: Float
    pinned: Int
    boundary: str

    @property
    def backwards(self) -> Bool:
        """The mask (t, 3) of edges that a triangle traverses from the end to the start."""
        return np.asarray(self.edges[self.triangle_edges, 0] != self.triangles)

    @property
    def at_side(self) -> Bool:
        """The mask (torus edges,) of edges on cell sides, for cells without periodic images; else all False."""
        mask = np.zeros(len(self.edge_keys), bool)
        if self.boundary != "periodic":
            mask[self.edge_class] = on_sides(self.points[self.edges], self.period)
        return mask


@dataclass(frozen=True)
class SubdomainTable:
    """The table of all s subdomains, which every rank has.

    Attributes:
        body: (s,) constituent that contains each subdomain; 0 for subdomains across materials.
        rank: (s,) rank of each subdomain.
        nesting: (constituents,) position in the order from the outermost to the innermost, as in `Torus.nesting`.
        phase: (constituents,) number of the material phase.
        across: whether subdomains extend across materials.
    """

    body: Int
    rank: Int
    nesting: Int
    phase: Int
    across: bool = False

    @classmethod
    def of(cls, torus: Torus, subdomain: Int, rank: Int, across: bool = False) -> SubdomainTable:
        """Make the table from the subdomain (m,) of each triangle, 0 to s - 1, and the `rank` (s,) of subdomains."""
        body = np.zeros(subdomain.max() + 1, np.int64)
        body[subdomain] = 0 if across else torus.constituent
        return cls(body, rank, torus.nesting, torus.constituent_phase, across)


@dataclass(frozen=True)
class SubmeshesOfRank:
    """The subdomains of a rank, joined to one submesh; `cut` separates the subdomains.

    Attributes:
        whole: all triangles, or pixels (t, 4), of the rank as one submesh.
        member: (t,) subdomain of each triangle or pixel, numbered from 0 on this rank.
        index, body, phase: attributes of each subdomain, as in `Submesh`.
    """

    whole: Submesh
    member: Int
    index: Int
    body: Int
    phase: tuple[str, ...]

    @property
    def loads(self) -> Int:
        """The load (s,) of each subdomain: its number of coarse triangles or pixels."""
        return np.bincount(self.member, minlength=len(self.index))

    def cut(self) -> list[Submesh]:
        """Cut the triangles or pixels of the rank into one submesh for each subdomain."""
        members = np.split(np.argsort(self.member, kind="stable"), np.cumsum(self.loads))[:-1]
        pieces = [part(self.whole, triangles) for triangles in members]
        table = zip(pieces, self.index.tolist(), self.body.tolist(), self.phase, strict=True)
        return [replace(piece, index=index, body=body, phase=phase) for piece, index, body, phase in table]


def cut_for_ranks(
    torus: Torus, subdomain: Int, table: SubdomainTable, n_ranks: int, pinned: Int
) -> Iterator[SubmeshesOfRank]:
    """Yield the joined subdomains of each rank, in rank order; the mesh of a rank without subdomains is empty.

    `subdomain` (m,) has the subdomain of each triangle, and `pinned` the keys of the pinned classes.
    """
    everything = _whole(torus, pinned)
    for r in range(n_ranks):
        members = np.flatnonzero(table.rank[subdomain] == r)
        index, member = np.unique(subdomain[members], return_inverse=True)
        body = table.body[index]
        phase = tuple("" if table.across else torus.mesh.phases[k] for k in table.phase[body].tolist())
        yield SubmeshesOfRank(part(everything, members), member, index, body, phase)


def cut_bodies(torus: Torus, members: Int) -> Iterator[Submesh]:
    """Yield one submesh, without a pinned class, for each constituent among the triangles `members` (k,)."""
    order = members[np.argsort(torus.constituent[members], kind="stable")]
    ends = np.flatnonzero(np.diff(torus.constituent[order])) + 1
    everything = _whole(torus, np.zeros(0, np.int64))
    for triangles in np.split(order, ends) if len(order) else ():
        yield replace(part(everything, triangles), body=int(torus.constituent[triangles[0]]))


def part(submesh: Submesh, members: Int) -> Submesh:
    """Restrict a submesh to the coarse triangles or pixels `members` (m,), with all their vertices and edges."""
    edges, triangle_edges = present(submesh.triangle_edges[members], len(submesh.edges))
    corners, ends = submesh.triangles[members], submesh.edges[edges]
    vertices, place = present(np.concatenate([corners.ravel(), ends.ravel()]), len(submesh.points))
    classes, vertex_class = present(submesh.vertex_class[vertices], len(submesh.class_keys))
    torus_edges, edge_class = present(submesh.edge_class[edges], len(submesh.edge_keys))
    rows = zip((members, vertices, edges, classes, torus_edges), ROWS, strict=True)
    return replace(
        submesh,
        **{name: getattr(submesh, name)[some] for some, names in rows for name in names},
        triangles=place[: corners.size].reshape(corners.shape),
        triangle_edges=triangle_edges,
        edges=place[corners.size :].reshape(ends.shape),
        vertex_class=vertex_class,
        edge_class=edge_class,
        pinned=np.flatnonzero(np.isin(classes, submesh.pinned)),
    )


def pinned_classes(torus: Torus) -> Int:
    """Return the keys of the pinned classes: one in a periodic cell, all on displaced sides, none with tractions.

    The one class, Eq. (15), lies inside the matrix if possible, nearest to a corner. On an interface, it would join
    both faces; in a fibre, it would hold a fibre without intact bonds.  Its choice only shifts the fluctuation.
    """
    if torus.mesh.boundary != "periodic":
        nodes = on_sides(torus.mesh.points[:, None], torus.mesh.period)
        return np.asarray(torus.node_class[nodes & (torus.mesh.boundary == "displacement")])
    outside = np.zeros(len(torus.class_keys), bool)
    outside[torus.node_class[torus.mesh.triangles[torus.constituent_phase[torus.constituent] > 0]]] = True
    # By preference inside the matrix, else where bodies never part, else inside any body.
    [(_, _, key)] = pinning(torus, np.select([torus.never_part, torus.meeting == 2, outside], [1, 3, 2], 0))
    return np.array([key])


def pinning(torus: Torus, unfit: Int) -> list[tuple[int, float, int]]:
    """Find the class with the least `unfit` (classes,) that is nearest to a cell corner.

    Returns:
        [] without classes, or one triple: `unfit` of the class, its distance from the nearest corner, and its key.
    """
    mesh = torus.mesh
    offset = mesh.points - np.round(mesh.points / mesh.period) * mesh.period
    distance = np.full(len(torus.class_keys), np.inf)
    np.minimum.at(distance, torus.node_class, np.hypot(*offset.T))
    fit = np.flatnonzero(unfit == unfit.min(initial=np.iinfo(unfit.dtype).max))
    best = fit[distance[fit] == distance[fit].min(initial=np.inf)][:1].tolist()
    return [(int(unfit[k]), float(distance[k]), int(torus.class_keys[k])) for k in best]


def _whole(torus: Torus, pinned: Int) -> Submesh:
    """Make one submesh of all triangles; `pinned` has the keys of the pinned classes."""
    mesh = torus.mesh
    return Submesh(
        index=0,
        body=0,
        phase="",
        constituent=torus.constituent,
        triangle_edges=torus.triangle_edges,
        edges=torus.edges,
        at_void=torus.at_void,
        debonded=torus.debonded,
        touching=torus.touching,
        class_keys=torus.class_keys,
        edge_keys=torus.edge_keys,
        points=mesh.points,
        triangles=mesh.triangles.astype(np.int64),
        circles=torus.edge_circles,
        turns=torus.edge_turns,
        vertex_class=torus.node_class,
        edge_class=torus.torus_edge,
        period=mesh.period,
        origin=np.array(mesh.origin),
        pinned=np.flatnonzero(np.isin(torus.class_keys, pinned)),
        boundary=mesh.boundary,
    )


def joined(parts: Sequence[SubmeshesOfRank]) -> SubmeshesOfRank:
    """Join the subdomains of several ranks or tiles, `parts`, in ascending order of `index`."""
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
    """Join submeshes; equal class keys and edge keys become one, but plane vertices and edges stay separate."""
    class_keys, first_class, class_of = np.unique(_all(meshes, "class_keys"), return_index=True, return_inverse=True)
    _, first, edge_of = np.unique(_all(meshes, "edge_keys"), return_index=True, return_inverse=True)
    pinned = np.concatenate([mesh.class_keys[mesh.pinned] for mesh in meshes])
    rows: tuple[Any, ...] = (..., ..., ..., first_class, first)
    return replace(
        meshes[0],
        **{name: _all(meshes, name)[some] for some, names in zip(rows, ROWS, strict=True) for name in names},
        triangles=_numbers(meshes, "triangles", "points"),
        triangle_edges=_numbers(meshes, "triangle_edges", "edges"),
        edges=_numbers(meshes, "edges", "points"),
        vertex_class=class_of[_numbers(meshes, "vertex_class", "class_keys")],
        edge_class=edge_of[_numbers(meshes, "edge_class", "edge_keys")],
        pinned=np.flatnonzero(np.isin(class_keys, pinned)),
    )


def _all(parts: Sequence[object], name: str) -> Array:
    """Concatenate the arrays in the attribute `name` of all parts."""
    return np.concatenate([getattr(part, name) for part in parts])


def _numbers(parts: Sequence[object], name: str, of: str) -> Int:
    """Concatenate the index arrays `name`, each shifted by the total length of the arrays `of` in earlier parts."""
    ends = np.cumsum([0, *(len(getattr(part, of)) for part in parts)])
    return np.concatenate([getattr(part, name) + end for part, end in zip(parts, ends, strict=False)])
