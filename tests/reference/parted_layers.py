"""Layers of isotropic phases whose faces have all parted: without friction they touch or part, in closed form.

Of a state the strains E_b along the layers are common to all, and so is the stress s_a across them, a the axis across.
Each layer has e_a = A (s_a - C_ab (E_b - alpha_b T)) + alpha_a T, A = 1 / C_aa.  They touch where that makes s_a <= 0
with E_a = <e_a> + s_a / k, k the springs of all faces in a row; else s_a = 0 and E_a is theirs only at its least,
<e_a>.  Shears do no work.
"""

import numpy as np

from reference.spatial_forms import law

IN_SPACE, IN_PLANE = [0, 1, 2], [0, 1]


class PartedLayers:
    """Components [11, 22] or, in generalized plane strain, [11, 22, 33].

    Attributes:
        across: the axis normal to the layers.
        stiffnesses, expansions: (n, v, v), (n, v) of the phases, of which `fractions` (n,) are there.
    """

    def __init__(self, phases, fractions, plane, across, spring_compliance=0.0):
        """`phases` are materials of a case file; `spring_compliance` is opening / s_a of all faces in a row."""
        laws = [law(phase) for phase in phases]
        if plane == "stress":
            self.stiffnesses = np.array([np.linalg.inv(np.linalg.inv(C)[:2, :2]) for C, _ in laws])
        else:
            kept = IN_SPACE if plane == "generalized" else IN_PLANE
            self.stiffnesses = np.array([C[np.ix_(kept, kept)] for C, _ in laws])
        v = self.stiffnesses.shape[1]
        self.expansions = np.array([np.zeros(v) if alpha is None else alpha[:v] for _, alpha in laws])
        self.fractions, self.across, self.give = np.array(fractions), across, spring_compliance
        self.along = [k for k in range(v) if k != across]

    def state(self, given, temperature=0.0):
        """Strains and stresses (v,) and whether the layers touch.

        `given` has a strain "E11" or a stress "S11" of each component. What nothing determines is NaN.
        """
        v = len(self.along) + 1
        strain = np.array([given.get(f"E{k + 1}{k + 1}", np.nan) for k in range(v)])
        stress = np.array([given.get(f"S{k + 1}{k + 1}", np.nan) for k in range(v)])
        a = self.across
        # Unknowns: all strains, all stresses; one equation each for the layers and for what is given.
        for touch in (True, False):
            K = np.zeros((2 * v, 2 * v))
            K[:v], f = self._laws(touch, temperature)
            f = np.r_[f, np.where(np.isnan(strain), stress, strain)]
            K[np.arange(v, 2 * v), np.where(np.isnan(strain), np.arange(v, 2 * v), np.arange(v))] = 1.0
            if not touch and np.isnan(strain[a]):
                assert stress[a] >= 0.0
                K[v + a, :], f[v + a] = np.eye(2 * v)[a], np.nan  # nothing carries a pull, or holds what parts
                if stress[a] > 0:
                    raise ValueError("nothing carries this stress")
            unknown = np.isnan(f)
            x = np.linalg.solve(K, np.where(unknown, 0.0, f))
            if not touch or x[v + a] < 0.0:
                found = x.reshape(2, v)
                found[0, a] = np.nan if unknown.any() else found[0, a]
                return found[0], found[1], touch

    def _laws(self, touch, T):
        """(v, 2 v) and (v,): what holds between strains and stresses."""
        v, a, b = len(self.along) + 1, self.across, self.along
        matrix, right = np.zeros((v, 2 * v)), np.zeros(v)
        matrix[a, v + a] = 1.0 if not touch else -self.give
        if touch:
            matrix[a, a] = 1.0
        matrix[b, v + np.array(b)] = 1.0
        for c, C, alpha in zip(self.fractions, self.stiffnesses, self.expansions, strict=True):
            soft = 1.0 / C[a, a]
            if touch:  # E_a = <e_a> + give s_a
                matrix[a, v + a] -= c * soft
                matrix[a, b] += c * soft * C[a, b]
                right[a] += c * (soft * C[a, b] @ alpha[b] + alpha[a]) * T
            inner = C[np.ix_(b, b)] - soft * np.outer(C[b, a], C[a, b])
            matrix[b, v + a] -= c * soft * C[b, a]
            matrix[np.ix_(b, b)] -= c * inner
            right[b] -= c * inner @ alpha[b] * T
        return matrix, right
