"""Checks of the certificate with the largest violation that rounding or the solver explains, and what was found.

Rounding.  What is computed from the fields by sums of a few terms is off by some units in the last place of the terms;
what the solver gets from factorizations, by some hundred: forces of 119 000 elements by 1.3e-12 at most.  Where a phase
is so stiff that its strains are differences of nearly equal displacements, 1e-15 of the terms are rounding too.
The limits are ten to a thousand times what was measured.

Solver.  The Krylov method ends with jumps of `rtol`, relative; laws that need glued faces to be closed hold as far as
the checks of a run demand, min(1000 rtol, 1e-4).  `rtol` is written in the result, so the second number is the most
that any result may claim.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from feti_homog.typing import Float

CHECK_PER_RTOL, LARGEST_CHECK, KKT = 1e3, 1e-4, 1e-6
# Signs of forces and gaps are the solver's error below 10 rtol of the largest; the check of contact allows 1e-6.
CONTACT_PER_RTOL, LEAST_CONTACT = 100.0, 1e-6
# Bonds whose utilisation differs by 1e-6 break together.
STRENGTH = 2e-6
# Differences of energies over a step of 1e-6.
SLOPE = 1e-6
# Utilisations at onset, from the same tractions as the onset.
ONSET = 1e-9
# Coordinates of a user's mesh are rounded: sides match to 1e-7 of the cell, circles are round to 1e-6 of their radius.
OWN_MESH, USERS_MESH = 1e-9, 1e-5
# Thin coatings bend by the rounding of the forces on their two faces: measured 4e-9 at a hundredth of the radius.
WHOLE_BODIES, COATINGS = 1e-11, 1e-7
# Nearly incompressible phases lose digits with lambda / mu beyond this, and stresses, which stiff phases beside them
# raise, with the contrast of mu beyond the others: at 1e5 to 5e8, with contrasts of 1e-3 to 1e6, violations are a
# quarter of the limits at most, 0.9 of that of jumps.
LARGE_RATIO, LARGE_CONTRAST, LARGE_OF_PRESSURE, PRESSURE = 1e5, 50.0, 250.0, 50.0
Pair = tuple[float, float]


@dataclass(frozen=True)
class Check:
    """Condition that a result meets, described in words, and the largest relative violation that is none."""

    name: str
    words: str
    limit: float


@dataclass(frozen=True)
class Finding:
    """Largest violation of a check and its place."""

    check: Check
    violation: float
    where: str

    @property
    def holds(self) -> bool:
        """Return True if the violation is within the limit; NaN is not."""
        return self.violation <= self.check.limit

    def line(self) -> str:
        """Return the finding as a line of the certificate."""
        verdict = "holds" if self.holds else "BROKEN"
        where = f", at {self.where}" if self.where and self.violation > 0 else ""
        numbers = f"{self.violation:9.1e} of {self.check.limit:7.1e}"
        return f"{self.check.name:<13} {verdict:<7} {numbers}  {self.check.words}{where}"

    @property
    def document(self) -> Mapping[str, Any]:
        """The finding as it is written in JSON; a violation without bound is null."""
        violation = self.violation if np.isfinite(self.violation) else None
        check = {"law": self.check.name, "words": self.check.words, "limit": self.check.limit}
        return check | {"violation": violation, "where": self.where, "holds": self.holds}


class Findings:
    """Largest violation of each check so far."""

    def __init__(self, checks: Iterable[Check]) -> None:
        self._checks = {check.name: check for check in checks}
        self._worst: dict[str, tuple[float, str]] = {}

    def record(self, name: str, violations: ArrayLike, where: Callable[[int], str] | str = "") -> None:
        """Record violations of a check, each relative to its scale; `where` names the place of the i-th.

        Checks of which nothing is recorded do not apply to the result.
        """
        values = np.atleast_1d(np.asarray(violations, float)).ravel()
        if not len(values):
            return
        values = np.where(np.isnan(values), np.inf, values)
        worst = int(np.argmax(values))
        value = float(values[worst])
        if name not in self._worst or value > self._worst[name][0]:
            self._worst[name] = value, where if isinstance(where, str) else where(worst)

    def require(self, name: str, holds: bool | np.bool_, where: str) -> None:
        """Record that a check holds, or does not at all."""
        self.record(name, 0.0 if holds else np.inf, where)

    def worst(self) -> tuple[Finding, ...]:
        """Return the findings of all checks that apply, in their order."""
        return tuple(Finding(check, *self._worst[name]) for name, check in self._checks.items() if name in self._worst)


def solver_limit(rtol: float) -> float:
    """Limit of the checks that hold as far as the dual problems were solved."""
    return min(CHECK_PER_RTOL * rtol, LARGEST_CHECK)


def checks(rtol: float, users_mesh: bool, has_coatings: bool, mixed: Pair = (0.0, 0.0)) -> tuple[Check, ...]:
    """List the checks of a result whose dual problems were solved to `rtol`.

    `mixed` is the largest lambda / mu of elements that have a pressure, and the largest mu over theirs.
    """
    ratio, contrast = mixed[0] / LARGE_RATIO, mixed[1]
    lost, of_balance = max(1.0, ratio), max(1.0, min(ratio, contrast / LARGE_CONTRAST))
    of_pressure = max(1.0, min(PRESSURE * ratio, contrast / LARGE_OF_PRESSURE))
    sums, balance, rounding = 1e-10 * lost, 1e-10 * of_balance, max(COATINGS * has_coatings, WHOLE_BODIES * lost)
    shape, solver = USERS_MESH if users_mesh else OWN_MESH, solver_limit(rtol)
    contact = min(max(CONTACT_PER_RTOL * rtol, LEAST_CONTACT), LARGEST_CHECK)
    rows = (
        ("files", "the files are unchanged since the run, by their checksums", 0.0),
        ("status", "the status follows from the checks, tolerances from rtol", 1e-9),
        ("numbers", "all numbers are finite", 0.0),
        ("mesh", "elements have positive areas and fill the cell; torn sides meet in pairs", shape),
        ("interface", "interface nodes are where one fibre meets the matrix, with its normals and lengths", shape),
        ("arcs", "the initially debonded nodes are those of the case, in numbers of nodes", 0.0),
        ("stress", "stresses of the elements follow from u and the case's materials", 1e-13 * of_pressure),
        ("stress 33", "stresses out of the plane follow from those in it and the case's materials", 1e-13),
        ("mesh error", "errors of the elements add up to those of averaged stresses, by a factor less 1", 1.5),
        ("periodicity", "u* is the same at the copies of a node in its subdomain, relative to the largest u", 1e-13),
        ("continuity", "u* is the same where subdomains are glued, relative to the largest u", solver),
        ("equilibrium", "forces of the elements and tractions balance at every node, relative to the largest", balance),
        ("jump", "gap and slip are the differences of the faces' u*, relative to the largest u", rounding),
        ("bond", "bonded and closed faces part as their springs give way, relative to the largest u", solver),
        ("penetration", "debonded faces do not overlap, relative to the displacement imposed", contact),
        ("tension", "closed faces are not pulled, relative to the largest traction", contact),
        ("complementarity", "gap times traction vanishes, relative to the largest force and displacement", contact),
        ("free faces", "open faces bear nothing, closed ones friction only, relative to the largest traction", contact),
        ("sliding", "friction opposes the slip of sliding faces, relative to the largest traction", contact),
        ("mean stress", "the mean of the stresses is the state's, relative to the largest component", balance),
        ("mean strain", "the mean of the strains is E and the opening of the faces, relative to E", solver),
        ("Hill", "mean of stress : strain = mean stress : E less the interface's work, relative to it", solver),
        ("load", "the states have the strains and temperatures that the case asks for, relative to the largest", 1e-12),
        ("stress load", "the states have the stresses that the case asks for, relative to the largest", solver),
        ("tables", "points and columns in result.json are the states in result.h5, relative to the largest", 1e-12),
        ("rates", "release rates at tips of arcs agree with their modes, and tips with the mesh, relative to G", 1e-9),
        ("symmetry", "stiffnesses of bonded or free faces are symmetric, relative to the largest entry", solver),
        ("breaks", "bonds break as the points report and never heal, in numbers of bonds", 0.0),
        ("strength", "bonds that hold are within their strength, those that break are at it", STRENGTH),
        ("onset", "the load of every direction of an envelope is that at which the first bond breaks", ONSET),
        ("energy", "work = stored + dissipated along the path, relative to the largest energy", solver),
        ("heat", "work = stored + dissipated + heat of friction, which grows, relative to the energies so far", 1e-8),
        ("cell", "areas, fractions and counts in result.json are those of the mesh", 1e-10),
        ("moduli", "moduli follow from the stiffness, relative to each", sums),
        ("compliance", "compliance and expansion follow from stiffness and thermal stress, relative to each", sums),
        ("Levin", "thermal stress = - mean of expansion : stiffness : strain under unit strains, relative", solver),
        ("constants", "constants at fixed status are those of the fields, relative to each", solver),
        (
            "sensitivities",
            "constants change with those of the case as in the file, relative to each",
            max(SLOPE, solver),
        ),
        ("bounds", "bounds follow from fractions and materials, and the stiffness is between them", sums),
    )
    return tuple(Check(*row) for row in rows)


def relative(errors: Float, scale: Float | float) -> Float:
    """errors / scale; where the scale is zero only an error of zero is none."""
    errors, scale = np.broadcast_arrays(np.abs(np.asarray(errors, float)), np.asarray(scale, float))
    absolute = np.where(errors == 0.0, 0.0, np.inf)
    return np.asarray(np.divide(errors, scale, out=absolute, where=scale > 0))
