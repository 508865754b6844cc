"""Load paths of bonds that break by energy, by brute force.

Every state is made anew by `quadratic_programme`, and what a break releases follows from the compliance of the cell in
displacements.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import diags, identity
from scipy.sparse.linalg import splu

from reference.load_path import SlowLoadPath
from reference.mixed_path import tips
from reference.quadratic_programme import QuadraticProgramme

SLIGHT = 1e-14  # share of the largest stiffness that makes that of free fibres definite


@dataclass(frozen=True)
class SlowEnergyPath:
    """A cell on springs of the stiffnesses `springs` (normal, tangential), numbers or (k,) as the toughness.

    Bonds beside a broken one break by what that releases, with growth "released", or by the energy of their own
    springs.
    """

    programme: QuadraticProgramme
    springs: tuple[float | np.ndarray, float | np.ndarray]
    toughness: float | np.ndarray
    mode_sensitivity: float | np.ndarray
    growth: str

    proportional = SlowLoadPath.proportional

    def state(self, strain, bonded):
        """Return the state, and the square root of the share of the toughness that the break of each node releases."""
        state = self.programme.solve_elastic(strain, bonded, True, self.springs)
        tn, tt = (state.force / self.programme.lengths()[:, None]).T
        GI, GII = np.maximum(tn, 0.0) ** 2 / (2 * self.springs[0]), tt**2 / (2 * self.springs[1])
        psi = np.arctan2(np.sqrt(GII), np.sqrt(GI))
        energy = GI + GII
        if self.growth == "released":
            edge = tips(self.programme, bonded)
            # The last bond of a fibre has no force, and rounding a sign.
            energy[edge] = np.maximum(self.released(state, bonded, edge), 0.0) / self.programme.lengths()[edge]
        critical = self.toughness * (1 + np.tan((1 - self.mode_sensitivity) * psi) ** 2)
        return state, np.sqrt(energy / critical) * bonded

    def released(self, state, bonded, edge):
        """(t,) energies that the single breaks release at fixed strain, with the faces that touch as they are.

        The springs have lam = k j go, and their ends part by (1 - A k)^-1 j, A being the compliance of the cell with
        them.
        """
        programme, lengths = self.programme, self.programme.lengths()
        stiff = np.stack([self.springs[0] * lengths, self.springs[1] * lengths], axis=1)
        rows = [programme._gaps(np.arange(len(bonded))), programme._slips()]
        holds = [bonded | state.closed, bonded]
        K = programme.K + sum(
            J.T @ diags(np.where(h, k, 0.0)) @ J for J, k, h in zip(rows, stiff.T, holds, strict=True)
        )
        T = programme._together(np.zeros(len(bonded), bool))
        K = (T.T @ K @ T).tocsc()
        # Free fibres as a whole have no stiffness, and the springs of tips no part in their motions.
        factor = splu(K + SLIGHT * K.diagonal().max() * identity(K.shape[0], format="csc"))
        energies = []
        for i in edge:
            J = np.stack([(R[i] @ T).toarray().ravel() for R in rows])
            A, k, j = J @ factor.solve(J.T), np.diag(stiff[i]), state.jump[i]
            parted = np.linalg.solve(np.eye(2) - A @ k, j)
            sheared = j[1] / (1 - A[1, 1] * stiff[i, 1])
            energies.append((k @ j @ parted if parted[0] >= 0 else stiff[i, 1] * j[1] * sheared) / 2)
        return np.array(energies)
