"""Quadratic triangles with a cubic bubble and a discontinuous linear pressure (Crouzeix and Raviart 1973).

The pressure p = lambda Pi div u, with Pi the projection on linear functions of the reference coordinates, and the
bubble are eliminated element by element.  So the element has the nodes of a quadratic one, does not lock where lambda
exceeds the shear modulus mu, and its mean strains, its mean stresses and the loads of uniform strains are those of the
quadratic one: the bubble vanishes on the boundary, and Pi keeps means.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.fem.shape_functions import gradients, quadrature
from feti_homog.typing import Float

BUBBLE = 6
# Second derivatives (6, 3) of the shape functions by the reference coordinates: 11, 22 and 12.
HESSIANS = np.array([[4, 4, 4], [4, 0, 0], [0, 4, 0], [-8, 0, -4], [0, 0, 4], [0, -8, -4]], float)
# Of the bubble over the unit triangle, with T = [[2, 1], [1, 2]]: its integral; int db/dr_r db/dr_s = GRADIENTS T_rs;
# and that of the projections of its derivatives, relative to GRADIENTS.
INTEGRAL, GRADIENTS, PROJECTED = 9 / 40, 81 / 40, 3 / 5
T = np.array([[2.0, 1.0], [1.0, 2.0]])


def lame(L: Float) -> tuple[float, float]:
    """lambda and mu of a stiffness (v, v) that is isotropic in the plane."""
    return float(L[0, 1]), float(L[2, 2])


def affine_couples(L: Float, inverse: Float, determinant: Float) -> Float:
    """(t, 9, 4) X with which H_a,r H_b,s X_(r s)(i j), H the `HESSIANS`, is what the bubble adds to K_(a i)(b j).

    The stress of a quadratic u has a constant divergence f on an affine element, and div u is linear.  So the bubble's
    force is -int b f, and its stiffness alone differs from that without pressure:

        K_bb = det GRADIENTS (mu tr m I + (mu + PROJECTED lambda) m),  m = inverse^T T inverse.

    Args:
        L: (v, v) stiffness, isotropic in the plane.
        inverse, determinant: (t, 2, 2) dr_r / dx_k and (t,) det dx/dr.
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
class Elements:
    """Elements of any shape, of a stiffness that is isotropic in the plane, with their bubble.

    Attributes:
        gradients, weights: (e, q, 7, 2) of the shape functions, the bubble's last, and (e, q).
        projected: (e, q, 7, 2) Pi dN_a/dx_i at the quadrature points: Pi div u = projected : u.
        K: (e, 14, 14) stiffness before the bubble is eliminated.
    """

    gradients: Float
    weights: Float
    projected: Float
    K: Float

    @classmethod
    def of(cls, points: Float, L: Float) -> Elements:
        """Integrate the elements of nodes (e, 6, 2)."""
        first, shear = lame(L)
        g, w = gradients(points, with_bubble=True)
        linear = quadrature(BUBBLE).coordinates
        mass = np.einsum("eq,qm,qn->emn", w, linear, linear)
        moments = np.einsum("qm,eq,eqak->emak", linear, w, g, optimize=True)
        e, q, a, _ = g.shape
        projected = np.linalg.solve(mass, moments.reshape(e, 3, 2 * a))
        flat = g.reshape(e, q, 2 * a)
        products = ((flat * w[..., None]).transpose(0, 2, 1) @ flat).reshape(e, a, 2, a, 2)
        # mu (delta_ij dN_a/dx_k dN_b/dx_k + dN_a/dx_j dN_b/dx_i) + lambda Pi dN_a/dx_i Pi dN_b/dx_j
        K = shear * products.transpose(0, 1, 4, 3, 2)
        along = shear * np.einsum("eakbk->eab", products)
        for i in range(2):
            K[:, :, i, :, i] += along
        K = K.reshape(e, 2 * a, 2 * a) + first * moments.reshape(e, 3, 2 * a).transpose(0, 2, 1) @ projected
        return cls(g, w, (linear @ projected).reshape(g.shape), K)

    def couples(self) -> Float:
        """(e, 6, 6, 4) stiffness of the nodes, with (i, j) flat."""
        n = 2 * BUBBLE
        nodes = self.K[:, :n, :n] - self.K[:, :n, n:] @ self._follows()
        return np.asarray(nodes.reshape(-1, BUBBLE, 2, BUBBLE, 2).transpose(0, 1, 3, 2, 4).reshape(-1, 6, 6, 4))

    def with_bubble(self, u: Float) -> Float:
        """(e, 7, 2) displacements (e, 6, 2) and the bubble that they make."""
        bubble = -self._follows() @ u.reshape(len(u), 2 * BUBBLE, 1)
        return np.concatenate([u, bubble.reshape(-1, 1, 2)], axis=1)

    def _follows(self) -> Float:
        """(e, 2, 12) K_bb^-1 K_bu."""
        n = 2 * BUBBLE
        return np.linalg.solve(self.K[:, n:, n:], self.K[:, n:, :n])
