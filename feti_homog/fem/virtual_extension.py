"""How the strain energy of elements changes when their nodes are moved: what a crack that grows releases."""

from __future__ import annotations

import numpy as np

from feti_homog.fem.shape_functions import gradients
from feti_homog.typing import Float


def energy_change(points: Float, u: Float, L: Float, moved: Float, changed: Float) -> float:
    """d/ds of sum_e int W at s = 0 where nodes lie at x + s dx and have the displacements u + s du:

        int sigma : (grad du - grad u grad dx) + W div dx,  sigma = L eps(u),  W = sigma : eps(u) / 2.

    Exact for the elements as they are (deLorenzi, Int. J. Fract. 19 (1982) 183).

    Args:
        points, u: (e, a, 2) nodes of the elements and their displacements.
        L: (3, 3) stiffness.
        moved, changed: (e, a, 2) dx and du.
    """
    g, weight = gradients(points)
    grad_u, grad_moved, grad_changed = (np.einsum("eai,eqad->eqid", field, g) for field in (u, moved, changed))
    strain = _voigt(grad_u)
    stress = strain @ L
    change = _voigt(grad_changed - grad_u @ grad_moved)
    density = (stress * change).sum(axis=2) + (stress * strain).sum(axis=2) / 2 * np.trace(grad_moved, axis1=2, axis2=3)
    return float((weight * density).sum())


def _voigt(gradient: Float) -> Float:
    """(e, q, 3) strains [11, 22, 12] of displacement gradients (e, q, 2, 2)."""
    shear = gradient[..., 0, 1] + gradient[..., 1, 0]
    return np.stack([gradient[..., 0, 0], gradient[..., 1, 1], shear], axis=-1)
