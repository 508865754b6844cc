"""Evaluate cohesive laws t(delta) of the opening delta, with damage d = 1 - t / (K delta) from the onset delta_0 on.

K is the stiffness of a mode psi, 0 (opening delta_n) to pi/2 (slip delta_s): K (delta_n^2 + delta_s^2) = k_n delta_n^2
+ k_t delta_s^2.  Damage grows in steps, the teeth.  With the peak K delta_0, a branch gives t / peak at
u = (delta - delta_0) / stretch; the stretch makes the area under t(delta) equal to the toughness of the mode.
"""

from abc import abstractmethod
from functools import cached_property
from itertools import count
from typing import ClassVar

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.bonds import QuadraticStrength, pulled

TAIL = 0.01  # traction / peak at the beginning of the last tooth of an exponential branch
MODES = np.linspace(0.0, np.pi / 2, 33)
# Largest relative distance of the energy absorbed under changing modes from the range over constant modes.
BETWEEN_MODES = 0.25


class Cohesive(QuadraticStrength):
    """A cohesive law: a bond softens when delta = sqrt(<delta_n>^2 + delta_s^2) reaches the next tooth."""

    has_toughness: ClassVar[bool] = True

    @property
    def damage(self) -> Float:
        """Return the damage, (k,) or ()."""
        return np.asarray(self.section.get("damage", 0.0), float)

    def jumps(self, traction: Float) -> Float:
        """Compute the jumps t / ((1 - d) k) (k, c), with d = 0 for normal compression and broken bonds."""
        share = np.broadcast_to(np.where(self.damage < 1.0, 1.0 - self.damage, 1.0), len(traction))[:, None]
        shares = np.repeat(share, traction.shape[1], axis=1)
        shares[:, 0] = np.where(traction[:, 0] > 0.0, shares[:, 0], 1.0)
        return np.asarray(super().jumps(traction) / shares)

    def utilisation(self, traction: Float) -> Float:
        """Compute the utilisation (k,): the opening delta over its value at the next tooth."""
        level = np.abs(np.subtract.outer(np.broadcast_to(self.damage, len(traction)), self.levels)).argmin(axis=1)
        level = np.minimum(level, len(self.levels) - 2)
        low, high = self.levels[level], self.levels[level + 1]
        energy = self.energies(traction).sum(axis=1) / (1.0 - low) ** 2
        return np.asarray(np.sqrt(energy * (high - low) / self.absorbed(self.mode(traction), low, high)))

    def absorbed(self, psi: Float, before: Float, after: Float) -> Float:
        """Compute energies per area absorbed in modes psi as damage rises from `before` to `after`.  All are (k,)."""
        return self._area(after, *self._mode(psi)) - self._area(before, *self._mode(psi))

    def absorbed_range(self, before: Float, after: Float) -> tuple[Float, Float]:
        """Compute lower and upper bounds, both (k,), of `absorbed` over all modes."""
        energies = np.stack([self.absorbed(np.full(len(after), psi), before, after) for psi in MODES])
        return energies.min(axis=0) * (1 - BETWEEN_MODES), energies.max(axis=0) * (1 + BETWEEN_MODES)

    def onset(self, traction: Float) -> Float:
        """Compute the utilisation (k,) of intact bonds by the quadratic law: 1 at first damage."""
        return super().utilisation(traction)

    def shares(self, traction: Float) -> Float:
        """Compute t_n / N, t_t / S and sqrt(k_t / k_a) t_a / S (k, c) for the strengths N and S of first damage."""
        shares = pulled(traction)
        shares[:, 0] /= self._number("normal_strength")
        stiffness = self._components("stiffness", traction)[..., 1:]
        size = np.sqrt(self._number("tangential_stiffness"))[..., None] / np.sqrt(stiffness)
        shares[:, 1:] *= size / self._number("tangential_strength")[..., None]
        return shares

    @cached_property
    def levels(self) -> Float:
        """Compute damage levels (n + 1,) of n teeth at openings in geometric progression, in the more ductile mode."""
        ends = []
        for psi in (0.0, np.pi / 2):
            K, first, stretch = self._mode(np.full(np.size(self.section["normal_stiffness"]), psi))
            ends.append(np.stack([K * first**2 / 2, first, first + self.last * stretch]))
        energy, first, end = np.concatenate(ends, axis=1)
        worst = int(np.argmax(end / first))
        delta0, delta1, peak = first[worst], end[worst], 2 * energy[worst] / first[worst]
        stretch, teeth = (delta1 - delta0) / self.last, self.section.get("teeth")
        for n in [teeth] if teeth else count(1):
            delta = delta0 * (delta1 / delta0) ** (np.arange(n) / n)
            u = (delta - delta0) / max(stretch, 1e-300)
            d = 1.0 - self.branch(u) * delta0 / delta if delta1 > delta0 * (1 + 1e-12) else np.arange(n) / n
            levels, K = np.append(d, 1.0), np.array([2 * energy[worst] / delta0**2])
            area = self._area(levels[1:2], K, np.array([delta0]), np.array([stretch]))[0]
            first_tooth = np.sqrt(area / levels[1] * 2 * K[0])
            if teeth or first_tooth <= peak * (1 + self.section["softening_tolerance"]):
                break
        return levels

    @property
    @abstractmethod
    def last(self) -> float:
        """Return u at the end of the branch or, if it has no end, at the beginning of its last tooth."""

    @abstractmethod
    def branch(self, u: Float) -> Float:
        """Compute traction / peak at u."""

    @abstractmethod
    def under(self, u: Float) -> Float:
        """Compute the area under the branch from 0 to u."""

    def _number(self, name: str) -> Float:
        return np.asarray(self.section[name], float)

    def _mode(self, psi: Float) -> tuple[Float, Float, Float]:
        """Compute K, delta_0 and the stretch for which t(delta) absorbs the toughness, all (k,), in modes psi (k,)."""
        kn, kt = self._number("normal_stiffness"), self._number("tangential_stiffness")
        # delta_n : delta_s = cos / sqrt(k_n) : sin / sqrt(k_t)
        opens, slips = np.cos(psi) ** 2 / kn, np.sin(psi) ** 2 / kt
        K = 1.0 / (opens + slips)
        shares = np.stack([opens, slips]) * K
        strengths = self._number("normal_strength") / kn, self._number("tangential_strength") / kt
        first = 1.0 / np.sqrt(shares[0] / strengths[0] ** 2 + shares[1] / strengths[1] ** 2)
        low, high = self._number("normal_toughness"), self._number("tangential_toughness")
        toughness = low + (high - low) * (np.sin(psi) ** 2) ** self._number("mixing_exponent")
        rest = np.maximum(toughness - K * first**2 / 2, 0.0)
        return K, first, rest / (K * first * self.under(np.asarray(np.inf)))

    def _area(self, d: Float, K: Float, first: Float, stretch: Float) -> Float:
        """Compute the area (k,) under t(delta) up to damage d (k,), less the energy of unloading; see `_mode`."""
        low = np.zeros(np.broadcast_shapes(np.shape(d), np.shape(first)))
        high = low + 1.0
        while ((1.0 - d) * (first + stretch * high) < first * self.branch(high)).any() and high.max() < 1e6:
            high = high * 2.0
        while (high - low > np.finfo(float).eps * (1.0 + high)).any():
            middle = (low + high) / 2
            above = (1.0 - d) * (first + stretch * middle) < first * self.branch(middle)
            low, high = np.where(above, middle, low), np.where(above, high, middle)
        u = np.where(d < 1.0, high, np.inf)
        area = K * first**2 / 2 + K * first * stretch * self.under(u)
        return np.asarray(area - np.where(d < 1.0, K * (1.0 - d) * (first + stretch * high) ** 2 / 2, 0.0))


class TableLaw(Cohesive):
    """The law with a piecewise linear branch through the m points of a table."""

    @property
    def _points(self) -> tuple[Float, Float]:
        """Return u and traction / peak, both (m,)."""
        openings, tractions = (np.asarray(self.section[name], float) for name in ("openings", "tractions"))
        return (openings - openings[0]) / openings[0], tractions / tractions[0]

    @property
    def last(self) -> float:
        """Return the first u without traction."""
        places, heights = self._points
        return float(places[heights == 0.0][0])

    def branch(self, u: Float) -> Float:
        """Interpolate traction / peak at u in the table."""
        return np.interp(u, *self._points)

    def under(self, u: Float) -> Float:
        """Sum the trapezia under the branch from 0 to u."""
        places, heights = self._points
        ends = np.clip(np.minimum(u, self.last)[..., None], places[:-1], places[1:])
        means = (heights[:-1] + np.interp(ends, places, heights)) / 2
        return np.asarray((means * (ends - places[:-1])).sum(axis=-1))


class BilinearLaw(TableLaw):
    """The law with a linear branch: traction / peak = 1 - u."""

    _points = np.array([0.0, 1.0]), np.array([1.0, 0.0])


class ExponentialLaw(Cohesive):
    """The law with an exponential branch: traction / peak = exp(-u)."""

    last = -float(np.log(TAIL))

    def branch(self, u: Float) -> Float:
        """Compute traction / peak = exp(-u)."""
        return np.asarray(np.exp(-u))

    def under(self, u: Float) -> Float:
        """Compute the area 1 - exp(-u) under the branch."""
        return np.asarray(1.0 - np.exp(-u))
