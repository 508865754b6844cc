"""Change of the strain energy of elements when their nodes are moved, which a growing crack releases."""

from __future__ import annotations

import numpy as np

from feti_homog.fem.point_fields import point_fields, voigt
from feti_homog.typing import Float


def energy_change(points: Float, u: Float, L: Float, moved: Float, changed: Float, is_mixed: bool = False) -> float:
    """d/ds of sum_e int W at s = 0 where nodes lie at x + s dx and have the displacements u + s du:

        int sigma : (grad du - grad u grad dx) + W div dx.

    Exact for the elements as they are (deLorenzi, Int. J. Fract. 19 (1982) 183): at the bubble and the pressure of
    mixed ones, which stay as they are, the energy is stationary.

    Args:
        points, u: (e, a, 2) nodes of the elements and their displacements.
        L: (3, 3) stiffness.
        moved, changed: (e, a, 2) dx and du.
        is_mixed: whether the elements have a bubble and a pressure of their own.
    """
    fields, nodes = point_fields(points, u, L, is_mixed), points.shape[1]
    grad_u = np.einsum("eai,eqad->eqid", fields.u, fields.gradients)
    of_nodes = fields.gradients[:, :, :nodes]
    grad_moved, grad_changed = (np.einsum("eai,eqad->eqid", field, of_nodes) for field in (moved, changed))
    change = (fields.stress * voigt(grad_changed - grad_u @ grad_moved)).sum(axis=2)
    return float((fields.weights * (change + fields.density * np.trace(grad_moved, axis1=2, axis2=3))).sum())
