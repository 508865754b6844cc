"""Quadratic triangles with a cubic bubble and a linear pressure: what is inside them, given their nodes' displacements.

Of each element the five unknowns inside, bubble and pressure, are those that make

    int mu eps : eps + p tr eps - p^2 / (2 lambda)

stationary.  Written for the certificate alone, from the gradients of the quadratic functions N_a, which reproduce
barycentric coordinates: r_0 = N_0 + (N_3 + N_5) / 2 and so on.
"""

from __future__ import annotations

import numpy as np

from feti_homog.typing import Float

# r_a = N_a + half of the functions of the two sides at vertex a.
OF_NODES = np.array([[2, 0, 0, 1, 0, 1], [0, 2, 0, 1, 1, 0], [0, 0, 2, 0, 1, 1]]) / 2
# Components of normal stresses, by the number of all.
NORMAL = {3: [0, 1], 6: [0, 1, 2]}


def inner_fields(
    places: Float, gradients: Float, weights: Float, strain: Float, lame: Float
) -> tuple[Float, Float]:  # fmt: skip
    """Return (e, q, 2, 2) du_i/dx_d of the bubble, and (e, q) the pressure.

    Args:
        places: (q, 3) barycentric coordinates of the quadrature points.
        gradients, weights: (e, q, 6, 2) of the functions of the nodes, and (e, q).
        strain: (e, q, v) elastic strains of the displacements of the nodes.
        lame: (e, 2) lambda and mu.
    """
    first, shear = lame.T
    slopes = np.einsum("ab,eqbd->eqad", OF_NODES, gradients)
    of_bubble = np.einsum("qa,eqad->eqd", places[:, [1, 2, 0]] * places[:, [2, 0, 1]], slopes)
    square = np.einsum("eq,eqd,eqk->edk", weights, of_bubble, of_bubble)
    moment = np.einsum("eq,qm,eqd->emd", weights, places, of_bubble)
    matrix, right = np.zeros((len(weights), 5, 5)), np.zeros((len(weights), 5, 1))
    matrix[:, :2, :2] = square + np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(2)
    # The pressure over mu, so that both equations are of strains.
    matrix[:, :2, 2:], matrix[:, 2:, :2] = moment.transpose(0, 2, 1), (first / shear)[:, None, None] * moment
    matrix[:, 2:, 2:] = -np.einsum("eq,qm,qn->emn", weights, places, places)
    e11, e22, e12 = (strain[..., k] for k in (0, 1, -1))
    pulled = np.stack([2 * e11 * of_bubble[..., 0] + e12 * of_bubble[..., 1],
                       2 * e22 * of_bubble[..., 1] + e12 * of_bubble[..., 0]], axis=-1)  # fmt: skip
    right[:, :2, 0] = -np.einsum("eq,eqi->ei", weights, pulled)
    trace = strain[..., NORMAL[strain.shape[2]]].sum(axis=2)
    right[:, 2:, 0] = -(first / shear)[:, None] * np.einsum("eq,qm,eq->em", weights, places, trace)
    found = np.linalg.solve(matrix, right)[..., 0]
    return np.einsum("ei,eqd->eqid", found[:, :2], of_bubble), shear[:, None] * (found[:, 2:] @ places.T)
