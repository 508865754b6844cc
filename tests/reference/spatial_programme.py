"""Fibre composites in space on a plane mesh, with three displacements a node: one sparse system, bonded or not.

u = (u1, u2, u3)(x1, x2) with all six strains and a temperature as loads.  It shares the refined meshes of the torn
cell with the program, nothing else; contact is found as in `quadratic_programme`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import block_diag, coo_matrix, csr_matrix, diags, hstack, identity

from reference import monolithic
from reference.quadratic_programme import QuadraticProgramme, minimise, nearest, rigid_motions, torus_keys

LOADS = 7  # six strains and a temperature
PLANE = [0, 1, 5]


@dataclass(frozen=True)
class Part:
    """A meshed piece of a body: points (n, 2), triangles (m, 3 or 6), C (6, 6), and expansion (6,)."""

    points: np.ndarray
    triangles: np.ndarray
    body: int
    is_matrix: bool
    C: np.ndarray
    alpha: np.ndarray


def elements(corners, C, alpha, is_mixed):
    """K (m, 3a, 3a), loads Q (m, 3a, 7) and areas (m,) of triangles with corners (m, a, 2); isotropic if mixed."""
    m, a, _ = corners.shape
    imposed = np.column_stack([np.eye(6), -alpha])
    K, Q, area = np.zeros((m, 3 * a, 3 * a)), np.zeros((m, 3 * a, LOADS)), np.zeros(m)
    for x, y, w in monolithic.rule(6 if a == 6 else 1):
        g = monolithic.shape_gradients(a, x, y)
        J = np.einsum("ai,mak->mik", g, corners)
        d1, d2 = np.moveaxis(np.einsum("ai,mki->mak", g, np.linalg.inv(J)), 2, 0)
        B = np.zeros((m, 6, 3 * a))
        B[:, 0, 0::3] = B[:, 5, 1::3] = B[:, 4, 2::3] = d1
        B[:, 1, 1::3] = B[:, 5, 0::3] = B[:, 3, 2::3] = d2
        weight = w * np.linalg.det(J)
        K += np.einsum("m,mip,ij,mjq->mpq", weight, B, C, B, optimize=True)
        Q += np.einsum("m,mip,ij->mpj", weight, B, C @ imposed, optimize=True)
        area += weight
    if is_mixed:
        plane = np.flatnonzero(np.arange(3 * a) % 3 < 2)
        L = C[np.ix_(PLANE, PLANE)]
        K[:, plane[:, None], plane] = [monolithic.mixed_stiffness(own, L) for own in corners]
    return K, Q, area


def is_isotropic(C):
    """Return whether a stiffness (6, 6) is that of an isotropic material."""
    expected = np.diag([2.0, 2, 2, 1, 1, 1]) * C[3, 3]
    expected[:3, :3] += C[0, 1]
    return np.allclose(C, expected, rtol=1e-12)


class SpatialProgramme:
    """The cell of parts; with `centres` and `radii` of round fibres it has the interface nodes, sorted by `key`."""

    lengths = QuadraticProgramme.lengths

    def __init__(self, parts, size, centres=(), radii=()):
        self.size = np.array(size)
        labels = [np.stack([np.full(len(p.points), p.body), torus_keys(p.points, size)], axis=1) for p in parts]
        classes, number = np.unique(np.concatenate(labels), axis=0, return_inverse=True)
        first = np.cumsum([0] + [len(label) for label in labels])
        self.n = len(classes)
        self.points = np.zeros((self.n, 2))
        self.points[number.ravel()] = np.concatenate([p.points for p in parts])
        matrix, middle = np.zeros(self.n, bool), np.zeros(self.n, bool)
        self.mean, self.Q, entries = np.zeros((LOADS, LOADS)), np.zeros((3 * self.n, LOADS)), []
        for part, start in zip(parts, first, strict=False):
            nodes = number.ravel()[start:][part.triangles]
            matrix[nodes], middle[nodes[:, 3:]] = part.is_matrix, True
            k, q, area = elements(
                part.points[part.triangles], part.C, part.alpha, part.triangles.shape[1] == 6 and is_isotropic(part.C)
            )  # fmt: skip
            dofs = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), -1)
            np.add.at(self.Q, dofs, q)
            entries.append(
                (k.ravel(), np.repeat(dofs, dofs.shape[1], axis=1).ravel(), np.tile(dofs, dofs.shape[1]).ravel())
            )
            imposed = np.column_stack([np.eye(6), -part.alpha])
            self.mean += area.sum() * imposed.T @ part.C @ imposed
        values, rows, columns = (np.concatenate(x) for x in zip(*entries, strict=True))
        self.K = coo_matrix((values, (rows, columns)), (3 * self.n, 3 * self.n)).tocsc()
        self.scale = self.K.diagonal().max()
        _, self.matrix, self.fibre_node = np.intersect1d(
            np.where(matrix, classes[:, 1], -1), np.where(matrix, -2, classes[:, 1]), return_indices=True
        )
        self.key, self.middle = classes[self.fibre_node, 1], middle[self.fibre_node]
        self.pinned = int(np.setdiff1d(np.flatnonzero(matrix), self.matrix)[0])
        self.rigid = np.zeros((self.n, 3, 0, 4))
        if len(radii):
            self._place(np.asarray(centres), np.asarray(radii), np.flatnonzero(~matrix))

    def _place(self, centres, radii, inside):
        """Find normals and angles of the interface nodes, and rigid motions (n, 3, fibres, 4) of the nodes `inside`."""
        fibre, arm = nearest(self.points, centres, radii, self.size)
        on = self.fibre_node
        self.fibre, self.radius = fibre[on], radii[fibre[on]]
        self.normal = arm[on] / np.hypot(*arm[on].T)[:, None]
        self.angle = np.degrees(np.arctan2(*arm[on].T[::-1]))
        self.rigid = np.zeros((self.n, 3, len(radii), 4))
        for i in range(3):
            self.rigid[inside, i, fibre[inside], i] = 1.0
        self.rigid[inside, :2, fibre[inside], 3] = arm[inside][:, ::-1] * [-1, 1] / radii[fibre[inside], None]

    def secants(self, sign=1.0, bonded=None, contact=False, springs=None):
        """(7, 7) columns: sign times what works on each load under sign times each unit load.

        The nodes where `bonded` (k,) is true are glued, or tied by the `springs` (normal, tangential[, axial])."""
        bonded = np.ones(len(self.key), bool) if bonded is None else bonded
        columns = [sign * self.stress(sign * load, bonded, contact, springs) for load in np.eye(LOADS)]
        return np.array(columns).T

    def stress(self, load, bonded, contact, springs):
        """(7,) mean stress, and what works on the temperature, under a load (7,)."""
        closing = np.flatnonzero(~bonded) if contact else np.zeros(0, int)
        T, K = self._together(bonded if springs is None else np.zeros_like(bonded)), self.K
        if springs is not None:
            for stiffness, jump in zip((springs[0], springs[1], springs[-1]), self._jumps(bonded), strict=True):
                K = K + jump.T @ diags(stiffness * self.lengths()[bonded]) @ jump
        own, f = (T.T @ K @ T).tocsc() / self.scale, -T.T @ (self.Q @ load) / self.scale
        gaps = (self._jumps(~bonded)[0] @ T).tocsr()[: len(closing)]
        C, give = gaps, 0
        if springs is not None:
            # How far the springs of touching faces give way is an unknown of its own.
            give = len(closing)
            own = block_diag([own, diags(springs[0] * self.lengths()[closing] / self.scale)]).tocsc()
            f, C = np.r_[f, np.zeros(give)], hstack([gaps, identity(give)]).tocsr()

        def motions(active):
            rigid = rigid_motions(self.rigid, T, self.rigid[self.fibre_node[bonded]], gaps[active])
            return np.concatenate([rigid, np.zeros((give, rigid.shape[1]))])

        imposed = np.abs(np.linalg.solve(self.mean[:6, :6], self.mean[:6] @ load)).max()
        v, _ = minimise(own, f, C, motions, self.size.max() * imposed)
        u = T @ v[: T.shape[1]]
        return (self.mean @ load + self.Q.T @ u) / self.size.prod()

    def _together(self, bonded):
        """(3n, free dofs) displacements of all nodes from those that are free; bonded nodes move as one."""
        number = np.arange(self.n)
        number[self.fibre_node[bonded]] = self.matrix[bonded]
        kept = np.setdiff1d(number, self.pinned)
        node = np.flatnonzero(number != self.pinned)
        rows = (3 * node[:, None] + np.arange(3)).ravel()
        columns = (3 * np.searchsorted(kept, number[node])[:, None] + np.arange(3)).ravel()
        return csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(3 * self.n, 3 * len(kept)))

    def _jumps(self, which):
        """Rows n.[u], t.[u] and [u_3] of the interface nodes where `which` (k,), [u] = u_matrix - u_fibre."""
        k = int(which.sum())
        nodes = np.stack([self.matrix[which], self.fibre_node[which]], axis=1)
        columns = (3 * nodes[:, :, None] + np.arange(3)).reshape(k, 6)
        normal = np.column_stack([self.normal[which], np.zeros(k)]) if k else np.zeros((0, 3))
        axial = np.broadcast_to([0.0, 0.0, 1.0], (k, 3))
        rows = np.repeat(np.arange(k), 6)
        return [
            csr_matrix((np.hstack([d, -d]).ravel(), (rows, columns.ravel())), shape=(k, 3 * self.n))
            for d in (normal, np.cross(axial, normal), axial)
        ]
