"""Evaluate shape functions of linear, quadratic and mixed triangles, and their gradients at quadrature points.

Mixed elements are quadratic triangles with a cubic bubble and a discontinuous linear pressure (Crouzeix and Raviart
1973).  The pressure is p = lambda Pi div u, with the Lame constant lambda and the projection Pi on linear functions in
reference coordinates.  Pressure and bubble are eliminated element by element, so that the element has the nodes of a
quadratic triangle.  It does not lock if lambda far exceeds the shear modulus mu.  Mean strains, mean stresses and loads
under uniform strains equal the values of the quadratic triangle: the bubble is 0 on the boundary, and Pi keeps means.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from feti_homog.fem.problem import PLANE, Problem
from feti_homog.typing import Float

# The 6-point rule for quadratic triangles is exact to degree 4 (Dunavant 1985): it integrates the stiffness and the
# area of straight elements exactly, also with a bubble, and curved elements with the full order.
_C = np.array([0.445948490915965, 0.091576213509771])
_P2_POINTS = np.stack([np.r_[1 - 2 * _C, _C, _C], np.r_[_C, 1 - 2 * _C, _C]], axis=1)
# The barycentric coordinates (6, 3) of its points.
BARYCENTRIC: Float = np.column_stack([1 - _P2_POINTS.sum(axis=1), _P2_POINTS])
_P2_WEIGHTS = np.tile([0.223381589678011, 0.109951743655322], 3) / 2
BUBBLE = 6
# Second derivatives (6, 3) of the shape functions with respect to the reference coordinates: 11, 22 and 12.
HESSIANS = np.array([[4, 4, 4], [4, 0, 0], [0, 4, 0], [-8, 0, -4], [0, 0, 4], [0, -8, -4]], float)
# INTEGRAL = int b and int db/dr_r db/dr_s = GRADIENTS T_rs on the unit triangle; with Pi, PROJECTED times the latter.
INTEGRAL, GRADIENTS, PROJECTED = 9 / 40, 81 / 40, 3 / 5
T = np.array([[2.0, 1.0], [1.0, 2.0]])


@cache
def quadrature(functions: int) -> tuple[Float, Float]:
    """Return shape function gradients (q, a, 2) at q points of the reference triangle, and the weights (q,).

    The number `functions` is a: 3 linear, 6 quadratic, or 7 with the bubble 27 r_0 r_1 r_2, barycentric coordinates r.
    """
    if functions == 3:
        return np.array([[[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]]]), np.array([0.5])
    x, y = _P2_POINTS.T
    z, o = 1 - x - y, np.zeros_like(x)
    by_x = np.stack([1 - 4 * z, 4 * x - 1, o, 4 * (z - x), 4 * y, -4 * y, 27 * y * (z - x)], axis=1)
    by_y = np.stack([1 - 4 * z, o, 4 * y - 1, -4 * x, 4 * x, 4 * (z - y), 27 * x * (z - y)], axis=1)
    return np.stack([by_x, by_y], axis=2)[:, :functions], _P2_WEIGHTS


def gradients(corners: Float, with_bubble: bool = False) -> tuple[Float, Float]:
    """Compute shape function gradients dN_a / dx_k (e, q, a, 2) in elements with node positions `corners` (e, n, 2).

    The second result (e, q) is weight times Jacobian determinant.  Here a = n, or 7 if `with_bubble` adds the bubble.
    """
    nodes = corners.shape[1]
    reference, weights = quadrature(nodes + 1 if with_bubble else nodes)
    (xr, xs), (yr, ys) = np.moveaxis(np.tensordot(corners, reference[:, :nodes], (1, 1)), (1, 3), (0, 1))
    determinant = xr * ys - yr * xs
    by_r, by_s = np.moveaxis(reference, 2, 0)
    # x_d = J_rd r_r, so dN/dx_d = (J^-1)_dr dN/dr_r.
    by_x = ys[..., None] * by_r - yr[..., None] * by_s
    by_y = xr[..., None] * by_s - xs[..., None] * by_r
    return np.stack([by_x, by_y], axis=3) / determinant[..., None, None], determinant * weights


def shape_functions(lam: Float) -> Float:
    """Evaluate the shape functions (q, 6) of quadratic triangles at barycentric coordinates lam (q, 3)."""
    return np.hstack([lam * (2 * lam - 1), 4 * lam * np.roll(lam, -1, axis=1)])


def lame(L: Float) -> tuple[float, float]:
    """Return the Lame constants lambda and mu of a stiffness (v, v) that is isotropic in the plane."""
    return float(L[0, 1]), float(L[2, 2])


def affine_couples(L: Float, inverse: Float, determinant: Float) -> Float:
    """Compute coefficients X (t, 9, 4) by which eliminated bubbles change the stiffness of affine elements.

    With second derivatives H_(a r) of shape functions (`HESSIANS`), K_(a i)(b j) gains H_(a r) H_(b s) X_(r s)(i j).
    For a quadratic u, div u is linear and div sigma = f is constant.  So the force on the bubble b is -int b f, and
    pressure changes only b's stiffness, det GRADIENTS (mu tr m I + (mu + PROJECTED lambda) m), m = inverse^T T inverse.

    Args:
        L: (v, v) stiffness, isotropic in the plane, with Lame constants lambda and mu.
        inverse, determinant: dr_r / dx_k (t, 2, 2) and det dx/dr (t,).
    """
    first, shear = lame(L)
    metric = inverse.transpose(0, 2, 1) @ T @ inverse
    trace = np.trace(metric, axis1=1, axis2=2)[:, None, None] * np.eye(2)
    stiffness = GRADIENTS * (shear * trace + (shear + PROJECTED * first) * metric)
    outer = np.einsum("trk,tsl->tklrs", inverse, inverse)
    second = np.stack([outer[..., 0, 0], outer[..., 1, 1], outer[..., 0, 1] + outer[..., 1, 0]], axis=-1)
    divergence = (first + shear) / 2 * (second + second.transpose(0, 2, 1, 3))
    for i in range(2):
        divergence[:, i, i] += shear * (second[:, 0, 0] + second[:, 1, 1])
    forces = INTEGRAL * divergence.reshape(-1, 2, 6)
    eliminated = forces.transpose(0, 2, 1) @ np.linalg.solve(stiffness, forces) * determinant[:, None, None]
    return np.asarray(-eliminated.reshape(-1, 2, 3, 2, 3).transpose(0, 2, 4, 1, 3).reshape(-1, 9, 4))


@dataclass(frozen=True)
class MixedElements:
    """Mixed elements of any shape, with a stiffness that is isotropic in the plane.

    Attributes:
        lame: lambda and mu.
        gradients, weights: gradients (e, q, 7, 2) of the shape functions, the bubble last, and weights (e, q).
        projected: (e, q, 7, 2) Pi dN_a/dx_i at the quadrature points: Pi div u = projected : u.
    """

    lame: tuple[float, float]
    gradients: Float
    weights: Float
    projected: Float

    @classmethod
    def of(cls, points: Float, L: Float) -> MixedElements:
        """Compute gradients, weights and projections of mixed elements with nodes (e, 6, 2) and stiffness L (v, v)."""
        g, w = gradients(points, with_bubble=True)
        linear, (e, q, a, _) = BARYCENTRIC, g.shape
        mass = np.einsum("eq,qm,qn->emn", w, linear, linear, optimize=True)
        moments = (linear.T * w[:, None]) @ g.reshape(e, q, 2 * a)
        return cls(lame(L), g, w, (linear @ np.linalg.solve(mass, moments)).reshape(g.shape))

    def couples(self) -> Float:
        """Compute the stiffness (e, 6, 6, 4) of node pairs, (i, j) flat, with bubble and pressure eliminated."""
        K, n = self._stiffness(slice(None)), 2 * BUBBLE
        nodes = K[:, :n, :n] - K[:, :n, n:] @ np.linalg.solve(K[:, n:, n:], K[:, n:, :n])
        return np.asarray(nodes.reshape(-1, BUBBLE, 2, BUBBLE, 2).transpose(0, 1, 3, 2, 4).reshape(-1, 6, 6, 4))

    def with_bubble(self, u: Float) -> Float:
        """Append the bubble displacements in equilibrium to nodal displacements (e, 6, 2, k); return (e, 7, 2, k)."""
        K, n = self._stiffness(slice(BUBBLE, None)), 2 * BUBBLE
        bubble = np.linalg.solve(K[:, :, n:], K[:, :, :n] @ u.reshape(len(u), n, -1))
        return np.concatenate([u, -bubble[:, None]], axis=1)

    def dilatation(self, u: Float) -> Float:
        """Compute the projected dilatation Pi div u = p / lambda (e, q, k) of displacements (e, 7, 2, k)."""
        e, q, a, _ = self.gradients.shape
        return np.asarray(self.projected.reshape(e, q, 2 * a) @ u.reshape(e, 2 * a, -1))

    def stress(self, u: Float) -> Float:
        """Compute the stresses 2 mu eps + p I (e, q, 3, k) of displacements u (e, 7, 2, k); p = lambda Pi div u."""
        first, shear = self.lame
        stress = shear * np.array([2.0, 2.0, 1.0])[:, None] * strains(slopes(self.gradients, u), PLANE)
        stress[:, :, :2] += first * self.dilatation(u)[:, :, None]
        return np.asarray(stress)

    def _stiffness(self, functions: slice) -> Float:
        """Compute the stiffness rows (e, 2n, 14) of n shape functions; the last two columns belong to the bubble.

        K_(a i)(b j) = int mu (delta_ij dN_a/dx_k dN_b/dx_k + dN_a/dx_j dN_b/dx_i) + lambda Pi dN_a/dx_i dN_b/dx_j.
        """
        first, shear = self.lame
        e, q, a, _ = self.gradients.shape
        flat, weights = self.gradients.reshape(e, q, 2 * a), self.weights[..., None, None]
        weighted = (weights * self.gradients[:, :, functions]).reshape(e, q, -1).transpose(0, 2, 1)
        projected = (weights * self.projected[:, :, functions]).reshape(e, q, -1).transpose(0, 2, 1)
        products = (weighted @ flat).reshape(e, -1, 2, a, 2)
        K = shear * products.transpose(0, 1, 4, 3, 2)
        along = shear * (products[:, :, 0, :, 0] + products[:, :, 1, :, 1])
        for i in range(2):
            K[:, :, i, :, i] += along
        return np.asarray(K.reshape(e, -1, 2 * a) + first * projected @ flat)


@dataclass(frozen=True)
class ElementFields:
    """The displacement gradients and strains in e elements at q points under k loads.

    Mixed elements have the strain energy density less lambda r^2 / 2, r = div u - Pi div u (`MixedElements`); the
    energy is stationary with respect to the bubble displacement, too.

    Attributes:
        problem: the c displacements, and their m strains.
        gradients, weights: gradients (e, q, a, 2) of the nodes' shape functions, and quadrature weights (e, q).
        slopes: (e, q, 2, c, k) du_i / dx_d.
        strain: (e, q, m, k) displacement strains, with the strains of the loads.
        rest: (e, q, k) r; None unless the elements are mixed.
    """

    problem: Problem
    gradients: Float
    weights: Float
    slopes: Float
    strain: Float
    rest: Float | None

    @classmethod
    def of(cls, problem: Problem, points: Float, u: Float, A: Float, loads: Float, is_mixed: bool) -> ElementFields:
        """Compute the fields from nodes (e, a, 2), u (e, a, c, k), stiffness A and strains `loads` (m, k) to add."""
        if not is_mixed:
            g, w = gradients(points)
            grad_u = slopes(g, u)
            return cls(problem, g, w, grad_u, strains(grad_u, problem) + loads, None)
        elements, inner = MixedElements.of(points, A), u.shape[1]
        u = elements.with_bubble(u)
        grad_u, g = slopes(elements.gradients, u), elements.gradients[:, :, :inner]
        rest = np.trace(grad_u, axis1=2, axis2=3) - elements.dilatation(u)
        return cls(problem, g, elements.weights, grad_u, strains(grad_u, problem) + loads, rest)

    def change(self, A: Float, uniform: Float, moved: Float, changed: Float | None = None) -> Float:
        """Differentiate int e_i A e_j (k, k), e_i the strains under load i, as nodes move by s V, and u there by s U.

        The derivative with respect to s is int (de_i + div V e_i / 2) A e_j plus its transpose, with d grad u = grad U
        - grad V grad u (deLorenzi, Int. J. Fract. 19 (1982) 183).  A is (v, v), `uniform` (v - m, k) the loads after
        the m strains in e, `moved` V (e, a, 2), and `changed` U (e, a, c, k), by default 0.
        """
        grad_V = slopes(self.gradients, moved[..., None])[..., 0]
        div_V = np.trace(grad_V, axis1=2, axis2=3)[..., None, None]
        grad_u = (-grad_V @ self.slopes.reshape(*grad_V.shape[:3], -1)).reshape(self.slopes.shape)
        grad_u += 0.0 if changed is None else slopes(self.gradients, changed)
        change = strains(grad_u, self.problem)
        strain = np.concatenate([self.strain, np.broadcast_to(uniform, (*self.weights.shape, *uniform.shape))], axis=2)
        work = self.weights[..., None, None] * (A @ strain)
        half = div_V / 2 * strain
        half[:, :, : self.problem.strains] += change
        rate = np.tensordot(half, work, ((0, 1, 2), (0, 1, 2)))
        if self.rest is not None:
            half = change[:, :, 0] + change[:, :, 1] + div_V[..., 0] / 2 * self.rest
            rate -= A[0, 1] * np.tensordot(half, self.weights[..., None] * self.rest, ((0, 1), (0, 1)))
        return np.asarray(rate + rate.T)


def slopes(g: Float, u: Float) -> Float:
    """Return the slopes du_i / dx_d (e, q, 2, c, k) from gradients (e, q, a, 2) and displacements (e, a, c, k)."""
    e, q, a, _ = g.shape
    return np.asarray((g.transpose(0, 1, 3, 2).reshape(e, -1, a) @ u.reshape(e, a, -1)).reshape(e, q, 2, *u.shape[2:]))


def strains(slope: Float, problem: Problem) -> Float:
    """Return the displacement strains (e, q, m, k) from slopes (e, q, 2, c, k)."""
    strain = np.zeros((*slope.shape[:2], problem.strains, slope.shape[4]))
    for (i, d), number in np.ndenumerate(problem.voigt):
        strain[:, :, number] += slope[:, :, d, i]
    return strain
