"""Load paths by brute force: every state anew by `quadratic_programme`, bonded nodes being one, debonded ones two.

Tractions are nodal reactions by the arc length that each node stands for.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from reference.quadratic_programme import QuadraticProgramme

TIE = 1e-6
LEAST = 1e-9  # bisection ends


@dataclass(frozen=True)
class Event:
    """Load factor, Sigma before the break, and the nodes (k,) that break: none at the end."""

    load_factor: float
    stress: np.ndarray
    broke: np.ndarray


@dataclass(frozen=True)
class SlowLoadPath:
    """A cell whose bonds have strengths by the `criterion` "max" or "quadratic".

    `normal` and `tangential` are numbers or (k,).
    """

    programme: QuadraticProgramme
    contact: bool
    normal: float | np.ndarray
    tangential: float | np.ndarray
    criterion: str

    def state(self, strain, bonded):
        """Return the state, and the share of strength that each node uses."""
        state = self.programme.solve(strain, bonded, self.contact)
        tn, tt = (state.force / self.programme.lengths()[:, None]).T
        shares = np.array([np.maximum(tn, 0.0) / self.normal, np.abs(tt) / self.tangential])
        used = shares.max(axis=0) if self.criterion == "max" else np.sqrt((shares**2).sum(axis=0))
        return state, used * bonded

    def proportional(self, strain):
        """Events of the wholly bonded cell from zero to `strain`, snap-back included."""
        events, bonded = [], np.ones(len(self.programme.key), bool)
        while True:
            state, used = self.state(strain, bonded)
            load = used.max()
            if load <= 1.0:
                return [*events, Event(1.0, state.stress, np.zeros_like(bonded))]
            broke = used >= load * (1 - TIE)
            events.append(Event(1 / load, state.stress / load, broke))
            bonded &= ~broke

    def leg(self, before, after, bonded, steps):
        """Events from one strain to the next, by `steps` steps and bisection; load factors are shares of the leg."""
        events, bonded, s = [], bonded.copy(), 0.0

        def at(s):
            return self.state(before + s * (after - before), bonded)

        while True:
            state, used = at(s)
            if used.max() > 1.0 + TIE:
                broke = used >= used.max() * (1 - TIE)
                events.append(Event(s, state.stress, broke))
                bonded &= ~broke
            elif s == 1.0:
                return [*events, Event(1.0, state.stress, np.zeros_like(bonded))]
            else:
                low, high = s, min(1.0, (np.floor(s * steps + 1e-6) + 1) / steps)
                if at(high)[1].max() > 1.0:
                    while high - low > LEAST:
                        middle = (low + high) / 2
                        low, high = (low, middle) if at(middle)[1].max() > 1.0 + 2 * TIE else (middle, high)
                s = high

    def legs(self, strains, steps):
        """(load factor, event) of a path from zero through all of `strains`; its whole length is 1."""
        found = [self.proportional(strains[0])]
        for before, after in pairwise(strains):
            left = ~np.any([e.broke for events in found for e in events], axis=0)
            found.append(self.leg(before, after, left, steps))
        return [((k + e.load_factor) / len(strains), e) for k, events in enumerate(found) for e in events]
