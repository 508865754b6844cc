"""A cell condensed to its interface and its macroscopic loads, in equilibrium under strains, stresses, a temperature.

With the jumps j (k, d) of the interface nodes in n, t (and x3), u_matrix - u_fibre, and the loads e (m,), strains and a
temperature, the bodies store z.A z / 2 with z = (j, e): all displacements are eliminated from the matrices of
`quadratic_programme` or `spatial_programme`.  Given stresses S add -area S.e to what is minimised.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import splu

from reference.quadratic_programme import EXACT, minimise

NULL = 1e-10  # of eigenvalues, relative to the largest


@dataclass(frozen=True)
class MixedLoad:
    """Values (m,) of the loads; where `by_stress` (m,) is true, of the stress that works on it."""

    values: np.ndarray
    by_stress: np.ndarray

    @classmethod
    def named(cls, target):
        """Return the load of a table with one name for each component; the temperature of a load comes last."""
        return cls(np.array([*target.values()], float), np.array([name[0] == "S" for name in target]))

    def scaled(self, factor):
        """Return the load of `factor` times all values."""
        return MixedLoad(factor * self.values, self.by_stress)

    def towards(self, end, share):
        """Return the load after a share of the way to another one of the same kinds."""
        return MixedLoad((1 - share) * self.values + share * end.values, self.by_stress)


@dataclass(frozen=True)
class State:
    """Loads (m,), their works and energies, jumps and forces on the fibre (k, d), and closed nodes.

    What works on the loads per area (m,), energy per area with that of the springs and theirs alone, and which nodes
    (k,) are `closed`, debonded ones that touch.
    """

    strain: np.ndarray
    stress: np.ndarray
    stored: float
    in_springs: float
    jump: np.ndarray
    force: np.ndarray
    closed: np.ndarray

    def scaled(self, t):
        """Return the state under t >= 0 times the load."""
        linear = (t * x for x in (self.strain, self.stress))
        return State(*linear, t**2 * self.stored, t**2 * self.in_springs, t * self.jump, t * self.force, self.closed)


class CondensedCell:
    """The cell of a programme with bonds of glue, or of the `springs` (d,) per length, or (k, d) of each.

    `contact` keeps debonded faces from overlapping.
    """

    def __init__(self, programme, contact, springs=None):
        self.programme, self.contact = programme, contact
        self.size, self.area = programme.size.max(), programme.size.prod()
        self.lengths = programme.lengths() if callable(programme.lengths) else programme.lengths
        self.k, self.m = len(programme.key), programme.Q.shape[1]
        self.d = programme.K.shape[0] // programme.n
        self.n = self.k * self.d
        stiffness = np.zeros(self.d) if springs is None else np.asarray(springs)[..., : self.d]
        self.glued, self.springs = springs is None, self.lengths[:, None] * stiffness
        self.A = self._condensed()
        self.scale = self.A.diagonal().max()
        self._closed = np.zeros(self.k, bool)

    def _condensed(self):
        """(n + m, n + m) A."""
        programme, k, d = self.programme, self.k, self.d
        normal = programme.normal
        frame = np.zeros((k, d, d))
        frame[:, 0, :2], frame[:, 1, :2] = normal, np.column_stack([-normal[:, 1], normal[:, 0]])
        frame[:, 2:, 2:] = 1.0
        rows = np.repeat(d * programme.fibre_node[:, None] + np.arange(d), d, axis=1).ravel()
        columns = np.tile(np.arange(k * d).reshape(k, d), d).ravel()
        # The fibre's copy of a node is where the matrix is, less the jump.
        parted = csr_matrix((-frame.transpose(0, 2, 1).ravel(), (rows, columns)), (programme.K.shape[0], k * d))
        together = programme._together(np.ones(k, bool))
        forces = np.hstack([(programme.K @ parted).toarray(), programme.Q])
        own = np.zeros((k * d + self.m,) * 2)
        own[: k * d] = parted.T @ forces
        own[k * d :, : k * d], own[k * d :, k * d :] = own[: k * d, k * d :].T, programme.mean
        inside = together.T @ forces
        A = own - inside.T @ splu((together.T @ programme.K @ together).tocsc()).solve(inside)
        return (A + A.T) / 2

    def equilibrium(self, load, bonded):
        """Return the state under a load with the `bonded` (k,) nodes holding.

        Numbers below 1 are shares of the stiffness that damaged bonds have left, but for compression: there the rest is
        a face that touches.
        """
        d, n, kept = self.d, self.n, bonded.astype(float)
        free_jumps = np.ones((self.k, d), bool)
        if self.glued:
            free_jumps[kept == 1.0] = False
        free = np.r_[free_jumps.ravel(), load.by_stress]
        held = np.r_[np.zeros(n), np.where(load.by_stress, 0.0, load.values)]
        pulled = np.r_[np.zeros(n), self.area * np.where(load.by_stress, load.values, 0.0)]
        H = self.A + np.diag(np.r_[(self.springs * kept[:, None]).ravel(), np.zeros(self.m)])
        touching = np.flatnonzero((kept < 1.0) & (self.contact | (kept > 0.0)))
        # How far the springs of touching faces give way is an unknown of its own.
        gives = 0 if self.glued else len(touching)
        K = np.zeros((free.sum() + gives,) * 2)
        K[: free.sum(), : free.sum()] = H[np.ix_(free, free)]
        pressed = (self.springs[:, 0] * (1.0 - kept))[touching]
        K[range(-gives, 0), range(-gives, 0)] = pressed if gives else 0.0
        f = np.r_[(pulled - self.A @ held)[free], np.zeros(gives)]
        C = np.zeros((len(touching), len(K)))
        C[np.arange(len(touching)), np.searchsorted(np.flatnonzero(free), d * touching)] = 1.0
        if gives:
            C[:, -gives:] = np.eye(gives)
        x, pressure = self._minimised(K / self.scale, f / self.scale, C, load, touching)
        z, give = held.copy(), x[free.sum() :]
        z[free] = x[: free.sum()]
        reaction = self.A @ z
        jump, force = z[:n].reshape(-1, d), -reaction[:n].reshape(-1, d)
        closed = np.zeros(self.k, bool)
        closed[touching] = pressure > 0
        closed &= kept == 0.0
        force[kept == 0.0, 1:] = 0.0
        force[(kept == 0.0) & ~closed, 0] = 0.0
        in_springs = ((self.springs * kept[:, None] * jump**2).sum() + pressed[:gives] @ give**2) / 2
        stored = (z @ reaction / 2 + in_springs) / self.area
        return State(z[n:], reaction[n:] / self.area, stored, in_springs / self.area, jump, force, closed)

    def _minimised(self, K, f, C, load, touching):
        """min x.K x / 2 - f.x, C x >= 0: x and the pressures, from who touched last if that is close."""
        if not len(K):
            return f, np.zeros(0)
        reach = self.size * np.abs(self._bonded_strain(load)).max()
        value, vectors = np.linalg.eigh(K)
        null = vectors[:, value < NULL * value[-1]]

        def motions(active):
            resisted = C[active] @ null
            _, size, modes = np.linalg.svd(np.vstack([resisted, np.zeros((null.shape[1],) * 2)]), full_matrices=False)
            return null @ modes[size < 1e-9].T

        found = self._near(K, f, C, self._closed[touching], reach, motions)
        if found is None:
            found = minimise(csc_matrix(K), f, csr_matrix(C), lambda active: csr_matrix(motions(active)), reach)
        self._closed[touching] = found[1] > 0
        return found

    @staticmethod
    def _near(K, f, C, active, reach, motions):
        """Return the same by exchanging who touches, free motions left out; None if that does not end soon."""
        for _ in range(12):
            border = np.hstack([-C[active].T, motions(active)])
            m, n = border.shape[1], len(f)
            matrix = np.block([[K, border], [border.T, np.zeros((m, m))]])
            b = np.r_[f, np.zeros(m)]
            x = np.linalg.solve(matrix, b)
            x += np.linalg.solve(matrix, b - matrix @ x)
            force = np.zeros(len(C))
            force[active] = x[n : n + int(active.sum())]
            pulled = force < -EXACT * max(np.abs(force).max(initial=0.0), EXACT * np.abs(f).max())
            overlap = ~active & (C @ x[:n] < -EXACT * reach)
            if not (pulled | overlap).any():
                return x[:n], np.maximum(force, 0.0)
            active = (active & ~pulled) | overlap
        return None

    def _bonded_strain(self, load):
        """(m,) strains under a load with all bonds."""
        A, free = self.A[self.n :, self.n :], load.by_stress
        strain = np.where(free, 0.0, load.values)
        if free.any():
            missing = self.area * load.values[free] - A[free] @ strain
            strain[free] = np.linalg.solve(A[np.ix_(free, free)], missing)
        return strain
