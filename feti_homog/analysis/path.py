"""`analysis.type = "path"`: load-induced debonding along a path of macroscopic strain, Section III.F and Fig. 5."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feti_homog.analysis.study import Study
from feti_homog.feti.solver import DualSolution
from feti_homog.homogenization import Response
from feti_homog.interface.contact import Equilibrium
from feti_homog.interface.debonding import Point, Stand, events, increments, unloaded
from feti_homog.interface.law import Law
from feti_homog.output.checkpoint import Arrays, Checkpoint
from feti_homog.sections import LoadPath

Float = NDArray[np.float64]

KKT_LAWS = ("kkt_complementarity", "kkt_penetration", "kkt_tension")


@dataclass
class _Dissipation:
    """Energy lost to new surfaces, per area of the cell, from one point to the next.

    A break happens at constant strain E, so it loses 1/2 E.(Sigma before - Sigma after).  The stress after comes
    from the next point where the leg is proportional (one strain, other amplitude), else from a solve.
    """

    study: Study
    total: float = 0.0
    pending: tuple[float, Float] | None = None

    def at(self, point: Point, response: Response) -> float:
        """What has been lost up to and including the arrival at this point; collective."""
        E, unit = point.state.solution.strain, response.stress / point.scale
        if self.pending is not None:
            scale, before = self.pending
            self.total += 0.5 * scale**2 * float(E @ (before - unit))
        self.pending = (point.scale, unit) if point.broke and point.scale < 1.0 else None
        if point.broke and point.scale == 1.0:
            self.total += 0.5 * float(E @ self._drop(point, unit))
        return self.total

    def _drop(self, point: Point, stress: Float) -> Float:
        """Sigma before the break less Sigma after it."""
        interface, area = self.study.homogenization.interface, self.study.homogenization.cell.plan.area
        relaxed = interface.equilibrium(point.state.solution.strain, point.after.status, point.after.lam)
        return stress - interface.solver.stress_integral(relaxed.solution) / area


def run(study: Study, path: LoadPath, law: Law, checkpoint: Checkpoint, resume: bool) -> dict[str, Any]:
    """`path`, a list of points, one an event (or increment); each is checkpointed before the next is sought."""
    known = [_restored(arrays) for arrays in checkpoint.read()] if resume else []
    if not resume and (old := checkpoint.clear()):
        study.progress.say(f"  {old} events of an earlier run are dropped; --resume would go on from them")
    if known:
        study.progress.say(f"  {len(known)} events are taken from the checkpoint")
    dissipation, points = _Dissipation(study), []
    for number, point in enumerate(_points(study, path, law, known)):
        if number >= len(known):
            checkpoint.write(number, *_stored(point))
        study.homogenization.interface.solver.activate(study.homogenization.interface.active(point.state.status))
        response = study.homogenization.response(point.state, point.scale)
        study.note(f"{number:4d} at {point.load_factor:.6f}", response)
        study.record(response, point.load_factor)
        points.append(
            {
                "load_factor": point.load_factor,
                "strain": response.strain,
                "stress": response.stress,
                "broke": point.broke,
                "loose": point.state.loose,
                "dissipated": dissipation.at(point, response),
            }
            | study.point([response])
        )
        if number + 1 == path.max_events:
            study.faults.append(f"[path] max_events = {number + 1}: the path was not finished; result marked")
            break
    return {"path": points}


def _points(study: Study, path: LoadPath, law: Law, known: Sequence[Point]) -> Iterator[Point]:
    """The points of the checkpoint, then those still to be found."""
    yield from known
    interface, waypoints = study.homogenization.interface, np.array(path.targets)
    begin = known[-1].after if known else unloaded(interface, study.status(None))
    if path.method == "events":
        yield from events(interface, law, waypoints, begin)
    else:
        yield from increments(interface, law, waypoints, path.increments or 1, path.release == "worst", begin)


def _stored(point: Point) -> tuple[dict[str, Any], Arrays]:
    """A point as plain numbers and distributed arrays, for the checkpoint."""
    state, solution, after = point.state, point.state.solution, point.after
    whole: dict[str, Any] = {
        "path": [point.load_factor, point.scale, float(after.leg), after.position],
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


def _restored(event: Arrays) -> Point:
    """The point that `_stored` took apart."""
    load_factor, scale, leg, position = event["path"].tolist()
    broke, iterations, solves, loose, last, reason = event["numbers"].tolist()
    solution = DualSolution(
        event["strain"], event["lam"], event["jump"], event["alpha"], last, reason, float(event["residual"])
    )
    certificate = dict(zip(KKT_LAWS, event["certificate"].tolist(), strict=True))
    state = Equilibrium(event["status"], solution, iterations, solves, loose, certificate)
    after = Stand(int(leg), position, event["status_after"], event["lam_after"])
    return Point(load_factor, scale, state, broke, after)
