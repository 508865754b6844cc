"""An event of a path with the energies up to it, and the form in which the checkpoint keeps it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from feti_homog.analysis.context import AnalysisContext, CellLoads
from feti_homog.feti.dual_solution import DualSolution
from feti_homog.homogenization.averaging import Response
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BondState, Equilibrium
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.loads import Load, Macroscopic
from feti_homog.interface.path.path_points import NO_ENERGIES, Energies, PathState, Point, most_utilised
from feti_homog.results.checkpoint import has_multipliers
from feti_homog.results.checkpoint_file import Arrays

# Conditions of contact; the last is known only with friction.
KKT_LAWS = ("kkt_complementarity", "kkt_penetration", "kkt_tension", "kkt_friction")
# Laws whose errors a response may have.
LAWS = ("strain", "hill", "jump", "stress", *KKT_LAWS)
UNCHECKED = -1.0  # the error of a law that was not checked
EMPTY = np.zeros(0)
# Behind the names of what belongs to each problem.
SUFFIXES = ("", "_axial")


@dataclass
class Work:
    """Energies per area of the cell up to a point's state.

    What is lost to breaks is the work of the loads less what is stored.

    Attributes:
        all_equilibria: where every bond broke at its own load, the first leg with its snap-back.
        load_controlled: what is lost where the load only rose on the first leg, as in a test: a bond of a snap-back
            breaks at the largest load t so far, and loses (t / own load)^2 times as much, for all is of degree one in
            the load.
    """

    all_equilibria: Energies = NO_ENERGIES
    load_controlled: float = 0.0
    _load: float = 0.0
    _largest_load: float = 0.0

    def arrive(self, point: Point) -> None:
        """Add the energies of the way from the last point to this one."""
        # Beyond the first leg loads do not fall.
        rise = self._largest_load / self._load if self._load else 1.0
        controlled = self.load_controlled + rise**2 * point.energies.released
        self.resume_from(self.all_equilibria.plus(point.energies), controlled, point)

    def resume_from(self, all_equilibria: Energies, load_controlled: float, point: Point) -> None:
        """Go on from a point up to which there were these."""
        self.all_equilibria, self.load_controlled = all_equilibria, load_controlled
        self._load, self._largest_load = point.load_factor, max(point.load_factor, self._largest_load)


def stored(
    point: Point, responses: Sequence[Response], work: Work, cell: CoupledInterfaces
) -> tuple[dict[str, Any], Arrays]:
    """Return a point with its responses as plain numbers and distributed arrays, for the checkpoint.

    A path goes on from the multipliers of its last state.
    """
    after = point.after
    whole: dict[str, Any] = {
        "path": [point.load_factor, point.scale, float(after.leg), after.position, point.broke, point.softened],
        "energies": [*point.energies, *work.all_equilibria, work.load_controlled],
        "macroscopic": np.stack([after.origin.strain, after.origin.stress, after.last.strain, after.last.stress]),
        "broken": np.nan if after.broken is None else after.broken,
        "stretched": after.stretched,
    }
    distributed: Arrays = {"used": point.used} | _bonds_apart(after.bonds, "_after")
    for suffix, each, response, state in zip(SUFFIXES, cell.problems, responses, point.state.problems, strict=False):
        numbers, arrays = _taken_apart(state, each.solver.natural.kernel_dimension)
        numbers |= _averages(response)
        whole |= {f"{name}{suffix}": value for name, value in numbers.items()}
        distributed |= {f"{name}{suffix}": value for name, value in arrays.items()}
    return whole, distributed


def restored(event: Arrays, cell: CoupledInterfaces) -> tuple[Point, tuple[Energies, float]]:
    """Put together what `stored` took apart of an event of a cell: the point, and the energies up to it.

    Of a lean event the arrays that `found_again` fills are empty.
    """
    load_factor, scale, leg, position, *counts = event["path"].tolist()
    energies = event["energies"].tolist()
    pairs = zip(cell.problems, SUFFIXES, strict=False)
    state, *others = (_put_together(event, each, suffix) for each, suffix in pairs)
    state = replace(state, axial=others[0]) if others else state
    origin_strain, origin_stress, strain, stress = event["macroscopic"]
    broken = float(event["broken"])
    after = PathState(
        int(leg),
        position,
        _bonds_together(event, "_after"),
        state.multipliers,
        Macroscopic(origin_strain, origin_stress),
        Macroscopic(strain, stress),
        None if np.isnan(broken) else broken,
        float(event["stretched"]),
    )
    broke, softened = map(int, counts)
    own = len(NO_ENERGIES)
    used = event.get("used", EMPTY)
    point = Point(load_factor, scale, state, broke, softened, Energies(*energies[:own]), used, after)
    return point, (Energies(*energies[own : 2 * own]), energies[2 * own])


def averages(event: Arrays, point: Point, loads: CellLoads) -> list[Response]:
    """Return the responses of a restored event, as they were when it was stored.  Collective."""
    found = list[Response]()
    for suffix, problem, state in zip(SUFFIXES, loads.problems, point.state.problems, strict=False):
        strain, stress = event[f"means{suffix}"]
        (stored, in_springs), errors = (event[f"{name}{suffix}"].tolist() for name in ("energies_of", "errors"))
        checks = {law: error for law, error in zip(LAWS, errors, strict=True) if error != UNCHECKED}
        counts, damage = problem.counts(state.status), problem.damage(state.bonds)
        means = strain, stress, point.scale, stored, in_springs
        found.append(Response(*means, state, EMPTY, checks, counts, damage))
    return found


def found_again(point: Point, cell: CoupledInterfaces, law: BondLaw) -> Point:
    """Return the point of a lean event with the equilibrium of its load and bonds.  Collective."""
    known = point.state
    state = cell.equilibrium(_load(known), known.bonds, cell.no_multipliers())
    # An equilibrium under the whole load is scaled, and so is what it uses.
    used = point.scale * most_utilised(cell, law, state)[0]
    return replace(point, state=state, used=used, after=replace(point.after, lam=state.multipliers))


def _load(state: Equilibrium) -> Load:
    """Return the load of all problems."""
    values, by_stress = zip(*((each.load.values, each.load.by_stress) for each in state.problems), strict=True)
    return Load(np.concatenate(values), np.concatenate(by_stress))


def read(context: AnalysisContext, law: BondLaw, number: int) -> tuple[Arrays, Point]:
    """Return an event of the checkpoint and its point, whose multipliers are found again if missing.  Collective."""
    event, cell = context.checkpoint.read(number), context.loads.interfaces
    point, _ = restored(event, cell)
    return event, point if has_multipliers(event) else found_again(point, cell, law)


def holding(context: AnalysisContext, law: BondLaw, known: int) -> int:
    """Return how many of the known events of the checkpoint hold.

    Those after the last before which F lambda confirmed all problems, each at an event of its own or at one after it,
    are confirmed here, up to one whose checks fail or whose means are wrong.  Collective.
    """
    first, waiting = known, set(SUFFIXES[: len(context.loads.problems)])
    while first and (waiting := waiting - _confirmed(context.checkpoint.read(first - 1))):
        first -= 1
    for number in range(first, known):
        event, point = read(context, law, number)
        responses = context.loads.responses(context.loads.interfaces.completed(point.state), point.scale)
        for response, kept in zip(responses, averages(event, point, context.loads), strict=True):
            if any(not error <= context.checks.tolerance(name) for name, error in response.checks.items()):
                return number
            change = np.abs(response.stress - kept.stress).max()
            if not change <= context.checks.tolerance("stress") * np.abs(response.stress).max():
                return number
    return known


def _confirmed(event: Arrays) -> set[str]:
    """Return the suffixes of the problems that F lambda confirmed at an event."""
    return {suffix for suffix in SUFFIXES if event.get(f"confirmed{suffix}", False)}


def _averages(response: Response) -> dict[str, Any]:
    """Return the numbers of a response that follow from the multipliers."""
    return {
        "means": np.stack([response.strain, response.stress]),
        "energies_of": [response.stored, response.in_springs],
        "errors": [response.checks.get(law, UNCHECKED) for law in LAWS],
    }


def _taken_apart(state: Equilibrium, kernel: int) -> tuple[dict[str, Any], Arrays]:
    """Return the equilibrium of one problem with so many amplitudes, NaN where there are none."""
    solution = state.solution
    whole: dict[str, Any] = {
        "numbers": [state.iterations, state.solves, state.free_motions, solution.iterations, solution.reason],
        "load": np.stack([state.load.values, state.load.by_stress]),
        "strain": solution.strain,
        "alpha": np.full(kernel, np.nan) if solution.alpha is None else solution.alpha,
        "confirmed": solution.alpha is not None,
        "residual": solution.residual,
        "asked": state.asked,
        "certificate": [state.certificate.get(law, np.nan) for law in KKT_LAWS],
    }
    return whole, {"lam": solution.lam, "jump": solution.jump} | _bonds_apart(state.bonds, "")


def _put_together(event: Arrays, interface: ContactProblem, suffix: str) -> Equilibrium:
    """Rebuild the equilibrium from the parts of `_taken_apart`."""
    lam, jump, alpha = (event.get(f"{name}{suffix}", EMPTY) for name in ("lam", "jump", "alpha"))
    strain = event[f"strain{suffix}"]
    iterations, solves, free_motions, last, reason = event[f"numbers{suffix}"].tolist()
    errors = zip(KKT_LAWS, event[f"certificate{suffix}"].tolist(), strict=True)
    certificate = {law: error for law, error in errors if not np.isnan(error)}
    values, by_stress = event[f"load{suffix}"]
    load = Load(values, by_stress.astype(bool))
    bonds = _bonds_together(event, suffix)
    residual, C = float(event[f"residual{suffix}"]), interface.compliance(bonds)
    solution = DualSolution(strain, lam, jump, None if np.isnan(alpha).any() else alpha, last, reason, residual, C)
    asked = event[f"asked{suffix}"]
    return Equilibrium(load, bonds, solution, iterations, solves, free_motions, certificate, asked)


def _bonds_apart(bonds: BondState, suffix: str) -> Arrays:
    """Return the state of bonds as distributed arrays with this suffix."""
    return {f"{name}{suffix}": values for name, values in vars(bonds).items() if values is not None}


def _bonds_together(event: Arrays, suffix: str) -> BondState:
    """Rebuild the state of bonds from the arrays of `_bonds_apart`."""
    return BondState(*(event.get(f"{field.name}{suffix}") for field in fields(BondState)))  # type: ignore[arg-type]
