"""Accumulate the energies of a path, convert its points to checkpoint events and back, and check stored events."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.analysis.context import AnalysisContext, CellLoads
from feti_homog.feti import DualSolution
from feti_homog.homogenization import averaging
from feti_homog.interface import Load, Macroscopic
from feti_homog.interface.contact import BONDED, BondState, Contact, Equilibrium, coupled_interfaces
from feti_homog.interface.path import path_points
from feti_homog.results import checkpoints, path_curves, result_json

# Errors of the contact conditions; the last exists only with friction.
KKT_LAWS = ("kkt_complementarity", "kkt_penetration", "kkt_tension", "kkt_friction")
# Laws for which the responses of an event may have errors.
LAWS = ("strain", "hill", "jump", "stress", *KKT_LAWS)
UNCHECKED = -1.0  # the error of a law that was not checked
EMPTY = np.zeros(0)
SUFFIXES = ("", "_axial")  # array name endings of the plane and the axial problem
UNKNOWN = ("alpha", "broken", "certificate", "bond")  # arrays with NaN for missing numbers

Before = tuple[path_points.Energies, float, tuple[float, float]]
"""Energies up to a stored point, `Work.load_controlled`, and the point's most utilised bond."""


@dataclass
class Work:
    """The energies per cell area up to a path point.

    The loss in breaks is the work of the loads minus the stored energy and the frictional heat.

    Attributes:
        all_equilibria: energies along all equilibria, where each bond breaks at its break load, with snap-back.
        load_controlled: loss if the load only rises on the first leg, as in a test.  A bond that breaks in a snap-back,
            at the load factor b, then breaks at the largest factor t so far.  The response is proportional to the load,
            so the loss is (t / b)^2 times the loss along all equilibria.
        largest_load: largest load factor so far.
    """

    all_equilibria: path_points.Energies = path_points.NO_ENERGIES
    load_controlled: float = 0.0
    largest_load: float = 0.0
    _load: float = 0.0

    def arrive(self, point: path_points.Point) -> None:
        """Add the energies and the loss since the previous point, and continue from `point`."""
        # Loads never fall after the first leg.
        rise = self.largest_load / self._load if self._load else 1.0
        controlled = self.load_controlled + rise**2 * point.energies.released
        self.resume_from(self.all_equilibria.plus(point.energies), controlled, point)

    def resume_from(self, energies: path_points.Energies, load_controlled: float, point: path_points.Point) -> None:
        """Continue from a stored `point` with the energies and the load-controlled loss up to it."""
        self.all_equilibria, self.load_controlled = energies, load_controlled
        self._load, self.largest_load = point.load_factor, max(point.load_factor, self.largest_load)


def stored(
    point: path_points.Point,
    bond: tuple[float, float],
    responses: Sequence[averaging.Response],
    work: Work,
    cell: coupled_interfaces.CoupledInterfaces,
    entry: Mapping[str, Any],
) -> tuple[dict[str, Any], checkpoints.Arrays]:
    """Split a path point into plain values, equal on all ranks, and this rank's arrays, for the checkpoint.

    `bond` comes from `tip_records.most_utilised_bond`; `entry` is the point's entry in result.json.
    """
    after = point.after
    numbers: dict[str, Any] = {
        "path": [point.load_factor, point.scale, float(after.leg), after.position, point.broke, point.softened],
        "energies": [*point.energies, *work.all_equilibria, work.load_controlled],
        "macroscopic": np.stack([after.origin.strain, after.origin.stress, after.last.strain, after.last.stress]),
        "broken": np.nan if after.broken is None else after.broken,
        "stretched": after.stretched,
        "bond": bond,
        "point": result_json.text_of(entry),
    }
    distributed = _bond_arrays(after.bonds, "_after")
    problems = zip(SUFFIXES, cell.problems, responses, point.state.problems, strict=False)
    for suffix, interface, response, state in problems:
        solution = state.solution
        alpha = solution.alpha  # None: F lambda did not confirm the solution
        of_problem = {
            "numbers": [state.iterations, state.solves, state.free_motions, solution.iterations, solution.reason],
            "load": np.stack([state.load.values, state.load.by_stress]),
            "strain": solution.strain,
            "alpha": np.full(interface.solver.natural.kernel_dimension, np.nan) if alpha is None else alpha,
            "confirmed": alpha is not None,
            "residual": solution.residual,
            "asked": state.asked,
            "certificate": [state.certificate.get(law, np.nan) for law in KKT_LAWS],
            # These numbers follow from the multipliers.
            "means": np.stack([response.strain, response.stress]),
            "energies_of": [response.stored, response.in_springs],
            "errors": [response.checks.get(law, UNCHECKED) for law in LAWS],
        }
        numbers |= {f"{name}{suffix}": value for name, value in of_problem.items()}
        distributed |= {f"lam{suffix}": solution.lam, f"jump{suffix}": solution.jump}
        distributed |= _bond_arrays(state.bonds, suffix)
    return numbers, distributed


def restored(event: checkpoints.Arrays, cell: coupled_interfaces.CoupledInterfaces) -> tuple[path_points.Point, Before]:
    """Rebuild a path point, and its `Before`, from a checkpoint event.

    Multipliers, jumps and amplitudes for which the checkpoint had no room are empty; `read` computes them.
    """
    states = list[Equilibrium]()
    for suffix, interface in zip(SUFFIXES, cell.problems, strict=False):
        lam, jump, alpha = (event.get(f"{name}{suffix}", EMPTY) for name in ("lam", "jump", "alpha"))
        iterations, solves, free_motions, steps, reason = event[f"numbers{suffix}"].tolist()
        errors = zip(KKT_LAWS, event[f"certificate{suffix}"].tolist(), strict=True)
        certificate = {law: error for law, error in errors if not np.isnan(error)}
        values, by_stress = event[f"load{suffix}"]
        bonds, residual = _bond_state(event, suffix), float(event[f"residual{suffix}"])
        amplitudes = None if np.isnan(alpha).any() else alpha
        compliance = interface.compliance(bonds)
        solution = DualSolution(event[f"strain{suffix}"], lam, jump, amplitudes, steps, reason, residual, compliance)
        load, asked = Load(values, by_stress.astype(bool)), event[f"asked{suffix}"]
        states.append(Equilibrium(load, bonds, solution, iterations, solves, free_motions, certificate, asked))
    state = replace(states[0], axial=states[1]) if len(states) > 1 else states[0]
    load_factor, scale, leg, position, *counts = event["path"].tolist()
    origin_strain, origin_stress, strain, stress = event["macroscopic"]
    origin, last = Macroscopic(origin_strain, origin_stress), Macroscopic(strain, stress)
    broken = None if np.isnan(event["broken"]) else float(event["broken"])
    bonds, stretched = _bond_state(event, "_after"), float(event["stretched"])
    after = path_points.PathState(int(leg), position, bonds, state.multipliers, origin, last, broken, stretched)
    n, energies = len(path_points.NO_ENERGIES), event["energies"].tolist()
    since_last, up_to_point = path_points.Energies(*energies[:n]), path_points.Energies(*energies[n : 2 * n])
    broke, softened = map(int, counts)
    point = path_points.Point(load_factor, scale, state, broke, softened, since_last, EMPTY, after)
    fibre, direction = event["bond"].tolist()
    return point, (up_to_point, energies[2 * n], (fibre, direction))


def averages(event: checkpoints.Arrays, point: path_points.Point, loads: CellLoads) -> list[averaging.Response]:
    """Restore the responses at a point, one for each problem, from its event, without fields.  Collective."""
    responses = list[averaging.Response]()
    for suffix, problem, state in zip(SUFFIXES, loads.problems, point.state.problems, strict=False):
        strain, stress = event[f"means{suffix}"]
        (stored, in_springs), errors = (event[f"{name}{suffix}"].tolist() for name in ("energies_of", "errors"))
        checks = {law: error for law, error in zip(LAWS, errors, strict=True) if error != UNCHECKED}
        counts, damage = problem.counts(state.status), problem.damage(state.bonds)
        means = strain, stress, point.scale, stored, in_springs
        responses.append(averaging.Response(*means, state, EMPTY, checks, counts, damage))
    return responses


def read(
    context: AnalysisContext, number: int, solves: bool = True
) -> tuple[checkpoints.Arrays, path_points.Point, Before]:
    """Read event `number`, and rebuild its point and `Before`.  Collective; may raise CaseError.

    If an event lacks multipliers, and `solves` is true, the equilibrium of the point is solved again.
    """
    event, cell = context.checkpoint.read(number), context.loads.interfaces
    point, before = restored(event, cell)
    if solves and "lam" not in event:
        loads = ((problem.load.values, problem.load.by_stress) for problem in point.state.problems)
        load = Load(*map(np.concatenate, zip(*loads, strict=True)))
        state = cell.equilibrium(load, point.state.bonds, cell.no_multipliers())
        point = replace(point, state=state, after=replace(point.after, lam=state.multipliers))
    return event, point, before


def resumable(context: AnalysisContext) -> int:
    """Count the checkpoint events that a run can reuse.  Collective.

    A run without --resume drops all events and returns 0; a resumed run reuses the events before the first invalid one.
    Raises CaseError if the checkpoint is damaged or of another run.
    """
    say = context.progress.say
    if not context.resume:
        context.checkpoint.clear()  # events of other runs, which `output_folder.replaced` names
        return 0
    stored_events = context.checkpoint.count()
    if not stored_events:
        say("  no events are stored: the path starts from the beginning")
        return 0
    count = holding(context, consistent(context, stored_events))
    if count < stored_events:
        say(f"  event {count} of the checkpoint is invalid: the run computes it and all later events again")
    say(f"  {count} events are taken from the checkpoint")
    return count


def consistent(context: AnalysisContext, count: int) -> int:
    """Count the leading events whose arrays, bonds, loads and energies fit the path.  Collective; raises CaseError."""
    cell, layout, work, bonds = context.loads.interfaces, _layout(context), Work(), context.bonds(None)
    ends = [context.loads.load(target) for target in context.case.targets]
    waypoints, legs = [Load(0.0 * ends[0].values, ends[0].by_stress), *ends], len(ends)
    for number in range(count):
        event = context.checkpoint.read(number)
        parted = context.cell.comm.allgather(_parted(context, event, layout, bonds))
        if min(parted) < 0:
            return number
        point, (energies, load_controlled, _) = restored(event, cell)
        work.arrive(point)
        means = np.hstack([event[f"means{suffix}"] for suffix in SUFFIXES[: len(cell.problems)]])
        leg = int(np.clip(np.ceil(point.load_factor * legs - path_curves.SAME_LOAD), 1, legs))
        start, end = waypoints[leg - 1 : leg + 1]
        load = start.after(point.load_factor * legs - leg + 1, end)
        # Components whose kind changes begin where the previous leg has ended.
        change = np.where(start.by_stress == end.by_stress, np.choose(load.by_stress, means) - load.values, 0.0)
        errors = np.abs(event["macroscopic"][2:] - means)
        errors[load.by_stress.astype(int), np.arange(len(change))] += np.abs(change)
        largest = context.checks.tolerance("stress") * np.abs(means).max(axis=1, keepdims=True)
        holds = [*work.all_equilibria, work.load_controlled] == [*energies, load_controlled]
        if not holds or sum(parted) != point.broke or (errors > largest).any():
            return number
        bonds = point.after.bonds
    return count


def holding(context: AnalysisContext, count: int) -> int:
    """Count the valid events among the first `count` of the checkpoint.  Collective; raises like `read`.

    Products F lambda with the dual operator F confirm a solution.  All events since every problem was last confirmed
    are completed and checked; a failed check or a wrong mean stress invalidates its event and all later events.
    """
    first, waiting = count, set(SUFFIXES[: len(context.loads.problems)])
    while first:
        event = context.checkpoint.read(first - 1)
        waiting -= {suffix for suffix in SUFFIXES if event.get(f"confirmed{suffix}", False)}
        if not waiting:
            break
        first -= 1
    for number in range(max(min(first, count - 1), 0), count):  # the last event, if any, in any case
        event, point, _ = read(context, number)
        responses = context.loads.responses(context.loads.interfaces.completed(point.state), point.scale)
        for response, kept in zip(responses, averages(event, point, context.loads), strict=True):
            if any(not error <= context.checks.tolerance(name) for name, error in response.checks.items()):
                return number
            change = np.abs(response.stress - kept.stress).max()
            if not change <= context.checks.tolerance("stress") * np.abs(response.stress).max():
                return number
    return count


def _layout(context: AnalysisContext) -> dict[str, tuple[str, tuple[int, ...]]]:
    """Return the type character and shape of each array of this rank in an event, by name.  Collective."""
    cell, bonds = context.loads.interfaces, context.bonds(None)
    if context.case.has_friction:
        bonds = replace(bonds, gap_and_slip=np.zeros((len(bonds.status), 2)), sliding=bonds.status)
    shapes: dict[str, Any] = {"path": 6, "energies": 2 * len(path_points.NO_ENERGIES) + 1, "bond": 2}
    shapes |= {"macroscopic": (4, len(cell.loads)), "broken": (), "stretched": ()}
    arrays = {name: np.zeros(shape) for name, shape in shapes.items()}
    arrays |= {"point": np.array("")} | _bond_arrays(bonds, "_after")
    for suffix, interface, lam in zip(SUFFIXES, cell.problems, cell.no_multipliers(), strict=False):
        v = len(interface.solver.problem.loads)
        shapes = {"load": (2, v), "strain": v, "alpha": interface.solver.natural.kernel_dimension, "residual": ()}
        shapes |= {"asked": v, "certificate": len(KKT_LAWS), "means": (2, v), "energies_of": 2, "errors": len(LAWS)}
        of_problem = {name: np.zeros(shape) for name, shape in shapes.items()} | {"lam": lam, "jump": lam}
        of_problem |= {"numbers": np.zeros(5, np.int64), "confirmed": np.array(True)}
        arrays |= {f"{name}{suffix}": array for name, array in of_problem.items()} | _bond_arrays(bonds, suffix)
    return {name: (array.dtype.char, array.shape) for name, array in arrays.items()}


def _parted(context: AnalysisContext, event: checkpoints.Arrays, layout: Mapping[str, Any], before: BondState) -> int:
    """Count this rank's bonds that part after `before`; -1 for arrays unlike `layout`, wrong numbers or healing."""
    has_all = "lam" in event
    expected = {name: kind for name, kind in layout.items() if has_all or not checkpoints.FOUND_AGAIN.fullmatch(name)}
    if {name: (array.dtype.char, array.shape) for name, array in event.items()} != expected:
        return -1
    suffixes = (*SUFFIXES[: len(context.loads.problems)], "_after")
    states = [before, *(_bond_state(event, suffix) for suffix in suffixes)]
    holds = min(event["path"][4:].min(), event["numbers"].min()) >= 0 and np.isnan(event["bond"]).sum() != 1
    for name, array in event.items():
        known = array[~np.isnan(array)] if name.startswith(UNKNOWN) else array
        holds &= array.dtype.char != "d" or bool(np.isfinite(np.vdot(known, known)))
    for earlier, later in pairwise(states):
        heals = (later.history < earlier.history).any(axis=1) | (later.status == BONDED) & (earlier.status != BONDED)
        is_known = np.isin(later.status, [*Contact]) & np.isin(later.sliding_signs, [-1, 0, 1])
        holds &= bool((is_known & ~heals).all())
    try:
        context.plane.damage(states[-1])
    except IndexError:  # a tooth beyond the last
        return -1
    return int((states[-1].status != BONDED).sum() - (before.status != BONDED).sum()) if holds else -1


def _bond_arrays(bonds: BondState, suffix: str) -> checkpoints.Arrays:
    """Return the arrays of a bond state by field name + `suffix`, without fields that are None."""
    return {f"{name}{suffix}": values for name, values in vars(bonds).items() if values is not None}


def _bond_state(event: checkpoints.Arrays, suffix: str) -> BondState:
    """Rebuild a bond state from arrays that `_bond_arrays` named; missing arrays become None."""
    return BondState(*(event.get(f"{field.name}{suffix}") for field in fields(BondState)))  # type: ignore[arg-type]
