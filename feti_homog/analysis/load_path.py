"""`analysis.type = "path"`: load-induced debonding along a path of macroscopic strain, Section III.F and Fig. 5."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.path_events import Dissipation, Losses, restored, stored
from feti_homog.common.event_progress import EVENTS_BAR, STEPS_BAR, EventProgress
from feti_homog.config.sections import LoadPath
from feti_homog.homogenization.averaging import Response
from feti_homog.interface.bond_criterion import BondCriterion
from feti_homog.interface.path_following import events, increments
from feti_homog.interface.path_points import Point, unloaded
from feti_homog.mechanics.kept_points import kept
from feti_homog.output.files import event_log
from feti_homog.output.files.checkpoint import Checkpoint

BARS = {"events": EVENTS_BAR, "increments": STEPS_BAR}


def run(
    context: AnalysisContext, path: LoadPath, criterion: BondCriterion, checkpoint: Checkpoint, resume: bool
) -> dict[str, Any]:
    """`path`, a list of points, one an event (or increment); each is checkpointed before the next is sought.

    `states` has the numbers of the points whose fields are recorded, which are chosen when all are known.
    """
    known = _known(context, checkpoint, resume)
    dissipation, entries, last = Dissipation(), list[dict[str, Any]](), None
    with EventProgress(context.progress, BARS[path.method], event_log.NAME) as shown:
        for number, (point, losses) in enumerate(_points(context, path, criterion, checkpoint, known)):
            response, source = _response(context, point), "" if losses is None else ", from the checkpoint"
            if losses is not None:
                dissipation.recall(*losses, point)
            else:
                dissipation.arrive(point)
                if point.state.solution.reason > 0:
                    checkpoint.write(number, *stored(point, dissipation))
            _tell(context, shown, f"{_label(path, number)} at {point.load_factor:.6f}{source}", response)
            entries.append(_entry(context, point, response, dissipation))
            shown.advance(point.load_factor, f"{len(entries)} {path.method}, {_counts(entries[-1])}")
            last = point
            if not _goes_on(context, path, point, number + 1):
                break
    return {"path": entries, "resumed": known} | _recorded(context, path, checkpoint, entries, last)


def _known(context: AnalysisContext, checkpoint: Checkpoint, resume: bool) -> int:
    """How many events of the checkpoint are used; if none are wanted it is cleared.

    Raises:
        CaseError: the checkpoint cannot be used.
    """
    if resume:
        known = checkpoint.count()
        context.progress.say(
            f"  {known} events are taken from the checkpoint"
            if known
            else "  there is no checkpoint: the path begins at its beginning"
        )
        return known
    if dropped := checkpoint.clear():
        context.progress.say(f"  {dropped} events of an earlier run are dropped; --resume would have gone on from them")
    return 0


def _points(
    context: AnalysisContext, path: LoadPath, criterion: BondCriterion, checkpoint: Checkpoint, known: int
) -> Iterator[tuple[Point, Losses | None]]:
    """The points of the checkpoint with what was lost up to each, then those still to be found."""
    interface, waypoints = context.homogenization.interface, np.array(path.targets)
    begin = unloaded(interface, context.status(None))
    for number in range(known):
        point, losses = restored(checkpoint.read(number))
        begin = point.after
        yield point, losses
    if path.method == "events":
        found = events(interface, criterion, waypoints, begin)
    else:
        found = increments(interface, criterion, waypoints, path.increments or 1, path.release == "worst", begin)
    yield from ((point, None) for point in found)


def _response(context: AnalysisContext, point: Point) -> Response:
    """The averages of a point's state.  Collective."""
    interface = context.homogenization.interface
    interface.solver.activate(interface.active(point.state.status))
    return context.homogenization.response(point.state, point.scale)


def _tell(context: AnalysisContext, shown: EventProgress, name: str, response: Response) -> None:
    """Check a response; its line goes to the log and, if it is due or tells of a fault, to the terminal."""
    faults = len(context.faults)
    line = context.record_checks(name, response)
    context.log(line)
    shown.tell(line, urgent=len(context.faults) > faults)


def _label(path: LoadPath, number: int) -> str:
    return f"{'event' if path.method == 'events' else 'increment'} {number}"


def _entry(context: AnalysisContext, point: Point, response: Response, dissipation: Dissipation) -> dict[str, Any]:
    """What result.json says of a point."""
    return {
        "load_factor": point.load_factor,
        "strain": response.strain,
        "stress": response.stress,
        "broke": point.broke,
        "free_motions": point.state.free_motions,
        "dissipated": dissipation.followed,
        "dissipated_strain_controlled": dissipation.strain_controlled,
    } | context.point([response])


def _counts(entry: Mapping[str, Any]) -> str:
    return f"{entry['bonded']} bonded, {entry['open'] + entry['closed']} broken"


def _goes_on(context: AnalysisContext, path: LoadPath, point: Point, count: int) -> bool:
    """Whether the path goes on after the last of so many points."""
    if point.state.solution.reason < 0:
        # What broke next was decided on a state that does not hold.
        return False
    if count == path.max_events and point.load_factor < 1.0:
        context.faults.append(
            f"[path] max_events = {count}: the path was not finished: "
            'result.json has status "not converged"; --resume with a higher max_events goes on'
        )
        return False
    return True


def _recorded(
    context: AnalysisContext,
    path: LoadPath,
    checkpoint: Checkpoint,
    entries: Sequence[dict[str, Any]],
    last: Point | None,
) -> dict[str, Any]:
    """`states`, the points whose fields are wanted, recorded from the checkpoint; the last one may not be in it."""
    if context.states is None or last is None:
        return {}
    legs = len(path.targets) if path.method == "events" else 0
    numbers = kept(entries, context.states, legs)
    with context.progress.stage("fields") as words:
        for number in context.progress.bar(numbers, "fields"):
            point = last if number == len(entries) - 1 else restored(checkpoint.read(number))[0]
            context.record(_response(context, point), point.load_factor, _label(path, number), number)
        words.append(f"{len(numbers)} of {len(entries)} points")
    return {"states": numbers}
