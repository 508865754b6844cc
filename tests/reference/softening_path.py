"""Paths of bonds that soften tooth by tooth, by brute force, in openings as Camanho and Davila have them."""

from dataclasses import dataclass

import numpy as np

from reference.mixed_path import MixedPath


@dataclass(frozen=True)
class Teeth:
    """The bilinear law of bonds with stiffnesses K (n, t), strengths N, S, toughnesses (G_I, G_II) and eta in n teeth.

    Openings in mode I or II, where df / d0 is larger, have constant quotients.
    """

    stiffness: tuple
    strength: tuple
    toughness: tuple
    exponent: float
    n: int

    @property
    def levels(self):
        """(n + 1,) damage."""
        K, N, G = (np.array(x) for x in (self.stiffness, self.strength, self.toughness))
        ratio = (2 * G * K / N**2).max()
        delta = ratio ** (np.arange(self.n + 1) / self.n)
        return ratio / (ratio - 1) * (1 - 1 / delta)

    def openings(self, jump):
        """(k,) effective opening of jumps (k, 2), with K, d0 and df of its mode."""
        normal, shear = np.maximum(jump[:, 0], 0.0), np.abs(jump[:, 1])
        delta = np.hypot(normal, shear)
        c, s = normal / np.where(delta, delta, 1.0), shear / np.where(delta, delta, 1.0)
        K = self.stiffness[0] * c**2 + self.stiffness[1] * s**2
        K = np.where(K, K, self.stiffness[0])
        ends = np.array(self.strength) / np.array(self.stiffness)
        first = 1 / np.sqrt(np.where(delta, (c / ends[0]) ** 2 + (s / ends[1]) ** 2, 1 / ends[0] ** 2))
        share = self.stiffness[1] * s**2 / K
        G = self.toughness[0] + (self.toughness[1] - self.toughness[0]) * share**self.exponent
        return delta, K, first, 2 * G / (K * first)

    def breaking(self, jump, level):
        """(k,) the openings at which the next teeth break."""
        _, _, first, last = self.openings(jump)
        d = self.levels[np.stack([level, np.minimum(level + 1, self.n)])]
        at = first * last / (last - d * (last - first))
        return np.sqrt(at[0] * at[1])

    def damage(self, jump):
        """(k,) damage of the law itself at jumps (k, 2)."""
        delta, _, first, last = self.openings(jump)
        delta = np.clip(delta, first, last)
        return last * (delta - first) / delta / (last - first)

    def used(self, cell, state, kept):
        """(k,) opening over that of the next tooth."""
        level = np.abs(np.subtract.outer(1 - kept, self.levels)).argmin(axis=1)
        return self.openings(state.jump)[0] / self.breaking(state.jump, level) * (kept > 0)


def exact_stresses(cell, law, load, steps, substitutions=2000):
    """Return (steps, m) stresses at equal steps of a load under the law without teeth.

    Its damage is an internal variable, by repeated substitution, which converges where the cell is stable.
    """
    damage, found = np.zeros(cell.k), []
    for step in range(1, steps + 1):
        for _ in range(substitutions):
            state, before = cell.equilibrium(load.scaled(step / steps), 1.0 - damage), damage
            damage = np.maximum(damage, law.damage(state.jump))
            if np.abs(damage - before).max() < 1e-9:
                break
        else:
            raise ArithmeticError(f"step {step} does not settle")
        found.append(state.stress)
    return np.array(found)


class SofteningPath(MixedPath):
    """A path whose bonds have the `law` and begin undamaged; `fracture` is what the law took, per area."""

    def __init__(self, cell, law):
        super().__init__(cell, law, np.ones(cell.k))
        self.level, self.fracture = np.zeros(cell.k, int), [0.0]

    def _weaken(self, event):
        which = event.broke
        jump, law = event.state.jump[which], self.law
        K, delta = law.openings(jump)[1], law.breaking(jump, self.level[which])
        taken = np.diff(law.levels)[self.level[which]] * K * delta**2 / 2 @ self.cell.lengths[which]
        self.fracture.append(self.fracture[-1] + taken / self.cell.area)
        self.level[which] += 1
        self.bonded = 1.0 - law.levels[self.level]
        self.bonded[self.level == law.n] = 0.0
