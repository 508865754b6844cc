"""`analysis.type = "path"`: load-induced debonding along a path of macroscopic strain, Section III.F and Fig. 5."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.path_events import Dissipation, Energies, restored, stored
from feti_homog.analysis.tip_records import TipRecorder
from feti_homog.common.event_progress import EVENTS_BAR, STEPS_BAR, EventProgress
from feti_homog.config.load_section import LoadPath
from feti_homog.config.mixed_load import MixedLoad, Strain
from feti_homog.errors import CaseError
from feti_homog.homogenization.averaging import Response
from feti_homog.interface.bond_criterion import BondCriterion, spring_criterion
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

    `states` has the numbers of the points whose fields are recorded; which, is chosen when all are known.
    """
    known = _known(context, checkpoint, resume)
    dissipation, entries, last = Dissipation(), list[dict[str, Any]](), None
    with EventProgress(context.progress, BARS[path.method], event_log.NAME) as shown:
        for number, (point, energies) in enumerate(_points(context, path, criterion, checkpoint, known)):
            response = context.homogenization.response(point.state, point.scale)
            source = "" if energies is None else ", from the checkpoint"
            if energies is not None:
                dissipation.recall(energies, point)
            else:
                dissipation.arrive(point)
                if point.state.solution.reason > 0:
                    checkpoint.write(number, *stored(point, dissipation))
            _tell(context, shown, f"{_label(path, number)} at {point.load_factor:.6f}{source}", response)
            entries.append(_entry(context, criterion, point, response, dissipation))
            shown.advance(point.load_factor, f"{len(entries)} {path.method}, {_counts(entries[-1])}")
            last = point
            if not _goes_on(context, path, point, number + 1):
                break
    return {"path": entries, "resumed": known} | _kept(context, path, criterion, checkpoint, entries, last)


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
) -> Iterator[tuple[Point, Energies | None]]:
    """The points of the checkpoint with the energies up to each, then those still to be found."""
    interface, waypoints = context.homogenization.interface, np.array([_strain(load) for load in path.targets])
    begin = unloaded(interface, context.status(None))
    for number in range(known):
        point, energies = restored(checkpoint.read(number))
        begin = point.after
        yield point, energies
    if path.method == "events":
        found = events(interface, criterion, waypoints, begin)
    else:
        found = increments(interface, criterion, waypoints, path.increments or 1, path.release == "worst", begin)
    yield from ((point, None) for point in found)


def _strain(load: Strain | MixedLoad) -> Strain:
    """The strain, which is all that is followed. Raises CaseError."""
    if isinstance(load, MixedLoad):
        raise CaseError("[path]: loads by name are not followed; give strain, or waypoints of three strains")
    return load


def _tell(context: AnalysisContext, shown: EventProgress, name: str, response: Response) -> None:
    """Check a response; its line goes to the log and, if it is due or tells of a fault, to the terminal."""
    faults = len(context.faults)
    line = context.record_checks(name, response)
    context.log(line)
    shown.tell(line, urgent=len(context.faults) > faults)


def _label(path: LoadPath, number: int) -> str:
    return f"{'event' if path.method == 'events' else 'increment'} {number}"


def _entry(
    context: AnalysisContext, criterion: BondCriterion, point: Point, response: Response, dissipation: Dissipation
) -> dict[str, Any]:
    """What result.json says of a point."""
    return {
        "load_factor": point.load_factor,
        "strain": response.strain,
        "stress": response.stress,
        "broke": point.broke,
        "free_motions": point.state.free_motions,
        "stored": response.stored,
        "stored_in_springs": response.in_springs,
        "dissipated": dissipation.followed,
        "dissipated_strain_controlled": dissipation.strain_controlled,
        **({} if spring_criterion(criterion) is None else _fracture(dissipation)),
    } | context.point([response])


def _fracture(dissipation: Dissipation) -> dict[str, float]:
    """What bonds that break by energy have lost beside their toughness."""
    energy = dissipation.fracture
    return {"fracture_energy": energy} | ({"dissipation_ratio": dissipation.followed / energy} if energy else {})


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


def _kept(
    context: AnalysisContext,
    path: LoadPath,
    criterion: BondCriterion,
    checkpoint: Checkpoint,
    entries: Sequence[dict[str, Any]],
    last: Point | None,
) -> dict[str, Any]:
    """Tips and fields of the points that are kept, from the checkpoint, in which the last one may not be; `states`, the
    numbers of those whose fields are recorded."""
    springs = spring_criterion(criterion)
    if last is None or (springs is None and not context.keeps_fields):
        return {}
    numbers = kept(entries, context.states, len(path.targets) if path.method == "events" else 0)
    tips = None if springs is None else TipRecorder(context.homogenization, springs)
    with context.progress.stage("states") as words:
        for number in context.progress.bar(numbers, "states"):
            point = last if number == len(entries) - 1 else restored(checkpoint.read(number))[0]
            if tips is not None:
                entries[number]["tips"] = tips.of(point)
            if context.keeps_fields:
                response = context.homogenization.response(point.state, point.scale)
                context.record(response, None, point.load_factor, _label(path, number), number)
        words.append(f"{len(numbers)} of {len(entries)} points")
    return {"states": numbers} if context.keeps_fields else {}
