"""Debonding and contact in displacements: the bodies of the torn cell by quadratic programming, slow and simple.

It shares the refined meshes with the program, nothing else.  Bonded nodes are one, debonded ones are two and,
with contact, obey n.(u_matrix - u_fibre) >= 0: clarabel minimises the energy, and a direct solve of the KKT
system with the constraints that it finds active makes the answer exact to rounding.
"""

from copy import copy
from dataclasses import dataclass

import clarabel
import numpy as np
from scipy.sparse import block_diag, bmat, coo_matrix, csc_matrix, csr_matrix, diags, hstack, identity, triu
from scipy.sparse.linalg import splu

from reference import monolithic

MOST_DEPTHS = 8  # by which places and depths are distinguished
EXACT = 1e-9  # relative, of the KKT conditions of an answer


@dataclass(frozen=True)
class State:
    """Energy, Sigma (3,), displacements (n, 2), and jumps and forces of the interface nodes.

    Gap and slip, and the force on the fibre, both (k, 2) in n and t; `closed` (k,) of the debonded nodes.
    """

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
    """The cell of round fibres made of meshed parts (points, triangles, body, depth, L, is_mixed).

    Elements may be mixed as in `monolithic`. The depth is how many interfaces are around a part: 0 of the matrix.
    `centres` (f, 2) are those of the fibres,
    `radii` (f,) or, of coated ones, (depths, f) those of the circles around depths 1, 2, ...; circle (d - 1) f + k is
    that of fibre k. Interface nodes are sorted by `key`; `matrix` and `fibre_node` are the outer and the inner node,
    `fibre` the circle.
    """

    def __init__(self, parts, centres, radii, size):
        self.size = np.array(size)
        labels = [np.stack([np.full(len(p), body), torus_keys(p, size)], axis=1) for p, _, body, *_ in parts]
        classes, number = np.unique(np.concatenate(labels), axis=0, return_inverse=True)
        first = np.cumsum([0] + [len(label) for label in labels])
        self.n = len(classes)
        self.points = np.zeros((self.n, 2))
        self.points[number.ravel()] = np.concatenate([p for p, *_ in parts])
        depth, middle = np.zeros(self.n, int), np.zeros(self.n, bool)
        self.mean, self.Q = np.zeros((3, 3)), np.zeros((2 * self.n, 3))
        rows, columns, values = [], [], []
        for (points, triangles, _, around, L, is_mixed), start in zip(parts, first, strict=False):
            nodes = number.ravel()[start:][triangles]
            depth[nodes] = around
            middle[nodes[:, 3:]] = True
            for own, corners in zip(nodes, points[triangles], strict=True):
                k, q, area = monolithic.element(corners, L, is_mixed)
                dofs = (2 * own[:, None] + [0, 1]).ravel()
                rows.append(np.repeat(dofs, len(dofs)))
                columns.append(np.tile(dofs, len(dofs)))
                values.append(k.ravel())
                np.add.at(self.Q, dofs, q)
                self.mean += area * L
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        self.K = coo_matrix(entries).tocsc()
        self.scale = self.K.diagonal().max()
        # A place has one node of each body that meets there.
        place = MOST_DEPTHS * classes[:, 1] + depth
        _, self.matrix, self.fibre_node = np.intersect1d(place + 1, place, return_indices=True)
        self.key, self.middle = classes[self.fibre_node, 1], middle[self.fibre_node]
        self.pinned = int(np.setdiff1d(np.flatnonzero(depth == 0), self.matrix)[0])
        self._place(depth, np.asarray(centres), np.atleast_2d(radii))

    def _place(self, depth, centres, radii):
        """Circles, normals and angles of the interface nodes, and the rigid motions (n, 2, circles, 3) of all nodes."""
        circle, arm = np.zeros(self.n, int), np.zeros((self.n, 2))
        for d, own in enumerate(radii, 1):
            inside = np.flatnonzero(depth == d)
            fibre, arm[inside] = nearest(self.points[inside], centres, own, self.size)
            circle[inside] = (d - 1) * len(centres) + fibre
        on, radius = self.fibre_node, radii.ravel()
        self.fibre, self.radius = circle[on], radius[circle[on]]
        self.normal = arm[on] / np.hypot(*arm[on].T)[:, None]
        self.angle = np.degrees(np.arctan2(*arm[on].T[::-1]))
        self.rigid = np.zeros((self.n, 2, radii.size, 3))
        own = np.flatnonzero(depth > 0)
        self.rigid[own, 0, circle[own], 0] = self.rigid[own, 1, circle[own], 1] = 1.0
        self.rigid[own, :, circle[own], 2] = arm[own][:, ::-1] * [-1, 1] / radius[circle[own], None]

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
        """Return the state under a strain (3,) with the `bonded` (k,) nodes held together."""
        T, reach = self._together(bonded), self.size.max() * np.abs(strain).max()
        free = np.flatnonzero(~bonded) if contact else np.zeros(0, int)
        K, f = (T.T @ self.K @ T).tocsc() / self.scale, -T.T @ (self.Q @ strain) / self.scale
        C = (self._gaps(free) @ T).tocsr()
        v, pressure = minimise(
            K, f, C, lambda active: rigid_motions(self.rigid, T, self._held(bonded), C[active]), reach
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
        """Return the same with springs of stiffnesses `springs` (normal, tangential), numbers or (k,).

        They are at bonded nodes, and normal ones in compression between debonded faces. The energy is that of the
        bodies and of the springs.
        """
        k, lengths = len(bonded), self.lengths()
        stiffness = [s * lengths for s in springs]
        free = np.flatnonzero(~bonded) if contact else np.zeros(0, int)
        T, reach = self._together(np.zeros(k, bool)), self.size.max() * np.abs(strain).max()
        stretched = [jumps[bonded] for jumps in (self._gaps(np.arange(k)), self._slips())]
        own = [J.T @ diags(s[bonded]) @ J for s, J in zip(stiffness, stretched, strict=True)]
        whole = (self.K + own[0] + own[1]).tocsc()
        # How far the springs of touching faces give way is an unknown of its own.
        K = block_diag([T.T @ whole @ T, diags(stiffness[0][free])]).tocsc() / self.scale
        f = np.r_[-T.T @ (self.Q @ strain), np.zeros(len(free))] / self.scale
        gaps = (self._gaps(free) @ T).tocsr()
        C = hstack([gaps, identity(len(free))]).tocsr()

        def motions(active):
            rigid = rigid_motions(self.rigid, T, self._held(bonded), gaps[active])
            return np.concatenate([rigid, np.zeros((len(free), rigid.shape[1]))])

        v, pressure = minimise(K, f, C, motions, reach)
        u, give = T @ v[: T.shape[1]], v[T.shape[1] :]
        energy = strain @ self.mean @ strain / 2 + strain @ self.Q.T @ u + u @ (whole @ u) / 2
        energy += stiffness[0][free] @ give**2 / 2
        stress = (self.mean @ strain + self.Q.T @ u) / self.size.prod()
        closed = np.zeros(k, bool)
        closed[free] = pressure > 0
        jump = np.stack([self._gaps(np.arange(k)) @ u, self._slips() @ u], axis=1)
        force = np.where(bonded, 1.0, 0.0)[:, None] * jump * np.stack(stiffness, axis=1)
        force[closed, 0] = stiffness[0][closed] * jump[closed, 0]
        return State(float(energy), stress, u.reshape(-1, 2), jump, force, closed)

    def _held(self, bonded):
        """(held, 2, circles, 3) how the rigid motions would part the bonded nodes."""
        return self.rigid[self.fibre_node[bonded]] - self.rigid[self.matrix[bonded]]

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
    """Return the circle to which each point is nearest, and the arm from its centre."""
    arm = points[:, None] - centres
    arm -= np.round(arm / size) * size
    fibre = np.argmin(np.hypot(*np.moveaxis(arm, 2, 0)) - radii, axis=1)
    return fibre, arm[np.arange(len(arm)), fibre]


def rigid_motions(rigid, T, held, C):
    """(free dofs, z) motions of the fibres that do not part what is held, and that no row of C resists.

    They are of all `rigid` (n, c, fibres, m); `held` (h, c, fibres, m) are held; T (cn, free dofs) are the
    displacements of all nodes.
    """
    n, c, fibres, m = rigid.shape
    v = (T.T @ rigid.reshape(n * c, fibres * m)) / np.maximum(T.T @ np.ones(c * n), 1.0)[:, None]
    resisted = np.concatenate([held.reshape(len(held) * c, fibres * m), C @ v, np.zeros((fibres * m,) * 2)])
    _, size, modes = np.linalg.svd(resisted, full_matrices=False)
    return np.asarray(v @ modes[size < 1e-9].T)


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
