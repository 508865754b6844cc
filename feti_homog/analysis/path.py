"""`analysis.type = "path"`: load-induced debonding along a path of macroscopic strain, Section III.F and Fig. 5."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.criteria import criterion_of
from feti_homog.analysis.event_progress import BARS, EventProgress
from feti_homog.analysis.mesh_errors import check_accuracy, state_error
from feti_homog.analysis.path_events import Work, averages, found_again, holding, read, restored, stored
from feti_homog.analysis.registry import Analysis
from feti_homog.analysis.result_records import PathPoint, Peak
from feti_homog.analysis.tip_records import TipRecorder
from feti_homog.case.loads import LoadPath
from feti_homog.errors import NotCarriedError
from feti_homog.homogenization.averaging import Response
from feti_homog.interface.friction.coulomb_faces import StuckError
from feti_homog.interface.friction.sliding_cell import SlidingCell
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.path.coulomb_leg import CoulombLeg
from feti_homog.interface.path.frictionless_leg import FrictionlessLeg
from feti_homog.interface.path.path_following import events, increments
from feti_homog.interface.path.path_points import Energies, Point, unloaded
from feti_homog.materials.voigt import voigt_names
from feti_homog.results.checkpoint import has_multipliers
from feti_homog.results.landmarks import kept, marks, peak_of

MOST_NAMED = 8  # fibres in a remark
SHOWN = 1e-9  # least stress in a fault, relative to the largest


def run(context: AnalysisContext) -> dict[str, Any]:
    """Return the path of the case, until its bonds break; see `follow`."""
    section = context.case.section
    assert isinstance(section, LoadPath)
    return follow(context, section, criterion_of(context.cell, grows=True))


def follow(context: AnalysisContext, path: LoadPath, law: BondLaw) -> dict[str, Any]:
    """`path`, a list of points, one an event (or increment), which go to the checkpoint as they are found.

    `states` has the numbers of the points whose fields are recorded; which, is chosen when all are known.
    """
    check_accuracy(context)
    known = _known(context, law)
    work, entries, last = Work(), list[dict[str, Any]](), None
    progress = EventProgress(context.progress, BARS[path.method], context.events)
    with progress as shown:
        for number, (point, energies, responses) in enumerate(_points(context, path, law, known)):
            place = f"at {point.load_factor:.6f}, {responses[0].leading}"
            place += "" if energies is None else ", from the checkpoint"
            if energies is not None:
                work.resume_from(*energies, point)
            else:
                work.arrive(point)
                if point.state.converged:
                    # Teeth are many and found again at once.
                    light = point.broke == 0 < point.softened
                    event = stored(point, responses, work, context.loads.interfaces)
                    context.checkpoint.write(number, *event, light=light)
            _report(context, shown, f"{_label(path, number)} {place}", responses)
            entries.append(_entry(context, law, point, responses, work))
            shown.advance(point.load_factor, f"{len(entries)} {path.method}, {_counts(entries[-1])}")
            last = point
            if not _goes_on(context, path, point, number + 1):
                break
    if last is None:
        return {"path": (), "resumed": known}
    states: dict[str, Any] = {}
    if law.has_tips or context.states.has_place:
        states = _kept(context, path, law, entries, last)
    else:
        _checked(context, last, _label(path, len(entries) - 1))
    _remark_loose_fibres(context, last)
    document = _document(context, entries)
    for number, words in marks(document).items():
        entries[number]["mark"] = words
    points = tuple(PathPoint(**entry) for entry in entries)
    return {"path": points, "peak": Peak(**peak_of(document)), "resumed": known} | states


def _remark_loose_fibres(context: AnalysisContext, last: Point) -> None:
    """Remark the fibres that no bond holds in the end, the first of many, if faces have friction.  Collective."""
    if context.case.has_friction and (loose := context.fibre_interfaces.loose(last.after.bonds.status)):
        shown = ", ".join(map(str, loose[:MOST_NAMED])) + (", ..." if len(loose) > MOST_NAMED else "")
        fibres = f"{len(loose)} fibres ({shown})" if len(loose) > 1 else f"fibre {shown}"
        context.notes.append(
            f"[path] no bond of {fibres} holds: with friction such a fibre may have several equilibria under one load, "
            "and the path has one of them, by the order of nodes"
        )


def _document(context: AnalysisContext, entries: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return what result.json will have of the path."""
    return {"case": context.case.resolved(), "path": entries}


def _known(context: AnalysisContext, law: BondLaw) -> int:
    """Return how many events of the checkpoint are used; if none are wanted it is cleared.

    Raises:
        CaseError: the checkpoint cannot be used.
    """
    if context.resume:
        known = context.checkpoint.count()
        if (count := holding(context, law, known)) < known:
            context.progress.say(
                f"  event {count} of the checkpoint does not hold: it and all after it are found again"
            )
        words = f"{count} events are taken from the checkpoint"
        context.progress.say(f"  {words if known else 'there is no checkpoint: the path begins at its beginning'}")
        return count
    if dropped := context.checkpoint.clear():
        context.progress.say(f"  {dropped} events of an earlier run are dropped; --resume would have gone on from them")
    return 0


def _points(
    context: AnalysisContext, path: LoadPath, law: BondLaw, known: int
) -> Iterator[tuple[Point, tuple[Energies, float] | None, list[Response]]]:
    """Yield the points of the checkpoint with the energies up to each, then those still to be found, and all responses.

    Where nothing carries the stresses any more, or faces with friction cannot go on, the path ends with a fault.

    Raises:
        NotCarriedError: nothing carries them from the beginning.
    """
    cell, waypoints = context.loads.interfaces, [context.loads.load(target) for target in context.case.targets]
    begin = unloaded(cell, context.bonds(None))
    responses: list[Response] = []
    for number in range(known):
        event = context.checkpoint.read(number)
        point, energies = restored(event, cell)
        if number == known - 1 and not has_multipliers(event):  # from which the path goes on
            point = found_again(point, cell, law)
        begin, responses = point.after, averages(event, point, context.loads)
        yield point, energies, responses
    engine = partial(CoulombLeg, sliding=_sliding_cell(context)) if context.case.has_friction else FrictionlessLeg
    if path.method == "events":
        whole = events(cell, law, waypoints, begin, engine)
    else:
        whole = increments(cell, law, waypoints, path.increments or 1, path.release == "worst", begin, engine)
    count = known
    try:
        for count, point in enumerate(whole, known + 1):  # noqa: B007
            responses = context.loads.responses(point.state, point.scale, brief=True)
            yield point, None, responses
    except NotCarriedError as error:
        if count == 0:
            raise _with_advice(error, "", path) from error
        context.checks.faults.append(str(_with_advice(error, _place_of(context, responses), path)))


def _place_of(context: AnalysisContext, responses: list[Response]) -> str:
    """Return where a path ended, in words: beyond the last point, with the stresses that it reached."""
    stress = np.asarray(context.loads.means(responses)["stress"])
    pairs = zip(voigt_names(len(stress))[1], stress, strict=True)
    shown = [f", {name} {value:.6g}" for name, value in pairs if abs(value) > SHOWN * np.abs(stress).max()]
    return f" beyond the last point{''.join(shown)}"


def _with_advice(error: NotCarriedError, place: str, path: LoadPath) -> NotCarriedError:
    """Return an error that ends a path, with its place, empty before the first point, and what may lead further."""
    if isinstance(error, StuckError):
        more = "" if path.method == "events" else " or more increments"
        return StuckError(f"[path]: {error}{place}; a smaller friction{more} may lead further")
    return NotCarriedError(f"[path]: {error}{place}; prescribe strains there") if place else error


def _sliding_cell(context: AnalysisContext) -> SlidingCell:
    """Return the faces of the case with the friction of its interfaces.  Collective; raises as `SlidingCell`."""
    cell, pair = context.loads.interfaces, context.loads.interfaces.nodes.pair
    friction, of_damage = np.array([each.rubbing for each in context.case.interfaces]).T
    return SlidingCell(cell, friction[pair], of_damage[pair])


def _report(context: AnalysisContext, shown: EventProgress, name: str, responses: Sequence[Response]) -> None:
    """Check the responses of a point; their lines go to the log and, if due or with a fault, to the terminal."""
    for response, problem in zip(responses, ("", ", along the fibres"), strict=False):
        faults = len(context.checks.faults)
        line = context.checks.record(f"{name}{problem}", response)
        context.log(line)
        shown.report(line, urgent=len(context.checks.faults) > faults)


def _label(path: LoadPath, number: int) -> str:
    return f"{'event' if path.method == 'events' else 'increment'} {number}"


def _entry(
    context: AnalysisContext, law: BondLaw, point: Point, responses: Sequence[Response], work: Work
) -> dict[str, Any]:
    """Return the entry of a point in result.json.  Collective."""
    damage = law.damage(point.state.bonds)
    softening = {}
    if damage is not None:
        length = context.fibre_interfaces.damaged_length(damage)
        softening = {"softened": point.softened, "damaged_length": length}
    return {
        "load_factor": point.load_factor,
        "broke": point.broke,
        **softening,
        "free_motions": point.state.free_motions,
        "work": work.all_equilibria.work,
        "dissipated": work.all_equilibria.released,
        "dissipated_strain_controlled": work.load_controlled,
        **({"friction_heat": work.all_equilibria.friction} if context.case.has_friction else {}),
        **(_fracture(work.all_equilibria) if law.has_toughness else {}),
    } | context.loaded_point(responses)


def _fracture(all_equilibria: Energies) -> dict[str, float]:
    """Return the energy that bonds lost by breaking, beside their toughness."""
    energy = all_equilibria.fracture
    return {"fracture_energy": energy} | ({"dissipation_ratio": all_equilibria.released / energy} if energy else {})


def _counts(entry: Mapping[str, Any]) -> str:
    return f"{entry['bonded']} bonded, {entry['open'] + entry['closed']} broken"


def _goes_on(context: AnalysisContext, path: LoadPath, point: Point, count: int) -> bool:
    """Return whether the path goes on after the last of so many points."""
    if not point.state.converged:
        # What broke next was decided on a state that does not hold.
        return False
    if count == path.max_events and point.load_factor < 1.0:
        context.checks.faults.append(
            f"[path] max_events = {count}: the path was not finished: "
            'result.json has status "not converged"; --resume with a higher max_events goes on'
        )
        return False
    return True


def _kept(
    context: AnalysisContext, path: LoadPath, law: BondLaw, entries: Sequence[dict[str, Any]], last: Point
) -> dict[str, Any]:
    """Tips and fields of the points that are kept, from the checkpoint, in which the last one may not be.

    `states`, the numbers of those whose fields are recorded.
    """
    legs = len(context.case.targets) if path.method == "events" else 0
    numbers = kept(entries, context.case.output.states, legs, marks(_document(context, entries)))
    tips = TipRecorder(context.cell, context.loads.interfaces, law) if law.has_tips else None
    with context.progress.stage("states") as words:
        for number in context.progress.bar(numbers, "states"):
            point = last if number == len(entries) - 1 else read(context, law, number)[1]
            point, responses = _checked(context, point, _label(path, number))
            if tips is not None:
                entries[number]["tips"] = tips.of(point)
            if context.states.has_place:
                error, responses = state_error(context, responses)
                entries[number] |= error
                context.record_state(responses, point.load_factor, _label(path, number), number)
        words.append(f"{len(numbers)} of {len(entries)} points")
    return {"states": numbers} if context.states.has_place else {}


def _checked(context: AnalysisContext, point: Point, name: str) -> tuple[Point, Sequence[Response]]:
    """Return a point with what F lambda gives, whose checks are recorded, and its responses.  Collective."""
    point = replace(point, state=context.loads.interfaces.completed(point.state))
    responses = context.loads.responses(point.state, point.scale)
    for response in responses:
        context.checks.require(name, response.checks)
    return point, responses


ANALYSIS = Analysis(run, table=True, events=True)
