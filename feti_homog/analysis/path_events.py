"""An event of a path with what was lost up to it, and the form in which the checkpoint keeps it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.interface.contact import Equilibrium
from feti_homog.interface.path_points import Break, PathState, Point
from feti_homog.output.files.checkpoint import Arrays

Energies = tuple[float, float, float]
"""The three of a `Dissipation`."""

KKT_LAWS = ("kkt_complementarity", "kkt_penetration", "kkt_tension")


@dataclass
class Dissipation:
    """Energies of the breaks per area of the cell up to a point's state.

    What is lost is W - 1/2 E.Sigma with the work W = int Sigma.dE.

    Attributes:
        followed: where every bond broke at its own load, the first leg with its snap-back.
        strain_controlled: where the strain only rose on the first leg, as in a test: a bond of a snap-back breaks at
            the largest load t so far, and loses (t / own load)^2 times as much, for all is of degree one in the load.
        fracture: toughness times length of the bonds that broke.
    """

    followed: float = 0.0
    strain_controlled: float = 0.0
    fracture: float = 0.0
    _load: float = 0.0
    _largest_load: float = 0.0

    def arrive(self, point: Point) -> None:
        """Add what breaks lost on the way from the last point to this one."""
        # Beyond the first leg loads do not fall.
        rise = self._largest_load / self._load if self._load else 1.0
        controlled = self.strain_controlled + rise**2 * point.released
        self.recall((self.followed + point.released, controlled, self.fracture + point.fracture_energy), point)

    def recall(self, energies: Energies, point: Point) -> None:
        """Go on from a point up to which there were these."""
        self.followed, self.strain_controlled, self.fracture = energies
        self._load, self._largest_load = point.load_factor, max(point.load_factor, self._largest_load)


def stored(point: Point, dissipation: Dissipation) -> tuple[dict[str, Any], Arrays]:
    """A point as plain numbers and distributed arrays, for the checkpoint.

    A path goes on from the multipliers of its last state.
    """
    state, solution, after = point.state, point.state.solution, point.after
    counts = [point.broke, state.iterations, state.solves, state.free_motions, solution.iterations, solution.reason]
    broken = [np.nan] * 4 if after.broken is None else [*after.broken.stress, after.broken.fracture_energy]
    whole: dict[str, Any] = {
        "path": [point.load_factor, point.scale, float(after.leg), after.position],
        "energy": [point.released, point.fracture_energy],
        "energies": [dissipation.followed, dissipation.strain_controlled, dissipation.fracture],
        "numbers": counts,
        "broken": broken,
        "strain": solution.strain,
        "alpha": solution.alpha,
        "residual": solution.residual,
        "certificate": [state.certificate[law] for law in KKT_LAWS],
    }
    distributed: Arrays = {
        "status": state.status,
        "lam": solution.lam,
        "jump": solution.jump,
        "used": point.used,
        "status_after": after.status,
    }
    return whole, distributed


def restored(event: Arrays) -> tuple[Point, Energies]:
    """What `stored` took apart."""
    load_factor, scale, leg, position = event["path"].tolist()
    followed, strain_controlled, fracture = event["energies"].tolist()
    broke, iterations, solves, free_motions, last, reason = event["numbers"].tolist()
    solution = DualSolution(
        event["strain"], event["lam"], event["jump"], event["alpha"], last, reason, float(event["residual"])
    )
    certificate = dict(zip(KKT_LAWS, event["certificate"].tolist(), strict=True))
    state = Equilibrium(event["status"], solution, iterations, solves, free_motions, certificate)
    *stress, broken = event["broken"].tolist()
    of_break = None if np.isnan(broken) else Break(np.array(stress), broken)
    after = PathState(int(leg), position, event["status_after"], event["lam"], of_break)
    released, of_bonds = event["energy"].tolist()
    point = Point(load_factor, scale, state, broke, released, of_bonds, event["used"], after)
    return point, (followed, strain_controlled, fracture)
