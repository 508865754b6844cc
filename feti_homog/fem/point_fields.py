"""Strains and stresses of elements at their quadrature points, with the bubble and the pressure of mixed ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.fem import bubble
from feti_homog.fem.shape_functions import gradients
from feti_homog.typing import Float


@dataclass(frozen=True)
class PointFields:
    """Fields of e elements at q points each, in the order [11, 22, 12].

    Attributes:
        gradients, weights: (e, q, a, 2) of the shape functions, of mixed elements the bubble's last, and (e, q).
        u: (e, a, 2) displacements, of mixed elements with that of the bubble.
        strain, stress: (e, q, 3).
        density: (e, q) W whose integral is the strain energy: sigma : eps / 2, and p (div u - p / lambda) / 2 in
            mixed elements.
    """

    gradients: Float
    weights: Float
    u: Float
    strain: Float
    stress: Float
    density: Float


def point_fields(points: Float, u: Float, L: Float, is_mixed: bool = False) -> PointFields:
    """Fields of elements of nodes and displacements (e, a, 2) and of the stiffness L (3, 3)."""
    if not is_mixed:
        g, weights = gradients(points)
        strain = voigt(np.einsum("eai,eqad->eqid", u, g))
        stress = strain @ L
        return PointFields(g, weights, u, strain, stress, (stress * strain).sum(axis=2) / 2)
    elements = bubble.Elements.of(points, L)
    inner = elements.with_bubble(u[..., None])
    strain, stress, mean = (found(inner)[..., 0] for found in (elements.strain, elements.stress, elements.dilatation))
    off = strain[..., 0] + strain[..., 1] - mean
    density = ((stress * strain).sum(axis=2) + elements.lame[0] * mean * off) / 2
    return PointFields(elements.gradients, elements.weights, inner[..., 0], strain, stress, density)


def voigt(gradient: Float) -> Float:
    """(e, q, 3) strains [11, 22, 12] of displacement gradients (e, q, 2, 2)."""
    shear = gradient[..., 0, 1] + gradient[..., 1, 0]
    return np.stack([gradient[..., 0, 0], gradient[..., 1, 1], shear], axis=-1)
