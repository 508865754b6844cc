"""`analysis.type = "path"`: load-induced debonding along a path of macroscopic strain, Section III.F and Fig. 5."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from feti_homog.analysis.context import AnalysisContext
from feti_homog.config.sections import LoadPath
from feti_homog.feti.dual_solution import DualSolution
from feti_homog.homogenization.averaging import Response
from feti_homog.interface.contact import BONDED, Equilibrium
from feti_homog.interface.path_following import PathState, Point, events, increments, unloaded
from feti_homog.interface.strength_criterion import StrengthCriterion
from feti_homog.output.files.checkpoint import Arrays, Checkpoint
from feti_homog.typing import Float

KKT_LAWS = ("kkt_complementarity", "kkt_penetration", "kkt_tension")


@dataclass
class _Dissipation:
    """Energy lost to new surfaces, per area of the cell, from one point to the next.

    A break happens at constant strain E, so it loses 1/2 E.(Sigma before - Sigma after).  On the first leg, all of
    one direction, the stress after it comes from the next point; else, from a solve.
    """

    context: AnalysisContext
    left: PathState
    total: float = 0.0
    pending: tuple[float, Float] | None = None

    def at(self, point: Point, response: Response) -> float:
        """What has been lost up to and including the arrival at this point; collective."""
        E, stress = point.state.solution.strain, response.stress / point.scale
        if self.pending is not None:
            scale, before = self.pending
            self.total += 0.5 * scale**2 * float(E @ (before - stress))
        elif point.broke and point.scale == 1.0:
            drop = self._stress(self.left, point, stress) - self._stress(point.after, point, stress)
            self.total += 0.5 * float(E @ drop)
        return self.recall(self.total, point, response)

    def recall(self, total: float, point: Point, response: Response) -> float:
        """Go on from a point up to which `total` has been lost."""
        self.total, self.left = total, point.after
        self.pending = (point.scale, response.stress / point.scale) if point.broke and point.scale < 1.0 else None
        return total

    def _stress(self, stand: PathState, point: Point, stress: Float) -> Float:
        """Sigma under the point's strain with what is debonded at `stand`; `stress` is that of the point itself."""
        homogenization = self.context.homogenization
        solver = homogenization.interface.solver
        same = np.array_equal(stand.status == BONDED, point.state.status == BONDED)
        if solver.comm.allreduce(same, MPI.LAND):
            return stress
        state = homogenization.interface.equilibrium(point.state.solution.strain, stand.status, stand.lam)
        return solver.stress_integral(state.solution) / homogenization.cell.plan.area


def run(
    context: AnalysisContext, path: LoadPath, law: StrengthCriterion, checkpoint: Checkpoint, resume: bool
) -> dict[str, Any]:
    """`path`, a list of points, one an event (or increment); each is checkpointed before the next is sought."""
    interface = context.homogenization.interface
    known = _known(context, checkpoint, resume)
    begin = unloaded(interface, context.status(None))
    dissipation, points = _Dissipation(context, begin), []
    for number, point in enumerate(_points(context, path, law, begin, [point for point, _ in known])):
        interface.solver.activate(interface.active(point.state.status))
        response = context.homogenization.response(point.state, point.scale)
        label, source = f"{'event' if path.method == 'events' else 'increment'} {number}", ""
        if number < len(known):
            dissipated, source = dissipation.recall(known[number][1], point, response), ", from the checkpoint"
        else:
            dissipated = dissipation.at(point, response)
            if point.state.solution.reason > 0:
                checkpoint.write(number, *_stored(point, dissipated))
        context.note(f"{label} at {point.load_factor:.6f}{source}", response)
        context.record(response, point.load_factor, label)
        points.append(
            {
                "load_factor": point.load_factor,
                "strain": response.strain,
                "stress": response.stress,
                "broke": point.broke,
                "loose": point.state.loose,
                "dissipated": dissipated,
            }
            | context.point([response])
        )
        if point.state.solution.reason < 0:
            # What broke next was decided on a state that does not hold.
            break
        if number + 1 == path.max_events and point.load_factor < 1.0:
            context.faults.append(f"[path] max_events = {number + 1}: the path was not finished; result marked")
            break
    return {"path": points, "resumed": len(known)}


def _known(context: AnalysisContext, checkpoint: Checkpoint, resume: bool) -> list[tuple[Point, float]]:
    """The points of the checkpoint and what was dissipated up to each, if they are wanted; else it is cleared.

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
    context: AnalysisContext, path: LoadPath, law: StrengthCriterion, begin: PathState, known: Sequence[Point]
) -> Iterator[Point]:
    """The points of the checkpoint, then those still to be found."""
    yield from known
    interface, waypoints = context.homogenization.interface, np.array(path.targets)
    begin = known[-1].after if known else begin
    if path.method == "events":
        yield from events(interface, law, waypoints, begin)
    else:
        yield from increments(interface, law, waypoints, path.increments or 1, path.release == "worst", begin)


def _stored(point: Point, dissipated: float) -> tuple[dict[str, Any], Arrays]:
    """A point as plain numbers and distributed arrays, for the checkpoint."""
    state, solution, after = point.state, point.state.solution, point.after
    whole: dict[str, Any] = {
        "path": [point.load_factor, point.scale, float(after.leg), after.position, dissipated],
        "numbers": [point.broke, state.iterations, state.solves, state.loose, solution.iterations, solution.reason],
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


def _restored(event: Arrays) -> tuple[Point, float]:
    """What `_stored` took apart."""
    load_factor, scale, leg, position, dissipated = event["path"].tolist()
    broke, iterations, solves, loose, last, reason = event["numbers"].tolist()
    solution = DualSolution(
        event["strain"], event["lam"], event["jump"], event["alpha"], last, reason, float(event["residual"])
    )
    certificate = dict(zip(KKT_LAWS, event["certificate"].tolist(), strict=True))
    state = Equilibrium(event["status"], solution, iterations, solves, loose, certificate)
    after = PathState(int(leg), position, event["status_after"], event["lam_after"])
    return Point(load_factor, scale, state, broke, after), dissipated
