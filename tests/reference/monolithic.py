"""The bonded cell without tearing: one monolithic, periodic direct solve of the same refined mesh, with SciPy alone.

It shares the mesh with the program, nothing else: dense element loops, its own quadrature, its own periodic
elimination.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu


def effective_stiffness(points, triangles, stiffness, width, height, mixed):
    """L^ef (3, 3) of elements `triangles` (m, 3 or 6) on `points`, with `stiffness` (m, 3, 3) of each.

    Those of `mixed` (m,) have a bubble and a pressure.
    """
    node, n = periodic_numbers(points, width, height)
    rows, columns, values, loads = [], [], [], np.zeros((2 * n, 3))
    mean = np.zeros((3, 3))
    for corners, L, is_mixed in zip(triangles, stiffness, mixed, strict=True):
        k, q, area = element(points[corners], L, is_mixed)
        dofs = (2 * node[corners][:, None] + [0, 1]).ravel()
        rows.append(np.repeat(dofs, len(dofs)))
        columns.append(np.tile(dofs, len(dofs)))
        values.append(k.ravel())
        np.add.at(loads, dofs, q)
        mean += area * L
    K = coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))).tocsc()
    u = np.zeros((2 * n, 3))
    u[2:] = splu(K[2:, 2:]).solve(-loads[2:])
    return (mean + loads.T @ u) / (width * height)


def periodic_numbers(points, width, height):
    """Assign a number to the class of each node, by rounded position modulo the periods.

    Returns the number of classes too.
    """
    period = np.array([width, height])
    reduced = np.round(points / period * 1e8).astype(np.int64) % 10**8
    # Torn copies have the same position, so they become one node here.
    classes, number = np.unique(reduced, axis=0, return_inverse=True)
    return number.ravel(), len(classes)


def element(corners, L, is_mixed=False):
    """Stiffness, load int B^T L and area of one triangle with 3 or 6 nodes, or of a mixed one with 6."""
    a = len(corners)
    k, q, area = np.zeros((2 * a, 2 * a)), np.zeros((2 * a, 3)), 0.0
    for x, y, w in rule(6 if a == 6 else 1):
        g = shape_gradients(a, x, y)
        J = g.T @ corners
        dN = g @ np.linalg.inv(J).T
        B = np.zeros((3, 2 * a))
        B[0, 0::2], B[1, 1::2], B[2, 0::2], B[2, 1::2] = dN[:, 0], dN[:, 1], dN[:, 1], dN[:, 0]
        weight = w * np.linalg.det(J)
        k += weight * B.T @ L @ B
        q += weight * B.T @ L
        area += weight
    return (mixed_stiffness(corners, L) if is_mixed else k), q, area


def mixed_stiffness(corners, L):
    """Stiffness (12, 12) of 6 nodes with a bubble and a linear pressure p.

    int 2 mu eps : eps + 2 p div u - p^2 / lambda is stationary in both.
    """
    lame, shear = L[0, 1], L[2, 2]
    A = np.zeros((17, 17))
    for x, y, w in rule(6):
        g = np.vstack([shape_gradients(6, x, y), 27 * np.array([y * (1 - 2 * x - y), x * (1 - x - 2 * y)])])
        J = g[:6].T @ corners
        dN = g @ np.linalg.inv(J).T
        weight, pressure = w * np.linalg.det(J), np.array([1.0, x - 1 / 3, y - 1 / 3])
        for i in range(2):
            A[i:14:2, i:14:2] += weight * shear * dN @ dN.T
            for j in range(2):
                A[i:14:2, j:14:2] += weight * shear * np.outer(dN[:, j], dN[:, i])
            A[i:14:2, 14:] += weight * np.outer(dN[:, i], pressure)
        A[14:, 14:] -= weight * np.outer(pressure, pressure)
    A[14:, :14] = lame * A[:14, 14:].T
    return A[:12, :12] - A[:12, 12:] @ np.linalg.solve(A[12:, 12:], A[12:, :12])


def shape_gradients(a, x, y):
    """Gradients (a, 2) of the barycentric shape functions in the reference triangle."""
    b = np.array([1 - x - y, x, y])
    db = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    if a == 3:
        return db
    corner = (4 * b - 1)[:, None] * db
    middle = [4 * (b[i] * db[j] + b[j] * db[i]) for i, j in ((0, 1), (1, 2), (2, 0))]
    return np.concatenate([corner, middle])


def rule(points):
    """(x, y, weight) of the centroid rule, or the 6-point rule of degree 4 from its closed form.

    On curved elements the rule is part of the discretization, so the degree is that of the program.
    """
    if points == 1:
        return [(1 / 3, 1 / 3, 0.5)]
    s = np.sqrt(38 - 44 * np.sqrt(2 / 5))
    t = np.sqrt(213125 - 53320 * np.sqrt(10))
    found = []
    for sign in (1, -1):
        c = (8 - np.sqrt(10) + sign * s) / 18
        w = (620 + sign * t) / 7440
        found += [(c, c, w), (1 - 2 * c, c, w), (c, 1 - 2 * c, w)]
    return found
