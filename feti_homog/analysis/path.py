"""`analysis.type = "path"`: debonding along a path of loads, Section III.F and Fig. 5 of the paper."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from shlex import quote
from typing import Any

import numpy as np

from feti_homog.analysis import path_events, stepped_progress
from feti_homog.analysis.constants import check_accuracy, state_error
from feti_homog.analysis.context import AnalysisContext
from feti_homog.analysis.result_records import PathPoint, Peak
from feti_homog.analysis.tip_records import criterion_of, most_utilised_bond, tips
from feti_homog.case import load_sections
from feti_homog.errors import NotCarriedError
from feti_homog.homogenization import averaging
from feti_homog.interface.friction import coulomb_faces, sliding_cell
from feti_homog.interface.laws import BondLaw
from feti_homog.interface.path import coulomb_leg, frictionless_leg, path_following, path_points
from feti_homog.materials import voigt
from feti_homog.results import checkpoints, landmarks, path_curves, result_json
from feti_homog.system.runtime import records, standard_streams

OF_FIBRES = ("debonded_length", "debonding_angle")  # lists over fibres, kept at points whose fields are kept
NAMED_FIBRES = 8  # most fibre names in a remark


def run(context: AnalysisContext) -> dict[str, Any]:
    """Follow the path of the case and return its `Result` entries.  Collective.

    `path` has each event or increment, `peak` the landmarks, `resumed` the count of restored points, and `states` the
    numbers of points with recorded fields, if any; without points only `path` and `resumed` exist.  New converged
    points are stored.  Raises CaseError like `criterion_of` and for a faulty checkpoint, NotCarriedError like
    `_points`.
    """
    path, law, cell = context.case.section, criterion_of(context.cell, grows=True), context.loads.interfaces
    assert isinstance(path, load_sections.LoadPath)
    check_accuracy(context)
    count = min(path_events.resumable(context), path.max_events)
    work, last, top = path_events.Work(), None, ""
    entries, bonds = list[dict[str, Any]](), list[tuple[float, float]]()
    may_fall = any(map(context.case.targets[0].get, voigt.SPATIAL_STRESSES))  # until a line reports the fall
    with stepped_progress.shown(context.progress, "load") as advance:
        for number, (point, before, responses) in enumerate(_points(context, path, law, count)):
            if before is None:
                work.arrive(point)
                bonds.append(most_utilised_bond(context, law, point))
            else:
                energies, load_controlled, bond = before
                work.resume_from(energies, load_controlled, point)
                bonds.append(bond)
            entry = _entry(context, law, point, responses, work)
            entries.append(entry)
            if before is None and point.state.converged:
                event = path_events.stored(point, bonds[-1], responses, work, cell, _without_lists(entry))
                _keep(context, number, event)
            place = f"at {point.load_factor:.6f}, {responses[0].leading}{', from the checkpoint' if before else ''}"
            _record_checks(context, f"{_label(path, number)} {place}", responses, is_first=number == 0)
            points = f"{len(entries)} {path.method.removesuffix('s') if len(entries) == 1 else path.method}"
            counts = f"{points}, {entry['bonded']} bonded, {entry['open'] + entry['closed']} broken"
            if (damage := law.damage(point.state.bonds)) is not None:
                counts += f", {context.cell.comm.allreduce(int(((damage > 0.0) & (damage < 1.0)).sum()))} damaged"
            is_known = number == 0 or before is not None  # the first break takes much of the load, and no time
            advance(point.load_factor, len(entries), counts, is_known)
            if point.load_factor == work.largest_load:
                top = place
            if may_fall and point.load_factor < (1.0 - landmarks.LEAST_FALL) * work.largest_load:
                way = "the path ends at load factor 1, perhaps much later; with a prescribed strain it ends earlier"
                context.progress.say(f"  the load falls from its largest value so far, {top}; {way}")
                context.notes.append(f"[path] under a load that only rises, the strain jumps {top}")
                may_fall = False
            last = point
            if not point.state.converged:  # the next break would follow from an unconverged state
                break
            if len(entries) == path.max_events and point.load_factor < 1.0:
                end = 'the path was not finished: the result has status "not converged"'
                by = "--resume with " if context.directory else ""
                cure = f"{by}a higher max_events goes on{context.case.fewer_events}"
                context.checks.faults.append(f"[path] max_events = {path.max_events}: {end}; {cure}")
                break
    if last is None:
        return {"resumed": count, "path": ()}
    context.progress.say(f"  {points} in {result_json.LOG if context.directory else 'result.path'}")
    return {"resumed": count} | _completed(context, path, law, entries, bonds, last)


def _keep(context: AnalysisContext, number: int, event: tuple[dict[str, Any], checkpoints.Arrays]) -> None:
    """Write the event of point `number` to the checkpoint; prepare the remark for an interruption.  Collective."""
    context.checkpoint.write(number, *event)
    if folder := context.directory:
        line = f"{number + 1} points are in {folder}: `plot {quote(str(folder))}` draws them"
        standard_streams.remarks[:] = [f"{line}; to go on, add --resume to `run`; a study goes on by itself"]


def _record_checks(
    context: AnalysisContext, place: str, responses: Sequence[averaging.Response], is_first: bool
) -> None:
    """Record and log the checks of responses at a point; print the line of the first point, and lines of new faults."""
    for response, problem in zip(responses, ("", ", along the fibres"), strict=False):
        faults = len(context.checks.faults)
        line = context.checks.record(f"{place}{problem}", response)
        context.log(line)
        if is_first or len(context.checks.faults) > faults:
            context.progress.say(line)


def _points(
    context: AnalysisContext, path: load_sections.LoadPath, law: BondLaw, stored_events: int
) -> Iterator[tuple[path_points.Point, path_events.Before | None, list[averaging.Response]]]:
    """Yield (point, `Before` or None, responses) along the path.  Collective.

    First come the `stored_events` of the checkpoint, each with the `Before` of `path_events.read`, then new points
    with None.  The path ends with a fault where the cell no longer carries the stresses, or friction has no
    equilibrium.  Raises NotCarriedError if the cell does not carry the stresses of the first point.
    """
    cell, waypoints = context.loads.interfaces, [context.loads.load(target) for target in context.case.targets]
    begin = path_points.unloaded(cell, context.bonds(None))
    responses: list[averaging.Response] = []
    for number in range(stored_events):
        is_last = number == stored_events - 1  # the path continues from this point
        event, point, before = path_events.read(context, number, solves=is_last)
        begin, responses = point.after, path_events.averages(event, point, context.loads)
        yield point, before, responses
    engine: type[frictionless_leg.FrictionlessLeg] | partial[coulomb_leg.CoulombLeg] = frictionless_leg.FrictionlessLeg
    if context.case.has_friction:
        coefficients = np.array([(face.friction, face.friction_on_damage) for face in context.case.interfaces])
        friction, on_damage = coefficients[cell.nodes.pair].T
        engine = partial(coulomb_leg.CoulombLeg, sliding=sliding_cell.SlidingCell(cell, friction, friction * on_damage))
    if path.method == "events":
        points = path_following.events(cell, law, waypoints, begin, engine)
    else:
        points = path_following.increments(
            cell, law, waypoints, path.increments or 1, path.release == "worst", begin, engine
        )
    count = stored_events
    try:
        for count, point in enumerate(points, stored_events + 1):  # noqa: B007
            responses = context.loads.responses(point.state, point.scale, brief=True)
            yield point, None, responses
    except NotCarriedError as error:
        if count == 0:
            raise _with_advice(error, "", path) from error
        stress = np.asarray(context.loads.means(responses)["stress"])
        names, acting = voigt.voigt_names(len(stress))[1], path_curves.components_above(path_curves.ZERO, stress[None])
        large = [f", {names[component]} {stress[component]:.6g}" for component in acting]
        context.checks.faults.append(str(_with_advice(error, f" beyond the last point{''.join(large)}", path)))


def _with_advice(error: NotCarriedError, place: str, path: load_sections.LoadPath) -> NotCarriedError:
    """Return the error that ends a path, with a remedy and the last point, `place` (empty before the first point)."""
    if isinstance(error, coulomb_faces.StuckError):
        more = "" if path.method == "events" else " or more increments"
        return coulomb_faces.StuckError(f"[path]: {error}{place}; a smaller friction{more} may lead further")
    return NotCarriedError(f"[path]: {error}{place}; prescribe strains there") if place else error


def _label(path: load_sections.LoadPath, number: int) -> str:
    return f"{'event' if path.method == 'events' else 'increment'} {number}"


def _without_lists(entry: dict[str, Any]) -> dict[str, Any]:
    """Return the entries of a point without lists over fibres, which only points with kept fields have."""
    return {name: value for name, value in entry.items() if name not in OF_FIBRES}


def _entry(
    context: AnalysisContext,
    law: BondLaw,
    point: path_points.Point,
    responses: Sequence[averaging.Response],
    work: path_events.Work,
) -> dict[str, Any]:
    """Build the entries of a `PathPoint`, except for tips, mesh error and mark.  Collective."""
    energies, damage = work.all_equilibria, law.damage(point.state.bonds)
    entry: dict[str, Any] = {
        "load_factor": point.load_factor,
        "broke": point.broke,
        "free_motions": point.state.free_motions,
        "work": energies.work,
        "dissipated": energies.released,
        "dissipated_strain_controlled": work.load_controlled,
    }
    if damage is not None:
        length = context.fibre_interfaces.length((damage > 0.0) & (damage < 1.0))
        entry |= {"softened": point.softened, "damaged_share": context.fibre_interfaces.share(length)}
    if context.case.has_friction:
        entry["friction_heat"] = energies.friction
    if law.has_toughness:
        entry["fracture_energy"] = energies.fracture
        if energies.fracture:
            entry["dissipation_ratio"] = energies.released / energies.fracture
    return entry | context.loaded_point(responses)


def _completed(
    context: AnalysisContext,
    path: load_sections.LoadPath,
    law: BondLaw,
    entries: list[dict[str, Any]],
    bonds: Sequence[tuple[float, float]],
    last: path_points.Point,
) -> dict[str, Any]:
    """Build the `Result` entries `path`, `peak` and, if states are recorded, `states`.  Collective.

    Changes `entries` in place: marks landmarks, adds tips and mesh errors at the kept points, and drops lists over
    fibres elsewhere.  Records the fields of the kept points, whose events, except the `last`, must be in the
    checkpoint.  `bonds` has the most utilised bond (fibre, direction) of each point, which `peak` names at landmarks.
    """
    document = {"case": context.case.resolved(), "path": entries}
    marks = landmarks.marks(document)
    legs = len(context.case.targets) if path.method == "events" else 0
    numbers = landmarks.kept(entries, context.case.output.states, legs, marks)
    for number in {*range(len(entries))}.difference(numbers):
        entries[number] = _without_lists(entries[number])
    if law.has_tips or context.states.is_recording:
        with context.progress.stage("states") as line:
            for number in numbers:
                point = last if number == len(entries) - 1 else path_events.read(context, number)[1]
                point, responses = _checked(context, point, _label(path, number))
                if law.has_tips:
                    entries[number]["tips"] = tips(context, law, point)
                if context.states.is_recording:
                    error, responses = state_error(context, responses)
                    entries[number] |= error
                    context.states.record({_label(path, number): responses}, point.load_factor, number)
            line.append(f"{len(numbers)} of {len(entries)} points")
    else:
        _checked(context, last, _label(path, len(entries) - 1))
    if context.case.has_friction and (loose := context.fibre_interfaces.loose(last.after.bonds.status)):
        more = ", ..." if len(loose) > NAMED_FIBRES else ""
        names = f"{', '.join(map(str, loose[:NAMED_FIBRES]))}{more}"
        fibres = f"{len(loose)} fibres ({names})" if len(loose) > 1 else f"fibre {names}"
        several = "with friction such a fibre may have several equilibria under one load"
        choice = "the path follows one of them, which depends on the order of nodes"
        context.notes.append(f"[path] no bond of {fibres} holds: {several}, and {choice}")
    rubs = any(bond.friction_on_damage for bond in context.case.interfaces)
    rubbing = "open", "closed", *(("damaged_share",) if rubs else ())
    if context.case.has_friction and not any(entry.get(name) for entry in entries for name in rubbing):
        context.notes.append("[interface] friction: without effect, for no face is debonded and no bond breaks")
    for number, mark in marks.items():
        entries[number]["mark"] = mark
    peak = landmarks.peak_of(document)
    for title in ("first_softening_", "first_break_", ""):
        fibre, angle = bonds[peak[f"{title}event"]] if f"{title}event" in peak else (np.nan, np.nan)
        if not np.isnan(fibre):
            peak |= {f"{title}fibre": int(fibre), f"{title}angle": angle}
    phases = records.plain(context.states.phase_stresses() or ())
    context.notes += landmarks.passed_strengths(document | {"phase_stresses": phases}, peak, numbers)
    states = {"states": numbers} if context.states.is_recording else {}
    return {"path": tuple(PathPoint(**entry) for entry in entries), "peak": Peak(**peak)} | states


def _checked(
    context: AnalysisContext, point: path_points.Point, name: str
) -> tuple[path_points.Point, Sequence[averaging.Response]]:
    """Complete a path point by products with the dual operator; return it and its checked responses.  Collective."""
    point = replace(point, state=context.loads.interfaces.completed(point.state))
    responses = context.loads.responses(point.state, point.scale)
    for response in responses:
        context.checks.require(name, response.checks)
    return point, responses
