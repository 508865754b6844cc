"""`analysis.type = "path"`: load-induced debonding along a path of macroscopic strain, Section III.F and Fig. 5."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.analysis.context import AnalysisContext
from feti_homog.config.sections import LoadPath
from feti_homog.feti.dual_solution import DualSolution
from feti_homog.interface.bond_criterion import BondCriterion
from feti_homog.interface.contact import Equilibrium
from feti_homog.interface.path_following import events, increments
from feti_homog.interface.path_points import PathState, Point, unloaded
from feti_homog.output.files.checkpoint import Arrays, Checkpoint

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


def run(
    context: AnalysisContext, path: LoadPath, criterion: BondCriterion, checkpoint: Checkpoint, resume: bool
) -> dict[str, Any]:
    """`path`, a list of points, one an event (or increment); each is checkpointed before the next is sought."""
    interface = context.homogenization.interface
    known = _known(context, checkpoint, resume)
    begin = unloaded(interface, context.status(None))
    dissipation, points = Dissipation(), []
    for number, point in enumerate(_points(context, path, criterion, begin, [point for point, *_ in known])):
        interface.solver.activate(interface.active(point.state.status))
        response = context.homogenization.response(point.state, point.scale)
        label, source = f"{'event' if path.method == 'events' else 'increment'} {number}", ""
        if number < len(known):
            dissipation.recall(*known[number][1:], point)
            source = ", from the checkpoint"
        else:
            dissipation.arrive(point)
            if point.state.solution.reason > 0:
                checkpoint.write(number, *_stored(point, dissipation))
        context.record_checks(f"{label} at {point.load_factor:.6f}{source}", response)
        context.record(response, point.load_factor, label)
        points.append(
            {
                "load_factor": point.load_factor,
                "strain": response.strain,
                "stress": response.stress,
                "broke": point.broke,
                "free_motions": point.state.free_motions,
                "dissipated": dissipation.followed,
                "dissipated_strain_controlled": dissipation.strain_controlled,
            }
            | context.point([response])
        )
        if point.state.solution.reason < 0:
            # What broke next was decided on a state that does not hold.
            break
        if number + 1 == path.max_events and point.load_factor < 1.0:
            context.faults.append(
                f"[path] max_events = {number + 1}: the path was not finished: "
                'result.json has status "not converged"; --resume with a higher max_events goes on'
            )
            break
    return {"path": points, "resumed": len(known)}


def _known(context: AnalysisContext, checkpoint: Checkpoint, resume: bool) -> list[tuple[Point, float, float]]:
    """The points of the checkpoint and both energies dissipated up to each, if they are wanted; else it is cleared.

    Raises:
        CaseError: the checkpoint cannot be used.
    """
    if resume:
        known = [_restored(arrays) for arrays in checkpoint.read()]
        context.progress.say(
            f"  {len(known)} events are taken from the checkpoint"
            if known
            else "  there is no checkpoint: the path begins at its beginning"
        )
        return known
    if dropped := checkpoint.clear():
        context.progress.say(f"  {dropped} events of an earlier run are dropped; --resume would have gone on from them")
    return []


def _points(
    context: AnalysisContext, path: LoadPath, criterion: BondCriterion, begin: PathState, known: Sequence[Point]
) -> Iterator[Point]:
    """The points of the checkpoint, then those still to be found."""
    yield from known
    interface, waypoints = context.homogenization.interface, np.array(path.targets)
    begin = known[-1].after if known else begin
    if path.method == "events":
        yield from events(interface, criterion, waypoints, begin)
    else:
        yield from increments(interface, criterion, waypoints, path.increments or 1, path.release == "worst", begin)


def _stored(point: Point, dissipation: Dissipation) -> tuple[dict[str, Any], Arrays]:
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


def _restored(event: Arrays) -> tuple[Point, float, float]:
    """What `_stored` took apart."""
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
    return Point(load_factor, scale, state, broke, released, after), followed, strain_controlled
