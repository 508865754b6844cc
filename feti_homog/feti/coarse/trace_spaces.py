"""Trace spaces: displacements of a boundary that are linear between some of its nodes.

Refinement hardly changes the soft modes of a subdomain, so a fine boundary is searched for them on the coarsest trace
space of enough dofs: P q for the values q at the vertices of the coarse mesh and at every k-th node along its edges.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from feti_homog.cell.refinement import ReferenceLattice
from feti_homog.cell.submesh import Submesh
from feti_homog.feti.decomposition.subdomain import both_directions
from feti_homog.feti.thresholds import DEFAULTS
from feti_homog.typing import Int


def trace_space(
    submesh: Submesh, lattice: ReferenceLattice, nodes: Int, min_dofs: int = DEFAULTS.min_trace_dofs
) -> csr_matrix:
    """(2n, 2m) P for n boundary nodes, sorted classes of the refined piece, with at least `min_dofs` columns if 2n is.

    Displacements vanish at ends of edges that are not among the nodes.
    """
    vertices, inner = len(submesh.class_keys), lattice.intervals - 1
    on_edge = nodes >= vertices
    edge, position = np.divmod(nodes - vertices, max(inner, 1))
    position += 1

    def is_kept(k: int) -> NDArray[np.bool_]:
        return np.asarray(~on_edge | (position % k == 0))

    k = 1
    while lattice.intervals % (2 * k) == 0 and 2 * is_kept(2 * k).sum() >= min_dofs:
        k *= 2
    keep = is_kept(k)
    m = int(keep.sum())
    number = np.full(vertices + len(submesh.edge_keys) * inner, -1)
    number[nodes[keep]] = np.arange(m)
    between = np.flatnonzero(~keep)
    edge, lower = edge[between], position[between] // k * k
    ends = np.empty((len(submesh.edge_keys), 2), np.int64)
    ends[submesh.edge_class] = submesh.vertex_class[submesh.edges]
    first = vertices + edge * inner - 1
    left = np.where(lower == 0, ends[edge, 0], first + lower)
    right = np.where(lower + k == lattice.intervals, ends[edge, 1], first + lower + k)
    weight = (position[between] - lower) / k
    rows = np.concatenate([np.flatnonzero(keep), between, between])
    columns = np.concatenate([np.arange(m), number[left], number[right]])
    values = np.concatenate([np.ones(m), 1 - weight, weight])
    known = columns >= 0
    rows, columns, values = rows[known], columns[known], values[known]
    entries = np.repeat(values, 2), (both_directions(rows), both_directions(columns))
    return csr_matrix(entries, shape=(2 * len(nodes), 2 * m))
