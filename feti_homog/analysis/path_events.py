"""An event of a path with what was lost up to it, and the form in which the checkpoint keeps it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.interface.contact import Equilibrium
from feti_homog.interface.path_points import PathState, Point
from feti_homog.output.files.checkpoint import Arrays

Losses = tuple[float, float]
"""What was lost up to a point: both numbers of its `Dissipation`."""

KKT_LAWS = ("kkt_complementarity", "kkt_penetration", "kkt_tension")


@dataclass
class Dissipation:
    """Energy lost to breaks per area of the cell up to a point's state, W - 1/2 E.Sigma with the work W = int Sigma.dE.

    Attributes:
        followed: where every bond broke at its own load, the first leg with its snap-back.
        strain_controlled: where the strain only rose on the first leg, as in a test: a bond of a snap-back breaks at
            the largest load t so far, and loses (t / own load)^2 times as much, for all is of degree one in the load.
    """

    followed: float = 0.0
    strain_controlled: float = 0.0
    _load: float = 0.0
    _largest_load: float = 0.0

    def arrive(self, point: Point) -> None:
        """Add what breaks lost on the way from the last point to this one."""
        # Beyond the first leg loads do not fall.
        rise = self._largest_load / self._load if self._load else 1.0
        self.recall(self.followed + point.released, self.strain_controlled + rise**2 * point.released, point)

    def recall(self, followed: float, strain_controlled: float, point: Point) -> None:
        """Go on from a point up to which so much has been lost."""
        self.followed, self.strain_controlled = followed, strain_controlled
        self._load, self._largest_load = point.load_factor, max(point.load_factor, self._largest_load)


def stored(point: Point, dissipation: Dissipation) -> tuple[dict[str, Any], Arrays]:
    """A point as plain numbers and distributed arrays, for the checkpoint."""
    state, solution, after = point.state, point.state.solution, point.after
    counts = [point.broke, state.iterations, state.solves, state.free_motions, solution.iterations, solution.reason]
    before = np.full(3, np.nan) if after.stress_before_break is None else after.stress_before_break
    whole: dict[str, Any] = {
        "path": [point.load_factor, point.scale, float(after.leg), after.position],
        "energy": [point.released, dissipation.followed, dissipation.strain_controlled],
        "numbers": counts,
        "stress_before_break": before,
        "strain": solution.strain,
        "alpha": solution.alpha,
        "residual": solution.residual,
        "certificate": [state.certificate[law] for law in KKT_LAWS],
    }
    distributed: Arrays = {
        "status": state.status,
        "lam": solution.lam,
        "jump": solution.jump,
        "status_after": after.status,
        "lam_after": after.lam,
    }
    return whole, distributed


def restored(event: Arrays) -> tuple[Point, Losses]:
    """What `stored` took apart."""
    load_factor, scale, leg, position = event["path"].tolist()
    released, followed, strain_controlled = event["energy"].tolist()
    broke, iterations, solves, free_motions, last, reason = event["numbers"].tolist()
    solution = DualSolution(
        event["strain"], event["lam"], event["jump"], event["alpha"], last, reason, float(event["residual"])
    )
    certificate = dict(zip(KKT_LAWS, event["certificate"].tolist(), strict=True))
    state = Equilibrium(event["status"], solution, iterations, solves, free_motions, certificate)
    before = None if np.isnan(event["stress_before_break"]).any() else event["stress_before_break"]
    after = PathState(int(leg), position, event["status_after"], event["lam_after"], before)
    return Point(load_factor, scale, state, broke, released, after), (followed, strain_controlled)
