"""Paths of strains, stresses and temperature by brute force: every state anew by `condensed_cell`.

The energies are balances: what a break at constant load loses is the work of the given stresses less the change of what
is stored.  Between breaks nothing is lost.
"""

from dataclasses import dataclass

import numpy as np

from reference.condensed_cell import CondensedCell, MixedLoad, State

TIE = 1e-6
HALVINGS = 46


@dataclass(frozen=True)
class Strengths:
    """Shares of the strengths `limits` (d,) under tractions (k, d) by "max" or "quadratic"."""

    limits: tuple
    criterion: str

    def used(self, cell, state, bonded):
        """(k,) share of what breaks each bond."""
        traction = state.force / cell.lengths[:, None]
        shares = np.abs(traction) / np.array(self.limits)[: cell.d]
        shares[traction[:, 0] < 0, 0] = 0.0
        return (shares.max(axis=1) if self.criterion == "max" else np.sqrt((shares**2).sum(axis=1))) * bonded


@dataclass(frozen=True)
class Toughness:
    """Energies of springs against G_c; with `growth` "released" what breaks beside a broken bond release."""

    toughness: float
    mode_sensitivity: float
    growth: str

    def used(self, cell, state, bonded):
        """(k,) root of the share of what breaks each bond."""
        traction = state.force / cell.lengths[:, None]
        parts = traction**2 * cell.lengths[:, None] / (2 * cell.springs)
        parts[traction[:, 0] < 0, 0] = 0.0
        energy, psi = parts.sum(axis=1), np.arctan2(np.sqrt(parts[:, 1:].sum(axis=1)), np.sqrt(parts[:, 0]))
        if self.growth == "released":
            for i in tips(cell.programme, bonded):
                energy[i] = max(released(cell, state, bonded, i), 0.0)
        critical = self.toughness * (1 + np.tan((1 - self.mode_sensitivity) * psi) ** 2)
        return np.sqrt(energy / critical) * bonded


def tips(programme, bonded):
    """Bonded nodes beside one that is not, around each fibre."""
    found = np.zeros(len(bonded), bool)
    for f in np.unique(programme.fibre):
        own = np.flatnonzero(programme.fibre == f)
        own = own[np.argsort(programme.angle[own])]
        broken = ~bonded[own]
        found[own] = bonded[own] & (np.roll(broken, 1) | np.roll(broken, -1))
    return np.flatnonzero(found)


def released(cell, state, bonded, i):
    """Energy per length that the break of bond i on springs releases at constant strain, those that touch kept so."""
    d, n = cell.d, cell.n
    holds = np.repeat(bonded[:, None], d, axis=1)
    holds[:, 0] |= state.closed
    stays = holds.copy()
    stays[i] = False
    energy = 0.0
    for first in (0, 1):  # if the faces would overlap, the normal force stays
        stays[i, :first] = True
        H = cell.A[:n, :n] + np.diag((cell.springs * stays).ravel())
        H += 1e-14 * H.diagonal().max() * np.eye(n)  # free fibres
        push = np.zeros((cell.k, d))
        push[i, first:] = state.force[i, first:]
        jump = state.jump + np.linalg.solve(H, push.ravel()).reshape(-1, d)
        energy = state.force[i, first:] @ jump[i, first:] / 2 / cell.lengths[i]
        if not cell.contact or jump[i, 0] >= 0:
            break
    return energy


@dataclass(frozen=True)
class Event:
    """Share of the whole path, the state before the break, which nodes (k,) break, none at the end of a leg.

    And per area up to the state what breaks have lost, on the first leg as it is and at rising load.
    """

    load_factor: float
    state: State
    broke: np.ndarray
    dissipated: float
    dissipated_at_rising_load: float


class MixedPath:
    """A cell from its `bonded` (k,) nodes on under a law with `used(cell, state, bonded)`."""

    def __init__(self, cell: CondensedCell, law, bonded):
        self.cell, self.law, self.bonded = cell, law, bonded.copy()
        self.events, self.lost, self.lost_rising = [], 0.0, 0.0

    def follow(self, loads, steps=12):
        """Events of all legs: zero to loads[0], ..., each leg found by so many steps and bisection."""
        self._proportional(loads[0], len(loads))
        for leg, load in enumerate(loads[1:], 1):
            last = self.events[-1].state
            start = np.where(load.by_stress, last.stress, last.strain)
            self._leg(MixedLoad(start, load.by_stress), load, leg, len(loads), steps)
        return self.events

    def increments(self, loads, steps, worst_only):
        """(state, bonds that broke, what has been lost) after each of so many equal steps of the whole path.

        Their number is a multiple of the legs: overloaded bonds break, or the worst alone, until none is.
        """
        found, own, last = [], steps // len(loads), None
        for load in loads:
            start = MixedLoad(np.zeros(self.cell.m), load.by_stress)
            if last is not None:
                start = MixedLoad(np.where(load.by_stress, last.stress, last.strain), load.by_stress)
            for step in range(1, own + 1):
                here, broke = start.towards(load, step / own), 0
                last, used = self.at(here)
                while used.max() > 1.0 + TIE:
                    which = used >= used.max() * (1 - TIE) if worst_only else used > 1.0
                    self._break(here, Event(0.0, last, which, 0.0, 0.0), 1.0)
                    broke += int(which.sum())
                    last, used = self.at(here)
                found.append((last, broke, self.lost))
        return found

    def at(self, load):
        """Return the state, and the shares of what breaks the bonds."""
        state = self.cell.equilibrium(load, self.bonded)
        return state, self.law.used(self.cell, state, self.bonded)

    def _proportional(self, load, legs):
        highest = 0.0
        while True:
            state, used = self.at(load)
            if used.max() <= 1.0:
                self._report(1.0 / legs, state, np.zeros(self.cell.k, bool))
                return
            t = 1.0 / used.max()
            self._report(t / legs, state.scaled(t), used >= used.max() * (1 - TIE))
            highest = max(highest, t)
            self._break(load.scaled(t), self.events[-1], highest / t)

    def _leg(self, start, end, leg, legs, steps):
        def load_at(s):
            return start.towards(end, s)

        s = 0.0
        while True:
            state, used = self.at(load_at(s))
            if used.max() > 1.0 - 1e-10 and (s > 0.0 or used.max() > 1.0 + TIE):
                self._report((leg + s) / legs, state, used >= used.max() * (1 - TIE))
                self._break(load_at(s), self.events[-1], 1.0)
            elif s == 1.0:
                self._report((leg + 1) / legs, state, np.zeros(self.cell.k, bool))
                return
            else:
                low, high = s, min(1.0, (np.floor(s * steps + 1e-9) + 1) / steps)
                if self.at(load_at(high))[1].max() > 1.0:
                    for _ in range(HALVINGS):
                        middle = (low + high) / 2
                        low, high = (low, middle) if self.at(load_at(middle))[1].max() > 1.0 else (middle, high)
                s = high

    def _report(self, load_factor, state, broke):
        self.events.append(Event(load_factor, state, broke, self.lost, self.lost_rising))

    def _weaken(self, event):
        self.bonded &= ~event.broke

    def _break(self, load, event, rise):
        """Break the bonds of an event at constant load; `rise` is how far beyond it the load has been."""
        self._weaken(event)
        before, after = event.state, self.cell.equilibrium(load, self.bonded)
        work = before.stress[load.by_stress] @ (after.strain - before.strain)[load.by_stress]
        lost = work + before.stored - after.stored
        self.lost, self.lost_rising = self.lost + lost, self.lost_rising + rise**2 * lost
