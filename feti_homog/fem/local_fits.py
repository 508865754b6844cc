"""Fit polynomials with p coefficients to element values around every vertex, by least squares weighted with areas.

A boundary vertex has few elements: its fit includes elements around neighbours, a linear fit known tractions, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix

from feti_homog.typing import Float, Int

# Weight of the elements around the neighbours of a boundary vertex, by element order.  The values are measured with
# `scripts/measure_mesh_error.py` over all its cells.
NEIGHBOURS = {1: 0.1, 2: 0.001}
# Term on the unit diagonal of the scaled moments of slopes: where all points lie on a line, a fit does not vary across.
RIDGE = 1e-9
# Length of the mean side normal below which a vertex has no normal, for example in a cusp where two fibres touch.
NO_NORMAL = 0.1


@dataclass(frozen=True)
class PatchNeighbours:
    """The n boundary vertices whose fits include the elements of a neighbour, with weight NEIGHBOURS.

    Attributes:
        at, other: (n,) boundary vertex and neighbour vertex.
        vector: (n, 2) vector from the boundary vertex to the neighbour.
    """

    at: Int
    other: Int
    vector: Float

    @classmethod
    def of(cls, vertices: Int, corners: Float) -> PatchNeighbours:
        """Find the neighbours of all boundary vertices, in elements with vertices (e, 3) at corners (e, 3, 2)."""
        start, stop = vertices.T.ravel(), vertices.T[[1, 2, 0]].ravel()
        size, e = int(vertices.max()) + 1, len(vertices)
        # Sides form a closed chain around an inner vertex, so that marks cancel; integers below 2^53 cancel exactly.
        mark = np.random.default_rng(0).integers(1 << 40, size=size).astype(float)
        around = np.take(mark, vertices.T)
        at_boundary = np.bincount(start, (around[[1, 2, 0]] - around[[2, 0, 1]]).ravel()) != 0.0
        near = np.flatnonzero(np.take(at_boundary, start) | np.take(at_boundary, stop))
        low, high = np.minimum(start, stop)[near], np.maximum(start, stop)[near]
        once = near[np.unique(low * size + high, return_index=True)[1]]
        k, element = np.divmod(once, e)
        vector = corners[element, (k + 1) % 3] - corners[element, k]
        at, other = np.concatenate([start[once], stop[once]]), np.concatenate([stop[once], start[once]])
        is_start = at_boundary[at]
        return cls(at[is_start], other[is_start], np.concatenate([vector, -vector])[is_start])

    def shared(self, moments: Float, sums: Float, order: int) -> tuple[Float, Float]:
        """Weight the neighbours' parts of `moments` (vertices, p, p) and `sums` (vertices, p, k) for a fit."""
        T, weight = _translations(self.vector, order), NEIGHBOURS[order]
        of_moments = gathered(self.at, T @ moments[self.other] @ T.transpose(0, 2, 1), len(moments))
        return weight * of_moments, weight * gathered(self.at, T @ sums[self.other], len(sums))

    def shared_moments(self, moments: Float) -> Float:
        """Compute the neighbours' weighted parts (6, vertices) of `moments`, the sums of 1, x, y, x^2, x y and y^2."""
        one, x, y, xx, xy, yy = moments[:, self.other]
        a, b = self.vector.T
        moved_x, moved_y = x + a * one, y + b * one
        moved = one, moved_x, moved_y, xx + a * (x + moved_x), xy + a * y + b * moved_x, yy + b * (y + moved_y)
        return NEIGHBOURS[1] * np.array([np.bincount(self.at, row, moments.shape[1]) for row in moved])


def linear_values(vertices: Int, away: Float, weights: Float, values: Float, neighbours: PatchNeighbours) -> Float:
    """Fit a linear function about every vertex to uniform element values (e, k).

    Returns the fit values (vertices, k) at the vertices: weighted means of element values.

    Args:
        vertices: (3, e) vertices of the elements.
        away: (2, 3, e) vectors from the vertices to the element centres.
        weights: (e,) areas.
    """
    at, size, e = vertices.ravel(), int(vertices.max()) + 1, len(weights)
    x, y = away
    basis = np.broadcast_to(weights, x.shape), weights * x, weights * y
    parts = (*basis, basis[1] * x, basis[1] * y, basis[2] * y)
    moments = np.stack([np.bincount(at, part.ravel()).astype(float) for part in parts])
    moments += neighbours.shared_moments(moments)
    # The first row of the inverse of each normalized symmetric matrix, by moments about the mean position.
    scale = 1 / np.sqrt(moments[[0, 3, 5]])
    mx, my, xy = (moments[k] * scale[i] * scale[j] for k, i, j in ((1, 0, 1), (2, 0, 2), (4, 1, 2)))
    cxx, cyy, cxy = 1.0 + RIDGE - mx * mx, 1.0 + RIDGE - my * my, xy - mx * my
    gx, gy = np.stack([my * cxy - mx * cyy, mx * cxy - my * cxx]) / (cxx * cyy - cxy * cxy)
    first = np.stack([1.0 - mx * gx - my * gy, gx, gy]) * scale * scale[0]
    means = sum(np.take(row, vertices) * part for row, part in zip(first, basis, strict=True))
    result = csc_matrix((means.T.ravel(), vertices.T.ravel(), np.arange(0, 3 * e + 1, 3)), (size, e)) @ values
    is_shared = np.zeros(size, bool)
    is_shared[neighbours.other] = True
    near = np.flatnonzero(np.take(is_shared, at))
    terms = np.stack([part.ravel()[near] for part in basis], axis=1)
    rows = at[near, None] + size * np.arange(3)
    sums = csc_matrix((terms.ravel(), rows.ravel(), np.arange(0, 3 * len(near) + 1, 3)), (3 * size, len(near)))
    zero, one, two = (sums @ values[near % e]).reshape(3, size, -1)[:, neighbours.other]
    (a, b), (f, g, h) = neighbours.vector.T, first[:, neighbours.at]
    moved = (f + a * g + b * h)[:, None] * zero + g[:, None] * one + h[:, None] * two
    return np.asarray(result + NEIGHBOURS[1] * gathered(neighbours.at, moved[:, None], size)[:, 0])


def polynomials(x: Float, order: int) -> Float:
    """Evaluate the p monomials 1, x, y and, in order 2, x^2, x y, y^2 (.., p) at positions (.., 2)."""
    one, first, second = np.ones(x.shape[:-1]), x[..., 0], x[..., 1]
    quadratic = (first * first, first * second, second * second) if order == 2 else ()
    return np.stack([one, first, second, *quadratic], axis=-1)


def _translations(d: Float, order: int) -> Float:
    """Compute the translations T (n, p, p): polynomials(x + d) = T polynomials(x) for d (n, 2)."""
    x, y = d.T
    T = np.tile(np.eye(3 * order), (len(d), 1, 1))
    T[:, 1, 0], T[:, 2, 0] = x, y
    if order == 2:
        T[:, 3, :2] = np.stack([x * x, 2 * x], axis=1)
        T[:, 4, :3] = np.stack([x * y, y, x], axis=1)
        T[:, 5, 0], T[:, 5, 2] = y * y, 2 * y
    return T


def gathered(place: Int, values: Float, size: int) -> Float:
    """Sum the values (n, .., p, q) with equal positions `place` (n, ..) to an array (size, p, q)."""
    n, shape = place.size, values.shape[-2:]
    sums = csc_matrix((np.ones(n), place.ravel(), np.arange(n + 1)), (size, n)) @ values.reshape(n, math.prod(shape))
    return np.asarray(sums.reshape(size, *shape))


def fitted(moments: Float, sums: Float) -> Float:
    """Solve the normal equations `moments` (n, p, p) a = `sums` (n, p, k); RIDGE helps if points lie on a line."""
    scale = 1 / np.sqrt(np.einsum("nii->ni", moments))[..., None]
    normalized = moments * scale * scale.transpose(0, 2, 1) + RIDGE * np.diag(np.arange(moments.shape[1]) > 0)
    return np.asarray(scale * np.linalg.solve(normalized, scale * sums))


@dataclass(frozen=True)
class KnownTractions:
    """The known tractions under k loads at n boundary vertices.

    Attributes:
        node: (n,) node classes of the vertices.
        normal: (n, 2) unit normals out of the body.
        traction: (n, c, k) tractions.
    """

    node: Int
    normal: Float
    traction: Float

    @classmethod
    def at(cls, node: Int, mean: Float, traction: Float) -> KnownTractions:
        """Set up tractions with normals along the `mean` (n, 2) side normals; leave out vertices where these cancel."""
        length = np.hypot(*mean.T)
        rows = length > NO_NORMAL
        return cls(node[rows], mean[rows] / length[rows, None], traction[rows])

    def imposed(self, stress: Float, vertex: Int, voigt: Int, flexibility: Float) -> Float:
        """Return a copy of `stress` (vertices, m, k) with the known tractions at the vertices `vertex` (n,).

        With d = traction - sigma n and tangent t, the result in the plane is sigma + d n + n d - (d . n) n n + a t t,
        where a keeps the strain along the boundary, equal on both sides; in axial shear it is sigma + d n.  `voigt`
        (c, 2) holds strain numbers as in `Problem`, and the flexibility is (m, m).
        """
        n, before = self.normal, stress[vertex]
        d = self.traction - np.einsum("ncdk,nd->nck", before[:, voigt], n)
        off = np.einsum("nck,nd->ncdk", d, n)
        entries = [tuple(np.argwhere(voigt == number)[0]) for number in range(stress.shape[1])]
        if len(voigt) == 2:
            both = n[:, :, None, None] * n[:, None, :, None]
            off += off.transpose(0, 2, 1, 3) - both * np.einsum("nck,nc->nk", d, n)[:, None, None]
        result = np.stack([off[:, i, j] for i, j in entries], axis=1)
        if len(voigt) == 2:
            t = np.column_stack([-n[:, 1], n[:, 0]])
            along = np.stack([t[:, i] * t[:, j] for i, j in entries], axis=1)
            strain = along @ flexibility
            ratio = np.einsum("nv,nvk->nk", strain, result) / (strain * along).sum(axis=1)[:, None]
            result -= along[..., None] * ratio[:, None]
        full = stress.copy()
        full[vertex] += result
        return full
