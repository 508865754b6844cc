"""Trace spaces: displacements of a boundary that are linear between some of its nodes.

Refinement hardly changes the soft modes of a subdomain, so a fine boundary is searched for them on the coarsest trace
space of enough dofs: P q for the values q at the vertices of the coarse mesh and at every k-th node along its edges.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from feti_homog.fem.problem import Problem
from feti_homog.feti.thresholds import DEFAULTS
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.mesh.submesh import Submesh
from feti_homog.typing import Int


def trace_space(
    submesh: Submesh,
    lattice: ReferenceLattice,
    problem: Problem,
    nodes: Int,
    min_dofs: int = DEFAULTS.min_trace_dofs,
) -> csr_matrix:
    """(cn, cm) P for n boundary nodes, sorted classes of the refined piece, with at least `min_dofs` columns if cn is.

    Displacements vanish at ends of edges that are not among the nodes.
    """
    vertices, inner, c = len(submesh.class_keys), lattice.intervals - 1, problem.components
    on_edge = nodes >= vertices
    edge, position = np.divmod(nodes - vertices, max(inner, 1))
    position += 1

    def is_kept(k: int) -> NDArray[np.bool_]:
        return np.asarray(~on_edge | (position % k == 0))

    k = 1
    while lattice.intervals % (2 * k) == 0 and c * is_kept(2 * k).sum() >= min_dofs:
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
    entries = np.repeat(values, c), (problem.dofs(rows), problem.dofs(columns))
    return csr_matrix(entries, shape=(c * len(nodes), c * m))
