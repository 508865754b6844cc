"""Shape functions of linear and quadratic triangles and of the bubble, with gradients at the quadrature points."""

from functools import cache

import numpy as np

from feti_homog.typing import Float

# The 6-point rule for quadratic triangles is exact to degree 4 (Dunavant 1985): it integrates the stiffness and the
# area of straight elements exactly, also with a bubble, and curved elements with the full order.
_C = np.array([0.445948490915965, 0.091576213509771])
_P2_POINTS = np.stack([np.r_[1 - 2 * _C, _C, _C], np.r_[_C, 1 - 2 * _C, _C]], axis=1)
_P2_WEIGHTS = np.tile([0.223381589678011, 0.109951743655322], 3) / 2


@cache
def quadrature(functions: int) -> tuple[Float, Float]:
    """Return the reference gradients (q, a, 2) of a shape functions, and the quadrature weights (q,).

    The functions are 3 linear, 6 quadratic, or 7: the quadratic functions and the bubble 27 r_0 r_1 r_2.
    """
    if functions == 3:
        return np.array([[[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]]]), np.array([0.5])
    x, y = _P2_POINTS.T
    z, o = 1 - x - y, np.zeros_like(x)
    by_x = np.stack([1 - 4 * z, 4 * x - 1, o, 4 * (z - x), 4 * y, -4 * y, 27 * y * (z - x)], axis=1)
    by_y = np.stack([1 - 4 * z, o, 4 * y - 1, -4 * x, 4 * x, 4 * (z - y), 27 * x * (z - y)], axis=1)
    return np.stack([by_x, by_y], axis=2)[:, :functions], _P2_WEIGHTS


def gradients(corners: Float, with_bubble: bool = False) -> tuple[Float, Float]:
    """Compute the physical shape function gradients (e, q, a, 2) in elements with nodes (e, a, 2).

    The second result is the quadrature weights times the Jacobian determinant (e, q).
    """
    nodes = corners.shape[1]
    reference, weights = quadrature(nodes + with_bubble)
    (xr, xs), (yr, ys) = np.moveaxis(np.tensordot(corners, reference[:, :nodes], (1, 1)), (1, 3), (0, 1))
    determinant = xr * ys - yr * xs
    by_r, by_s = np.moveaxis(reference, 2, 0)
    # x_d = J_rd r_r, so dN/dx_d = (J^-1)_dr dN/dr_r.
    by_x = ys[..., None] * by_r - yr[..., None] * by_s
    by_y = xr[..., None] * by_s - xs[..., None] * by_r
    return np.stack([by_x, by_y], axis=3) / determinant[..., None, None], determinant * weights


def barycentric(nodes: int) -> Float:
    """Return the barycentric coordinates (q, 3) of the quadrature points in a triangle with 3 or 6 nodes."""
    if nodes == 3:
        return np.full((1, 3), 1 / 3)
    return np.column_stack([1 - _P2_POINTS.sum(axis=1), _P2_POINTS])


def shape_functions(nodes: int, lam: Float) -> Float:
    """Evaluate the 3 or 6 shape functions (q, nodes) at barycentric coordinates lam (q, 3)."""
    if nodes == 3:
        return lam
    return np.hstack([lam * (2 * lam - 1), 4 * lam * np.roll(lam, -1, axis=1)])
