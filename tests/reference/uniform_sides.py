"""Solve a refined cell under displacements or tractions on its sides directly, with SciPy.

It shares the mesh with the program, nothing else: element loops, three displacements a node, its own loads on sides.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

from reference.monolithic import rule, shape_gradients

SIDES = [0, 1, 3, 4, 5]
"""The strains of the sides among [11, 22, 33, 23, 13, 12]."""


def stiffness(points, triangles, laws, expansions, boundary, parts=None, bonds=()):
    """Solve for the apparent stiffness (6, 6) and thermal stress (6,) of a mesh.

    Elements `triangles` (m, 3 or 6) on `points` (n, 2) have `laws` (m, 6, 6), `expansions` (m, 6) and bodies `parts`
    (m,); nodes of one body at one place are one.  Bodies are tied but at `bonds`: rows of a place (2,), a stiffness
    (3, 3) of the jump, None of a tie, and both bodies.
    """
    parts = np.zeros(len(triangles), int) if parts is None else parts
    size = np.ptp(points, axis=0)
    low = points.min(axis=0)
    corner = np.column_stack([np.round((points - low) / size * 1e8).astype(np.int64)[triangles.ravel()],
                              np.repeat(parts, triangles.shape[1])])  # fmt: skip
    keys, node = np.unique(corner, axis=0, return_inverse=True)
    node = node.reshape(triangles.shape)
    n = len(keys)
    x = np.zeros((n, 2))
    x[node] = points[triangles]
    # Copies at a place are one node, unless a bond lies between them.
    number = {tuple(key): k for k, key in enumerate(keys.tolist())}
    place = np.unique(keys[:, :2], axis=0, return_inverse=True)[1].ravel()
    springs, apart = [], set()
    for where, K, one, other in bonds:
        at = tuple(np.round((np.asarray(where) - low) / size * 1e8).astype(np.int64).tolist())
        pair = number[(*at, one)], number[(*at, other)]
        apart.add(place[pair[0]])
        springs.append((pair, K))
    tied = place.copy()
    separate = np.flatnonzero(np.isin(place, list(apart)))
    tied[separate] = place.max() + 1 + np.arange(len(separate))
    tied = np.unique(tied, return_inverse=True)[1].ravel()
    N = int(tied.max()) + 1
    rows, columns, values = [], [], []
    loads, mean = np.zeros((3 * N, 7)), np.zeros((7, 7))
    for corners, C, alpha in zip(node, laws, expansions, strict=True):
        T = np.column_stack([np.eye(6), -alpha])
        A = T.T @ C @ T
        k, q, area = element(x[corners], A)
        dofs = (3 * tied[corners][:, None] + [0, 1, 2]).ravel()
        rows.append(np.repeat(dofs, len(dofs)))
        columns.append(np.tile(dofs, len(dofs)))
        values.append(k.ravel())
        np.add.at(loads, dofs, q)
        mean += area * A
    for pair, K in springs:
        if K is not None:
            dofs = (3 * tied[list(pair)][:, None] + [0, 1, 2]).ravel()
            rows.append(np.repeat(dofs, 6))
            columns.append(np.tile(dofs, 6))
            values.append(np.kron([[1, -1], [-1, 1]], K).ravel())
    K = coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))).tocsc()
    on_side = (np.isclose(x, low) | np.isclose(x, low + size)).any(axis=1)
    if boundary == "displacement":
        free = np.setdiff1d(np.arange(3 * N), (3 * np.unique(tied[on_side])[:, None] + [0, 1, 2]).ravel())
        u = np.zeros((3 * N, 7))
        u[free] = splu(K[free][:, free]).solve(-loads[free])
        C = (mean + loads.T @ u) / size.prod()
        return C[:6, :6], C[:6, 6]
    return under_tractions(
        K, loads, mean, side_loads(x, node, tied, low, size, N), x[np.unique(tied, return_index=True)[1]]
    )


def under_tractions(K, loads, mean, F, x):
    """Return the stiffness and the thermal stress by unit tractions with the loads F (3 N, 5) at nodes `x` (N, 2)."""
    others = [2, 6]  # E33 and the temperature
    right = np.hstack([F, -loads[:, others]])
    # Two nodes far apart hold the cell.
    first, size = int(np.argmin(x @ [1.0, 1.0])), np.ptp(x, axis=0)
    second = int(np.argmax(np.abs(x - x[first])[:, 0]))
    free = np.setdiff1d(np.arange(3 * len(x)), [3 * first, 3 * first + 1, 3 * first + 2, 3 * second + 1])
    u = np.zeros((3 * len(x), 7))
    u[free] = splu(K[free][:, free]).solve(right[free])
    strains = F.T @ u / size.prod()  # of the sides: (5, 7)
    stress = (loads[:, others].T @ u + np.hstack([np.zeros((2, 5)), mean[np.ix_(others, others)]])) / size.prod()
    # strains = A [Sigma, others]; with given strains Sigma follows.
    compliance, free_strains = strains[:, :5], strains[:, 5:]
    sigma = np.linalg.solve(compliance, np.hstack([np.eye(5), -free_strains]))
    C = np.zeros((7, 7))
    order = [*SIDES, *others]
    C[np.ix_(SIDES, order)] = sigma
    C[np.ix_(others, order)] = stress[:, :5] @ sigma + np.hstack([np.zeros((2, 5)), stress[:, 5:]])
    return C[:6, :6], C[:6, 6]


def side_loads(x, node, tied, low, size, N):
    """Integrate the loads (3 N, 5) of tractions Sigma n on the sides, with unit stresses 11, 22, 23, 13, 12."""
    F, a = np.zeros((3 * N, 5)), node.shape[1]
    weights = [0.5, 0.5] if a == 3 else [1 / 6, 1 / 6, 2 / 3]
    for corners in node:
        for k in range(3):
            side = [corners[k], corners[(k + 1) % 3], *([corners[3 + k]] if a == 6 else [])]
            for axis in (0, 1):
                for level, sign in ((low, -1.0), (low + size, 1.0)):
                    if np.allclose(x[side, axis], level[axis], atol=1e-9 * size.max()):
                        length = np.linalg.norm(x[side[1]] - x[side[0]])
                        n = sign * np.eye(2)[axis]
                        # Rows of t = Sigma n: t1, t2, t3.
                        t = np.array([[n[0], 0, 0, 0, n[1]], [0, n[1], 0, 0, n[0]], [0, 0, n[1], n[0], 0]])
                        for one, w in zip(side, weights, strict=True):
                            F[3 * tied[one] : 3 * tied[one] + 3] += w * length * t
    return F


def element(corners, A):
    """Stiffness (3 a, 3 a), loads (3 a, 7) and area of a triangle with the law (7, 7) of six strains and T."""
    a = len(corners)
    k, q, area = np.zeros((3 * a, 3 * a)), np.zeros((3 * a, 7)), 0.0
    for xi, eta, w in rule(6 if a == 6 else 1):
        g = shape_gradients(a, xi, eta)
        J = g.T @ corners
        dN = g @ np.linalg.inv(J).T
        B = np.zeros((7, 3 * a))
        B[0, 0::3], B[1, 1::3], B[5, 0::3], B[5, 1::3] = dN[:, 0], dN[:, 1], dN[:, 1], dN[:, 0]
        B[3, 2::3], B[4, 2::3] = dN[:, 1], dN[:, 0]
        weight = w * np.linalg.det(J)
        k += weight * B.T @ A @ B
        q += weight * B.T @ A
        area += weight
    return k, q, area
