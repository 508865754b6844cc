"""Coarse vertices and edges that subdomains share: constraint numbers, normals and lengths of interfaces.

An entity is a vertex class or torus edge in several subdomains, its sharers.  A fine node on an entity with k sharers
needs k - 1 vector constraints.  The rank of the last sharer owns the entity: it numbers the constraints and sends the
numbers to the ranks of the other sharers.
"""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy.special import roots_legendre

from feti_homog.errors import MeshError
from feti_homog.feti.decomposition.sharers import Sharers, entity_code, find_sharers
from feti_homog.feti.thresholds import ZERO_TOLERANCE
from feti_homog.mesh import ReferenceLattice, Submesh, SubmeshesOfRank, submeshes
from feti_homog.system.parallel import distributed_arrays, mpi_errors
from feti_homog.typing import Array, Bool, Float, Int

# Gauss points on one side of an element, enough for the arcs of a valid mesh.
POINTS, WEIGHTS = roots_legendre(6)
# (p + 1, points) shares of the nodes of a side of order p at the Gauss points: 1/2 if linear, N_a if quadratic.
SHARES = {1: np.full((2, 6), 0.5), 2: np.stack([POINTS**2 - POINTS, 2 - 2 * POINTS**2, POINTS**2 + POINTS]) / 2}


def along(ends: Float, turn: Float, place: Float) -> Float:
    """Interpolate y (k, 2) at s = `place` (k,) in [0, 1] from its values `ends` (k, 2, 2) at s = 0 and s = 1.

    y is dx / ds, or a normal with the length |dx / ds|.  On an arc of an ellipse, with the increment `turn` (k,) of the
    parametric angle, y'' = -turn^2 y; on straight edges `turn` is 0, and y is linear.
    """
    sine = np.where(turn > 0, np.sin(turn), 1.0)
    of_start = np.where(turn > 0, np.sin((1 - place) * turn), 1 - place) / sine
    of_stop = np.where(turn > 0, np.sin(place * turn), place) / sine
    return np.asarray(of_start[:, None] * ends[:, 0] + of_stop[:, None] * ends[:, 1])


def side_lengths(ends: Float, turn: Float, low: Float, order: int, side: float) -> Float:
    """Compute tributary lengths (k, order + 1) of nodes on sides from s = `low` (k,) to `low` + `side`; see `along`."""
    places = low[:, None] + side * (1 + POINTS) / 2
    speeds = [np.hypot(*along(ends, turn, place).T) for place in places.T]
    return np.asarray(np.stack(speeds, axis=1) * WEIGHTS @ SHARES[order].T * (side / 2))


def breakable_pairs(meshes: SubmeshesOfRank, table: submeshes.SubdomainTable, pairs: Int, sharers: Sharers) -> Int:
    """Return the numbers `SharedEntities.pair` (n,) of all shared entities; `pairs` is as in `share_entities`.

    The number is -1 where bonds never break, where a third body touches, and where two bodies meet in a point.
    """
    body, copies = table.body[sharers.sharer], sharers.copies
    outer, inner = body[sharers.pointer[:-1]], body[sharers.pointer[1:] - 1]
    third = (body != np.repeat(outer, copies)) & (body != np.repeat(inner, copies))
    thirds = np.bincount(np.repeat(np.arange(len(copies)), copies), third, len(copies))
    on_line, vertices = np.ones(len(copies), bool), np.flatnonzero(~sharers.is_edge)
    on_line[vertices] = ~meshes.whole.touching[np.searchsorted(meshes.whole.class_keys, sharers.key[vertices])]
    phase = table.phase
    return np.where((thirds == 0) & (outer != inner) & on_line, pairs[phase[outer], phase[inner]], -1)


def interface_geometry(
    comm: MPI.Intracomm,
    meshes: SubmeshesOfRank,
    table: submeshes.SubdomainTable,
    pairs: Int,
    sharers: Sharers,
    lattice: ReferenceLattice,
) -> tuple[Float, Float, Bool]:
    """Compute normal, turn and precracked of `SharedEntities` on owned entities.  Collective.

    Values elsewhere, or where no bond can break, have no meaning.  Arguments and MeshError are as in `share_entities`.
    """
    n, owner = len(sharers.key), table.rank[sharers.innermost]
    can_part = (owner == comm.rank) & (breakable_pairs(meshes, table, pairs, sharers) >= 0)
    # The last sharer of an edge between two bodies is a piece of the fibre.
    edges = np.flatnonzero(sharers.is_edge & can_part)
    mesh = meshes.whole
    edge = np.searchsorted(mesh.edge_keys, sharers.key[edges])
    subdomain_of = np.full(len(mesh.edge_keys), -1)
    subdomain_of[edge] = sharers.innermost[edges]
    sides = mesh.edge_class[mesh.triangle_edges]
    triangle, k = np.nonzero(subdomain_of[sides] == meshes.index[meshes.member][:, None])
    by_edge = np.argsort(sides[triangle, k])
    place = by_edge[np.searchsorted(sides[triangle, k][by_edge], edge)]
    triangle, k = triangle[place], k[place]
    plane = mesh.triangle_edges[triangle, k]
    normals, turns, precracked = np.zeros((n, 2, 2)), np.zeros(n), np.zeros(n, bool)
    normal, turn = edge_normals(mesh, triangle, k)
    normals[edges], turns[edges] = normal, turn
    precracked[edges] = mesh.debonded[mesh.edge_class[plane]]
    ends = mesh.class_keys[mesh.vertex_class[mesh.edges[plane]]]
    order, side = lattice.order, lattice.order / lattice.intervals
    first = side_lengths(normal, turn, np.zeros(len(edges)), order, side)[:, 0]
    last = side_lengths(normal, turn, np.full(len(edges), 1.0 - side), order, side)[:, -1]
    length = np.stack([first, last], axis=1)
    unit = normal / np.maximum(np.linalg.norm(normal, axis=2), 1e-300)[..., None]
    bonded = np.broadcast_to(~precracked[edges, None], length.shape)
    parts = np.concatenate([unit * length[..., None], length[..., None], bonded[..., None]], axis=2)
    sums = _sums_at_vertices(comm, sharers, owner, ends, sharers.key[edges], parts)
    vertices = ~sharers.is_edge
    scaled = sums[:, :2] * (sums[:, 2] / np.maximum(np.hypot(*sums[:, :2].T), 1e-300))[:, None]
    normals[vertices], precracked[vertices] = scaled[vertices, None], sums[vertices, 3] == 0
    mpi_errors.agree(comm, _check, meshes, sharers.chosen(np.flatnonzero(can_part)), normals[can_part], sums[can_part])
    return normals, turns, precracked


def _check(meshes: SubmeshesOfRank, sharers: Sharers, normals: Float, sums: Float) -> None:
    """Raise MeshError if a normal of an interface entity is 0, not finite, or ambiguous.

    A normal is ambiguous if the interface folds back onto itself at a vertex.

    Args:
        normals: (n, 2, 2) normals at both ends of each entity.
        sums: (n, 4) sums over the edges at a vertex: normal times length (2), length, number of bonded edges.
    """
    length = np.linalg.norm(normals, axis=2)
    folded = ~sharers.is_edge & ~(np.hypot(*sums[:, :2].T) > ZERO_TOLERANCE * sums[:, 2])
    bad = np.flatnonzero(~(np.isfinite(length) & (length > 0)).all(axis=1) | folded)
    if len(bad):
        mesh, first = meshes.whole, bad[0]
        keys = mesh.edge_keys[mesh.edge_class] if sharers.is_edge[first] else mesh.class_keys[mesh.vertex_class]
        plane = int(np.flatnonzero(keys == sharers.key[first])[0])
        x, y = mesh.points[mesh.edges[plane] if sharers.is_edge[first] else [plane]].mean(axis=0) + mesh.origin
        raise MeshError(f"interface: no normal at ({x:.9g}, {y:.9g}); its sides are folded or have length 0")


def _sums_at_vertices(comm: MPI.Intracomm, sharers: Sharers, owner: Int, ends: Int, edge: Int, parts: Float) -> Float:
    """Sum contributions of edges to vertices over all ranks: (n, k) on owned entities.  Collective.

    Edges with keys `edge` (p,) contribute `parts` (p, 2, k) to vertex classes `ends` (p, 2), except to pinned classes.
    `owner` (n,) is the rank that owns each entity.
    """
    order, code = np.argsort(sharers.code), entity_code(ends, False)
    ordered = sharers.code[order]
    is_entity = np.isin(code, ordered)
    at = np.stack(np.broadcast_arrays(edge[:, None], np.arange(2)), axis=-1)
    to = owner[order[np.searchsorted(ordered, code[is_entity])]]
    code, at, parts = distributed_arrays.exchange(comm, to, code[is_entity], at[is_entity], parts[is_entity])
    sums = np.zeros((len(order), parts.shape[1]))
    # Rounding depends on the order of summation, which is therefore the same on any number of ranks.
    sequence = np.lexsort(at.T)
    np.add.at(sums, order[np.searchsorted(ordered, code[sequence])], parts[sequence])
    return sums


def edge_normals(mesh: Submesh, triangle: Int, k: Int) -> tuple[Float, Float]:
    """Compute normals (n, 2, 2) out of triangles at both ends of edges, and turns (n,), as in `SharedEntities`.

    `triangle` (n,) are triangles or pixels, and `k` (n,) positions of the edges in them.
    """
    a, b = (mesh.points[mesh.triangles[triangle, (k + step) % mesh.triangles.shape[1]]] for step in (0, 1))
    plane = mesh.triangle_edges[triangle, k]
    turn = mesh.turns[plane]
    tangents = np.repeat((b - a)[:, None], 2, axis=1)
    curved = turn > 0
    # On an arc, the vector y from the centre obeys y'' = -turn^2 y.
    angle, centre = turn[curved, None], mesh.circles[plane[curved], :2]
    start, stop = a[curved] - centre, b[curved] - centre
    slopes = np.stack([stop - np.cos(angle) * start, np.cos(angle) * stop - start], axis=1)
    tangents[curved] = (angle / np.sin(angle))[:, None] * slopes
    normal = np.stack([tangents[..., 1], -tangents[..., 0]], axis=-1)
    backwards = mesh.backwards[triangle, k]
    normal[backwards] = normal[backwards, ::-1]
    return normal, turn


@dataclass(frozen=True)
class SharedEntities(Sharers):
    """The n shared entities of the local subdomains, in the order of their constraints.

    Attributes:
        nodes: (n,) number of fine nodes on the entity: 1 at a vertex, the inner lattice nodes on an edge.
        first: (n,) number of the first vector constraint.
        body: (sharers,) body of every sharer.
        fibre: (n,) inner body, which may debond from the outer body; -1 where no bond can break.
        pair: (n,) number of the interface in the case; -1 where no bond can break.
        normal: (n, 2, 2) normals from the inner to the outer body at both ends of the edge, of length |dx / ds| for s
            in [0, 1]; at a vertex, two equal normals as long as the vertex's tributary length.
        turn: (n,) turn of the edge in radians, as in `Submesh`; 0 at vertices.
        precracked: (n,) whether the edge, or every edge at the vertex, is debonded in the mesh.
        owned: half-open range of the vector constraints that this rank owns.
        constraints: number of vector constraints on all ranks.
    """

    nodes: Int
    first: Int
    body: Int
    fibre: Int
    pair: Int
    normal: Float
    turn: Float
    precracked: Bool
    owned: tuple[int, int]
    constraints: int

    @property
    def pieces(self) -> set[int]:
        """Return subdomains with an entity that belongs to three or more subdomains, or to two in one body."""
        body = self.body
        between_two = (self.copies == 2) & (body[self.pointer[:-1]] != body[self.pointer[1:] - 1])
        return set(self.sharer[~np.repeat(between_two, self.copies)].tolist())


def share_entities(
    comm: MPI.Intracomm, meshes: SubmeshesOfRank, table: submeshes.SubdomainTable, pairs: Int, lattice: ReferenceLattice
) -> SharedEntities:
    """Find the shared entities of this rank, and number their constraints rank by rank.  Collective.

    Args:
        pairs: (phases, phases) number of the interface in the case, -1 where bonds never break.
        lattice: reference lattice of the coarse triangles.

    Raises:
        MeshError: an interface has no normal, because its sides are folded or have length 0.
    """
    sharers = find_sharers(comm, meshes, table)
    geometry: tuple[Array, ...] = interface_geometry(comm, meshes, table, pairs, sharers, lattice)
    if lattice.intervals == 1:
        vertices = np.flatnonzero(~sharers.is_edge)
        sharers, geometry = sharers.chosen(vertices), tuple(column[vertices] for column in geometry)
    nodes = np.where(sharers.is_edge, lattice.intervals - 1, 1)
    owner = table.rank[sharers.innermost]
    constraints = np.where(owner == comm.rank, nodes * (sharers.copies - 1), 0)
    own_constraints = int(constraints.sum())
    begin = comm.exscan(own_constraints) or 0
    numbers = begin + np.cumsum(constraints) - constraints
    rank, entity = table.rank[sharers.sharer], np.repeat(np.arange(len(owner)), sharers.copies)
    mine = (owner == comm.rank)[entity]
    entity, to = np.divmod(np.unique(entity[mine] * comm.size + rank[mine]), comm.size)
    columns = (column[entity] for column in (sharers.code, numbers, *geometry))
    code, *received = distributed_arrays.exchange(comm, to, *columns)
    place = np.argsort(code)
    place = place[np.searchsorted(code[place], sharers.code)]
    first, normal, turn, precracked = (column[place] for column in received)
    order = np.argsort(first)
    sharers = sharers.chosen(order)
    pair = breakable_pairs(meshes, table, pairs, sharers)
    return SharedEntities(
        key=sharers.key,
        is_edge=sharers.is_edge,
        nodes=nodes[order],
        first=first[order],
        pointer=sharers.pointer,
        sharer=sharers.sharer,
        body=table.body[sharers.sharer],
        fibre=np.where(pair >= 0, table.body[sharers.innermost], -1),
        pair=pair,
        normal=normal[order],
        turn=turn[order],
        precracked=precracked[order] & (pair >= 0),
        owned=(begin, begin + own_constraints),
        constraints=comm.allreduce(own_constraints),
    )
