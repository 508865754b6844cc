"""Assembly of one body of uniform material: stiffness, load of the unit strains, averages.

Voigt order [11, 22, 12] with engineering shear; degrees of freedom are (node, direction), node-major.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix

from feti_homog.fem.element import gradients

Int = NDArray[np.int64]
Float = NDArray[np.float64]

_VOIGT = np.array([[0, 2], [2, 1]])
_CHUNK = 1 << 16


@dataclass(frozen=True)
class Assembly:
    """What a body of area |Omega| made of the material L contributes.

    Attributes:
        K: (2c, 2c) stiffness, Eq. (28), force per length.
        Q: (2c, 3) int B^T L, so that the load of the macroscopic strain E is f = -Q E, Eq. (29), and the
            integral of the stress is |Omega| L E + Q^T u*.
        area: |Omega|.
    """

    K: csr_matrix
    Q: Float
    area: float


def assemble(points: Float, triangles: Int, node_class: Int, n_classes: int, L: Float) -> Assembly:
    """Assemble `triangles` (m, 3 or 6) with nodes at `points` (n, 2) of material `L` (3, 3)."""
    classes = node_class[triangles]
    blocks, area = [], 0.0
    Q = np.zeros((n_classes, 2, 3))
    for part, g, w in element_gradients(points, triangles):
        blocks.append(_stiffness(g, w, L))
        mean = np.einsum("eqad,eq->ead", g, w)
        load = mean @ L[_VOIGT].transpose(1, 0, 2).reshape(2, 6)
        # sum_d int dN_a/dx_d L[(i,d), :]
        for v in range(3):
            for i in range(2):
                Q[:, i, v] += np.bincount(classes[part].ravel(), load[..., 3 * i + v].ravel(), n_classes)
        area += float(w.sum())
    K = _sparse(np.concatenate(blocks), classes, n_classes)
    return Assembly(K, Q.reshape(-1, 3), area)


def element_gradients(points: Float, triangles: Int) -> Iterator[tuple[slice, Float, Float]]:
    """Gradients (e, q, a, 2) and weights (e, q) by chunks of elements, so that memory stays bounded."""
    for first in range(0, len(triangles), _CHUNK):
        part = slice(first, min(first + _CHUNK, len(triangles)))
        yield part, *gradients(points[triangles[part]])


def element_strain(points: Float, triangles: Int, node_class: Int, u: Float) -> tuple[Float, Float]:
    """Mean strains (m, 3) of the elements under nodal displacements u (c, 2), and their areas (m,)."""
    strain, area = np.empty((len(triangles), 3)), np.empty(len(triangles))
    for part, g, w in element_gradients(points, triangles):
        area[part] = w.sum(axis=1)
        mean = np.einsum("eqad,eq->ead", g, w) / area[part, None, None]
        gradient = np.einsum("eai,ead->eid", u[node_class[triangles[part]]], mean)
        strain[part] = np.stack(
            [gradient[:, 0, 0], gradient[:, 1, 1], gradient[:, 0, 1] + gradient[:, 1, 0]], axis=1
        )
    return strain, area


def _stiffness(g: Float, w: Float, L: Float) -> Float:
    """(e, a, b, 4) element stiffness K_(a i)(b j) = int dN_a/dx_k L_(ik)(jl) dN_b/dx_l, with (i, j) flat."""
    e, q, a, _ = g.shape
    flat = g.reshape(e, q, 2 * a)
    outer = np.matmul((flat * w[..., None]).transpose(0, 2, 1), flat)
    tensor = L[_VOIGT[:, :, None, None], _VOIGT[None, None]].transpose(1, 3, 0, 2).reshape(4, 4)
    return outer.reshape(e, a, 2, a, 2).transpose(0, 1, 3, 2, 4).reshape(e, a, a, 4) @ tensor


def _sparse(blocks: Float, classes: Int, n_classes: int) -> csr_matrix:
    dofs = (2 * classes[..., None] + np.arange(2)).astype(np.int32)
    m, a, _ = dofs.shape
    rows = np.broadcast_to(dofs[:, :, None, :, None], (m, a, a, 2, 2)).ravel()
    columns = np.broadcast_to(dofs[:, None, :, None, :], (m, a, a, 2, 2)).ravel()
    n = 2 * n_classes
    return coo_matrix((blocks.ravel(), (rows, columns)), shape=(n, n)).tocsr()
