"""Where two bodies meet whose bond may break: normals and lengths of the shared vertices and edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.cell.periodic_topology import Torus
from feti_homog.feti.decomposition.edge_arcs import mean_speed
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class InterfaceGeometry:
    """Of n shared entities; the attributes are those of `SharedEntities`, 0 where no bond may break."""

    fibre: Int
    pair: Int
    normal: Float
    turn: Float
    precracked: Bool


def interface_geometry(
    torus: Torus, pairs: Int, key: Int, is_edge: Bool, pointer: Int, body: Int, side: float
) -> InterfaceGeometry:
    """Fibre, normals, turn and precrack of n shared entities; arguments as in `SharedEntities`, and `pairs` as in
    `share_entities`; the side of an element is the share `side` of a coarse edge."""
    pair = _breakable_pairs(torus, pairs, pointer, body)
    fibre = np.where(pair >= 0, body[pointer[1:] - 1], -1)
    edge, normal, turn = _edge_geometry(torus, pairs)
    n_edges, n_classes = torus.torus_edge.max() + 1, torus.node_class.max() + 1
    edge_normal, edge_turn = np.zeros((n_edges, 2, 2)), np.zeros(n_edges)
    edge_normal[edge], edge_turn[edge] = normal, turn
    bonded = np.zeros(n_edges, bool)
    bonded[edge] = True
    bonded[torus.torus_edge[torus.plane_edges(torus.mesh.debonded_edges)]] = False
    plane = np.empty(n_edges, np.int64)
    plane[torus.torus_edge[::-1]] = np.arange(len(torus.edges))[::-1]
    ends = torus.node_class[torus.edges[plane[edge]]]
    vertex_normal, vertex_length = np.zeros((n_classes, 2)), np.zeros(n_classes)
    for end, (low, high) in enumerate(((0.0, side), (1.0 - side, 1.0))):
        length = mean_speed(normal, turn, np.full(len(edge), low), np.full(len(edge), high))
        unit = normal[:, end] / np.maximum(np.hypot(*normal[:, end].T), 1e-300)[:, None]
        np.add.at(vertex_normal, ends[:, end], unit * length[:, None])
        np.add.at(vertex_length, ends[:, end], length)
    vertex_normal *= (vertex_length / np.maximum(np.hypot(*vertex_normal.T), 1e-300))[:, None]
    bonded_edges_at = np.bincount(ends[bonded[edge]].ravel(), minlength=n_classes)
    vertices, edges = key[~is_edge], key[is_edge]
    normals, turns = np.empty((len(key), 2, 2)), np.zeros(len(key))
    normals[~is_edge], normals[is_edge] = vertex_normal[vertices][:, None], edge_normal[edges]
    turns[is_edge] = edge_turn[edges]
    precracked = np.empty(len(key), bool)
    precracked[~is_edge], precracked[is_edge] = bonded_edges_at[vertices] == 0, ~bonded[edges]
    return InterfaceGeometry(fibre, pair, normals, turns, precracked & (fibre >= 0))


def _breakable_pairs(torus: Torus, pairs: Int, pointer: Int, body: Int) -> Int:
    """(n,) the interface of the two bodies that meet there; -1 where it never parts or a third body meets them."""
    outer, inner = body[pointer[:-1]], body[pointer[1:] - 1]
    copies = np.diff(pointer)
    third = (body != np.repeat(outer, copies)) & (body != np.repeat(inner, copies))
    thirds = np.bincount(np.repeat(np.arange(len(copies)), copies), third, len(copies))
    phase = torus.constituent_phase
    return np.where((thirds == 0) & (outer != inner), pairs[phase[outer], phase[inner]], -1)


def _edge_geometry(torus: Torus, pairs: Int) -> tuple[Int, Float, Float]:
    """Torus edges whose bonds may break, their normals at start and end, as in `SharedEntities`, and their turns."""
    mesh, body = torus.mesh, torus.constituent
    left, right, edge = torus.sides
    mixed = pairs[mesh.phase[left], mesh.phase[right]] >= 0
    fibre = np.where(torus.nesting[body[left]] > torus.nesting[body[right]], left, right)[mixed]
    edge = edge[mixed]
    k = np.argmax(torus.triangle_torus_edges[fibre] == edge[:, None], axis=1)
    start, end = mesh.triangles[fibre, k], mesh.triangles[fibre, (k + 1) % 3]
    plane = torus.triangle_edges[fibre, k]
    backwards = torus.edges[plane, 0] != start
    a, b = mesh.points[start], mesh.points[end]
    turn, own = torus.edge_turns[plane], torus.edge_ellipses[plane]
    normal = np.repeat(_across(b - a)[:, None], 2, axis=1)
    curved = turn > 0
    spokes = np.stack([own[curved].unit((end - own.centres)[curved]) for end in (a, b)], axis=1)
    tangent = np.einsum("eij,epj->epi", own.frames[curved], -_across(spokes)) * turn[curved, None, None]
    radial = _across(tangent)
    side = np.sign((radial.sum(axis=1) * normal[curved, 0]).sum(axis=1))
    normal[curved] = side[:, None, None] * radial
    normal[backwards] = normal[backwards, ::-1]
    return edge, normal, turn


def _across(vectors: Float) -> Float:
    """Vectors (..., 2) turned by a right angle, clockwise."""
    return np.stack([vectors[..., 1], -vectors[..., 0]], axis=-1)
