"""Debonding and contact in displacements: the bodies of the torn cell by quadratic programming, slow and simple.

It shares the refined meshes with the program, nothing else.  Bonded nodes are one, debonded ones are two and,
with contact, obey n.(u_matrix - u_fibre) >= 0: clarabel minimises the energy, and a direct solve of the KKT
system with the constraints that it finds active makes the answer exact to rounding.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import clarabel
import numpy as np
from scipy.sparse import block_diag, bmat, coo_matrix, csc_matrix, csr_matrix, diags, hstack, identity, triu
from scipy.sparse.linalg import splu

from reference import monolithic

EXACT = 1e-9  # relative, of the KKT conditions of an answer


@dataclass(frozen=True)
class State:
    """Energy, Sigma (3,), displacements (n, 2), and of the interface nodes: gap and slip, and the force on the
    fibre, both (k, 2) in n and t; `closed` (k,) of the debonded nodes."""

    energy: float
    stress: np.ndarray
    u: np.ndarray
    jump: np.ndarray
    force: np.ndarray
    closed: np.ndarray


def torus_keys(points, size):
    """One integer for each position on the torus."""
    reduced = np.round(points / size * 1e8).astype(np.int64) % 10**8
    return reduced[:, 0] * 10**8 + reduced[:, 1]


class QuadraticProgramme:
    """The cell of round fibres made of meshed parts (points, triangles, body, is matrix, L).

    `centres` and `radii` are those of the fibres; interface nodes are sorted by `key`.
    """

    def __init__(self, parts, centres, radii, size):
        self.size = np.array(size)
        labels = [np.stack([np.full(len(p), body), torus_keys(p, size)], axis=1) for p, _, body, _, _ in parts]
        classes, number = np.unique(np.concatenate(labels), axis=0, return_inverse=True)
        first = np.cumsum([0] + [len(label) for label in labels])
        self.n = len(classes)
        self.points = np.zeros((self.n, 2))
        self.points[number.ravel()] = np.concatenate([p for p, *_ in parts])
        matrix, middle = np.zeros(self.n, bool), np.zeros(self.n, bool)
        self.mean, self.Q = np.zeros((3, 3)), np.zeros((2 * self.n, 3))
        rows, columns, values = [], [], []
        for (points, triangles, _, is_matrix, L), start in zip(parts, first, strict=False):
            nodes = number.ravel()[start:][triangles]
            matrix[nodes] = is_matrix
            middle[nodes[:, 3:]] = True
            for own, corners in zip(nodes, points[triangles], strict=True):
                k, q, area = monolithic.element(corners, L)
                dofs = (2 * own[:, None] + [0, 1]).ravel()
                rows.append(np.repeat(dofs, len(dofs)))
                columns.append(np.tile(dofs, len(dofs)))
                values.append(k.ravel())
                np.add.at(self.Q, dofs, q)
                self.mean += area * L
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        self.K = coo_matrix(entries).tocsc()
        self.scale = self.K.diagonal().max()
        _, on_matrix, on_fibre = np.intersect1d(
            np.where(matrix, classes[:, 1], -1), np.where(matrix, -2, classes[:, 1]), return_indices=True
        )
        self.matrix, self.fibre_node = on_matrix, on_fibre
        self.key, self.middle = classes[on_fibre, 1], middle[on_fibre]
        self.pinned = int(np.setdiff1d(np.flatnonzero(matrix), on_matrix)[0])
        fibre, arm = nearest(self.points, np.asarray(centres), np.asarray(radii), self.size)
        self.fibre, self.radius = fibre[on_fibre], np.asarray(radii)[fibre[on_fibre]]
        self.normal = arm[on_fibre] / np.hypot(*arm[on_fibre].T)[:, None]
        self.angle = np.degrees(np.arctan2(*arm[on_fibre].T[::-1]))
        self.rigid = np.zeros((self.n, 2, len(radii), 3))
        own = np.flatnonzero(~matrix)
        self.rigid[own, 0, fibre[own], 0] = self.rigid[own, 1, fibre[own], 1] = 1.0
        self.rigid[own, :, fibre[own], 2] = arm[own][:, ::-1] * [-1, 1] / np.asarray(radii)[fibre[own], None]

    def lengths(self):
        """(k,) tributary arc lengths: halves of the arcs between linear nodes, Simpson's shares of quadratic ones."""
        result = np.zeros(len(self.key))
        for f in np.unique(self.fibre):
            own = np.flatnonzero((self.fibre == f) & ~self.middle)
            own = own[np.argsort(self.angle[own])]
            arc = np.radians(np.diff(self.angle[own], append=self.angle[own[0]] + 360)) * self.radius[own]
            vertex = 1 / 6 if self.middle.any() else 1 / 2
            result[own] = vertex * (arc + np.roll(arc, 1))
            middles = np.flatnonzero((self.fibre == f) & self.middle)
            before = np.searchsorted(self.angle[own], self.angle[middles]) - 1
            result[middles] = 4 / 6 * arc[before]
        return result

    def solve(self, strain, bonded, contact):
        """The state under a strain (3,) with the `bonded` (k,) nodes held together."""
        T, reach = self._together(bonded), self.size.max() * np.abs(strain).max()
        free = np.flatnonzero(~bonded) if contact else np.zeros(0, int)
        K, f = (T.T @ self.K @ T).tocsc() / self.scale, -T.T @ (self.Q @ strain) / self.scale
        C = (self._gaps(free) @ T).tocsr()
        v, pressure = minimise(
            K, f, C, lambda active: rigid_motions(self.rigid, T, self.fibre_node[bonded], C[active]), reach
        )
        u = T @ v
        residual = self.K @ u + self.Q @ strain
        energy = strain @ self.mean @ strain / 2 + strain @ self.Q.T @ u + u @ (self.K @ u) / 2
        stress = (self.mean @ strain + self.Q.T @ u) / self.size.prod()
        closed = np.zeros(len(bonded), bool)
        closed[free] = pressure > 0
        frame = np.stack([self.normal, self.normal[:, ::-1] * [-1, 1]], axis=1)
        u, residual = u.reshape(-1, 2), residual.reshape(-1, 2)
        apart = u[self.matrix] - u[self.fibre_node]
        turned = [np.einsum("kij,kj->ki", frame, x) for x in (apart, residual[self.fibre_node])]
        return State(float(energy), stress, u, *turned, closed)

    def solve_elastic(self, strain, bonded, contact, springs):
        """The same with springs of the stiffnesses `springs` (normal, tangential) at bonded nodes, and normal ones in
        compression between debonded faces.  The energy is that of the bodies and of the springs."""
        lengths, k = self.lengths(), len(bonded)
        free = np.flatnonzero(~bonded) if contact else np.zeros(0, int)
        T, reach = self._together(np.zeros(k, bool)), self.size.max() * np.abs(strain).max()
        stretched = [jumps[bonded] for jumps in (self._gaps(np.arange(k)), self._slips())]
        own = [J.T @ diags(s * lengths[bonded]) @ J for s, J in zip(springs, stretched, strict=True)]
        whole = (self.K + own[0] + own[1]).tocsc()
        # How far the springs of touching faces give way is an unknown of its own.
        K = block_diag([T.T @ whole @ T, diags(springs[0] * lengths[free])]).tocsc() / self.scale
        f = np.r_[-T.T @ (self.Q @ strain), np.zeros(len(free))] / self.scale
        gaps = (self._gaps(free) @ T).tocsr()
        C = hstack([gaps, identity(len(free))]).tocsr()

        def motions(active):
            rigid = rigid_motions(self.rigid, T, self.fibre_node[bonded], gaps[active])
            return np.concatenate([rigid, np.zeros((len(free), rigid.shape[1]))])

        v, pressure = minimise(K, f, C, motions, reach)
        u, give = T @ v[: T.shape[1]], v[T.shape[1] :]
        energy = strain @ self.mean @ strain / 2 + strain @ self.Q.T @ u + u @ (whole @ u) / 2
        energy += springs[0] * lengths[free] @ give**2 / 2
        stress = (self.mean @ strain + self.Q.T @ u) / self.size.prod()
        closed = np.zeros(k, bool)
        closed[free] = pressure > 0
        jump = np.stack([self._gaps(np.arange(k)) @ u, self._slips() @ u], axis=1)
        force = np.where(bonded, 1.0, 0.0)[:, None] * jump * springs * lengths[:, None]
        force[closed, 0] = springs[0] * lengths[closed] * jump[closed, 0]
        return State(float(energy), stress, u.reshape(-1, 2), jump, force, closed)

    def _together(self, bonded):
        """(2n, free dofs) displacements of all nodes from those that are free; bonded nodes move as one."""
        number = np.arange(self.n)
        number[self.fibre_node[bonded]] = self.matrix[bonded]
        kept = np.setdiff1d(number, self.pinned)
        node = np.flatnonzero(number != self.pinned)
        rows = (2 * node[:, None] + [0, 1]).ravel()
        columns = (2 * np.searchsorted(kept, number[node])[:, None] + [0, 1]).ravel()
        return csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(2 * self.n, 2 * len(kept)))

    def _slips(self):
        """Rows t.(u_matrix - u_fibre) of all interface nodes."""
        turned = copy(self)
        turned.normal = self.normal[:, ::-1] * [-1, 1]
        return turned._gaps(np.arange(len(self.key)))

    def _gaps(self, which):
        """Rows n.(u_matrix - u_fibre) of the interface nodes `which`."""
        k = len(which)
        nodes = np.stack([self.matrix[which], self.fibre_node[which]], axis=1)
        columns = (2 * nodes[:, :, None] + [0, 1]).reshape(k, 4)
        values = np.concatenate([self.normal[which], -self.normal[which]], axis=1)
        rows = np.repeat(np.arange(k), 4)
        return csr_matrix((values.ravel(), (rows, columns.ravel())), shape=(k, 2 * self.n))


def nearest(points, centres, radii, size):
    """The circle to which each point is nearest, and the arm from its centre."""
    arm = points[:, None] - centres
    arm -= np.round(arm / size) * size
    fibre = np.argmin(np.hypot(*np.moveaxis(arm, 2, 0)) - radii, axis=1)
    return fibre, arm[np.arange(len(arm)), fibre]


def rigid_motions(rigid, T, held, C):
    """(free dofs, z) motions of the fibres, of those `rigid` (n, c, fibres, m), that neither one of the nodes `held`
    nor a row of C resists; T (cn, free dofs) are the displacements of all nodes."""
    n, c, fibres, m = rigid.shape
    motions = [np.zeros((T.shape[1], 0))]
    for f in range(fibres):
        v = (T.T @ rigid[:, :, f].reshape(c * n, m)) / np.maximum(T.T @ np.ones(c * n), 1.0)[:, None]
        resisted = np.concatenate([rigid[held, :, f].reshape(-1, m), C @ v, np.zeros((m, m))])
        _, size, modes = np.linalg.svd(resisted, full_matrices=False)
        motions.append(v @ modes[size < 1e-9].T)
    return np.concatenate(motions, axis=1)


def minimise(K, f, C, free_motions, reach):
    """min v.K.v / 2 - f.v, C v >= 0: v and the forces of the constraints; gaps up to EXACT * reach are zero.

    `free_motions` gives the null vectors of K on the active constraints.
    """
    active, v, unit = np.zeros(C.shape[0], bool), np.zeros(len(f)), np.abs(f).max() or 1.0
    if C.shape[0]:
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
        cones = [clarabel.NonnegativeConeT(C.shape[0])]
        problem = triu(K, format="csc"), -f / unit, csc_matrix(-C), np.zeros(C.shape[0]), cones
        found = clarabel.DefaultSolver(*problem, settings).solve()
        v, s, z = unit * np.array(found.x), np.array(found.s), np.array(found.z)
        active = z * reach > s * unit
    for _ in range(50):
        v, own = _bordered(K, f, C[active], free_motions(active), v)
        force = np.zeros(C.shape[0])
        force[active] = own
        pulled = force < -EXACT * max(np.abs(force).max(initial=0.0), EXACT * unit)
        overlap = ~active & (C @ v < -EXACT * reach)
        if not (pulled | overlap).any():
            return v, force
        active = (active & ~pulled) | overlap
    raise AssertionError("no state of contact is found")


def _bordered(K, f, C, motions, v):
    """K v - C^T force = f, C v = 0 by a direct solve that leaves the amplitudes of free motions as they are in v."""
    n, m = len(f), C.shape[0]
    matrix = bmat([[K, -C.T, csr_matrix(motions)], [-C, csr_matrix((m, m)), None], [csr_matrix(motions.T), None, None]])
    factor = splu(matrix.tocsc())
    b = np.r_[f, np.zeros(m), motions.T @ v]
    x = factor.solve(b)
    x += factor.solve(b - matrix @ x)
    return x[:n], x[n : n + m]
