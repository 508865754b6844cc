"""Element fields at quadrature points, also of mixed elements, and the energy change of moved nodes.

A growing crack releases the energy that elements lose if their nodes move.
"""

from dataclasses import dataclass

import numpy as np

from feti_homog.fem.shape_functions import MixedElements, gradients
from feti_homog.typing import Float


@dataclass(frozen=True)
class PointFields:
    """The fields in e elements at q quadrature points, with components in the order [11, 22, 12].

    Attributes:
        gradients, weights: gradients (e, q, a, 2) of the shape functions, a bubble last, and weights (e, q).
        u: (e, a, 2) displacements, in mixed elements also of the bubble.
        strain, stress: (e, q, 3) strains and stresses.
        density: (e, q) strain energy density: sigma : eps / 2, plus p (div u - p / lambda) / 2 in mixed elements.
    """

    gradients: Float
    weights: Float
    u: Float
    strain: Float
    stress: Float
    density: Float


def point_fields(points: Float, u: Float, L: Float, is_mixed: bool = False) -> PointFields:
    """Compute the fields in elements with nodes and displacements (e, a, 2), and with the stiffness L (3, 3)."""
    if not is_mixed:
        g, weights = gradients(points)
        strain = voigt(np.einsum("eai,eqad->eqid", u, g))
        stress = strain @ L
        return PointFields(g, weights, u, strain, stress, (stress * strain).sum(axis=2) / 2)
    elements = MixedElements.of(points, L)
    inner = elements.with_bubble(u[..., None])
    strain, stress, mean = (field(inner)[..., 0] for field in (elements.strain, elements.stress, elements.dilatation))
    off = strain[..., 0] + strain[..., 1] - mean
    density = ((stress * strain).sum(axis=2) + elements.lame[0] * mean * off) / 2
    return PointFields(elements.gradients, elements.weights, inner[..., 0], strain, stress, density)


def voigt(gradient: Float) -> Float:
    """Return the strains [11, 22, 12] (e, q, 3) of displacement gradients (e, q, 2, 2)."""
    shear = gradient[..., 0, 1] + gradient[..., 1, 0]
    return np.stack([gradient[..., 0, 0], gradient[..., 1, 1], shear], axis=-1)


def energy_change(points: Float, u: Float, L: Float, moved: Float, changed: Float, is_mixed: bool = False) -> float:
    """Compute the energy rate of elements whose nodes and displacements change.

    With nodes at x + s dx and displacements u + s du, the rate d/ds sum_e int W at s = 0 is

        int sigma : (grad du - grad u grad dx) + W div dx,

    exact for the discrete elements (deLorenzi, Int. J. Fract. 19 (1982) 183): the bubble and the pressure of mixed
    elements stay constant, because the energy is stationary in both.

    Args:
        points, u: (e, a, 2) element nodes and their displacements.
        L: (3, 3) stiffness.
        moved, changed: (e, a, 2) dx and du.
        is_mixed: whether the elements have a bubble and a pressure.
    """
    fields, nodes = point_fields(points, u, L, is_mixed), points.shape[1]
    grad_u = np.einsum("eai,eqad->eqid", fields.u, fields.gradients)
    of_nodes = fields.gradients[:, :, :nodes]
    grad_moved, grad_changed = (np.einsum("eai,eqad->eqid", field, of_nodes) for field in (moved, changed))
    change = (fields.stress * voigt(grad_changed - grad_u @ grad_moved)).sum(axis=2)
    return float((fields.weights * (change + fields.density * np.trace(grad_moved, axis1=2, axis2=3))).sum())
