"""List the laws of the certificate with their limits, record violations, and find numbers that no law reads.

Rounding.  Sums over fields err by a few units in the last place of their terms; quantities from factorizations err
by a few hundred: forces in a mesh with 119 000 elements by at most 1.3e-12.  In a very stiff phase, where strains are
differences of nearly equal displacements, rounding is 1e-15 of the terms.  Limits are 10 to 1000 times these errors.

Solver.  The Krylov method leaves relative jumps of `rtol`; laws of closed faces hold to the tolerance of the checks in
a run, min(1000 rtol, 1e-4).  As `rtol` is an entry of the result, 1e-4 bounds the tolerance that a result may claim.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from feti_homog.typing import Float

CHECK_PER_RTOL, LARGEST_CHECK, KKT = 1e3, 1e-4, 1e-6
# Forces and gaps below 10 rtol of the largest have no certain sign; the contact check of a run allows 1e-6.
CONTACT_PER_RTOL = 100.0
# Bonds whose utilisations differ by less than 1e-6 break together.
STRENGTH = 2e-6
# Relative step of finite differences of energies, and relative error of these differences.
STEP = 1e-6
# Relative differences that count as rounding: between proportional loads, and in energies and strains near 0.
ROUNDING = 1e-9
# Coordinates in a user's mesh are rounded: sides match to 1e-7 of the cell, circles are round to 1e-6 of their radius.
USERS_MESH = 1e-5
# Rounding of the forces on both faces bends thin bodies: measured 4e-9 in coatings with a thickness of 1/100 of the
# radius, 1e-8 in necks of 1/8000 between fibres 1e4 times stiffer.  It is the same for any tolerance of the solver.
THIN_BODIES = 1e-7
# Limits grow with lambda / mu above LARGE_RATIO; limits of forces and stresses at most with the contrast of mu to
# stiffer phases, above LARGE_CONTRAST and LARGE_OF_PRESSURE.  At ratios of 1e5 to 5e8 and contrasts of 1e-3 to 1e6,
# violations are at most a quarter of the limits, for jumps half of the limit.
LARGE_RATIO, LARGE_CONTRAST, LARGE_OF_PRESSURE, PRESSURE = 1e5, 50.0, 250.0, 50.0

Place = str | Callable[[int], str]


@dataclass(frozen=True)
class Finding:
    """A law with its limit, the largest relative violation, and the place of the violation."""

    name: str
    description: str
    limit: float
    violation: float = 0.0
    where: str = ""

    @property
    def holds(self) -> bool:
        """Return whether the violation is within the limit; False for NaN."""
        return self.violation <= self.limit

    def line(self) -> str:
        """Write the finding as a line of the certificate."""
        verdict = "holds" if self.holds else "BROKEN"
        where = f", at {self.where}" if self.where and self.violation > 0 else ""
        numbers = f"{self.violation:9.1e} of {self.limit:7.1e}"
        return f"{self.name:<13} {verdict:<7} {numbers}  {self.description}{where}"

    @property
    def document(self) -> Mapping[str, Any]:
        """Return the finding as a table of JSON values.  An infinite violation is null."""
        violation = self.violation if np.isfinite(self.violation) else None
        law = {"law": self.name, "words": self.description, "limit": self.limit}
        return law | {"violation": violation, "where": self.where, "holds": self.holds}


class Findings:
    """The largest violation of every law so far."""

    def __init__(self, checks: Iterable[Finding]) -> None:
        self._checks = {check.name: check for check in checks}
        self._worst: dict[str, Finding] = {}

    def record(self, law: str, violations: ArrayLike, where: Place = "") -> None:
        """Record relative violations (), (k,) or (k, n) of a law; NaN counts as infinite.

        `where` names the place, or maps row i to its place.  Laws without a record do not apply to the result.
        """
        values = np.atleast_1d(np.asarray(violations, float))
        if not values.size:
            return
        values = np.where(np.isnan(values), np.inf, values).reshape(len(values), -1).max(axis=1)
        worst = int(np.argmax(values))
        value = float(values[worst])
        if law not in self._worst or value > self._worst[law].violation:
            place = where if isinstance(where, str) else where(worst)
            self._worst[law] = replace(self._checks[law], violation=value, where=place)

    def compare(self, law: str, value: Any, expected: Any, scale: ArrayLike, where: Place) -> None:
        """Record |value - expected| / scale; inf if the shapes differ."""
        value, expected = np.asarray(value, float), np.asarray(expected, float)
        self.record(law, relative(value - expected, scale) if value.shape == expected.shape else np.inf, where)

    def require(self, law: str, holds: bool | np.bool_, where: str) -> None:
        """Record the violation 0 if a condition holds, else inf."""
        self.record(law, 0.0 if holds else np.inf, where)

    def worst(self) -> tuple[Finding, ...]:
        """Return the finding with the largest violation of each law that applies, in the order of `checks`."""
        return tuple(self._worst[name] for name in self._checks if name in self._worst)


def relative(errors: ArrayLike, scale: ArrayLike) -> Float:
    """Compute |errors| / scale.  Where the scale is 0, the result is 0 for an error of 0, else inf."""
    errors, scale = np.broadcast_arrays(np.abs(np.asarray(errors, float)), np.asarray(scale, float))
    return np.asarray(np.divide(errors, scale, out=np.where(errors == 0.0, 0.0, np.inf), where=scale > 0))


def solver_limit(rtol: float) -> float:
    """Return min(1000 rtol, 1e-4), the limit of laws that hold to the solver's accuracy."""
    return min(CHECK_PER_RTOL * rtol, LARGEST_CHECK)


def checks(rtol: float, users_mesh: bool, phases: Sequence[float] = (0, 0, 0, 0)) -> list[Finding]:
    """List the laws with their limits for a tolerance `rtol` of the dual problems, without violations.

    Users' meshes widen the limits, and so do `phases`: both numbers of `Elements.contrasts`, then both of `rounding`.
    """
    ratio, contrast, of_law, of_contrast = phases[0] / LARGE_RATIO, *phases[1:]
    # Factors by which nearly incompressible phases raise the limits.
    loss, balance_loss = max(1.0, ratio), max(1.0, min(ratio, contrast / LARGE_CONTRAST))
    law = max(1e-13, 1e-13 * min(PRESSURE * ratio, contrast / LARGE_OF_PRESSURE), of_law)
    sums, balance = max(1e-10 * loss, of_law), 1e-10 * balance_loss
    shape, solver = USERS_MESH if users_mesh else ROUNDING, solver_limit(rtol)
    contact, work = min(max(CONTACT_PER_RTOL * rtol, KKT), LARGEST_CHECK), max(solver, of_contrast)
    rows = (
        ("files", "the files are unchanged since the run, by their checksums", 0.0),
        ("status", "the status follows from the checks, tolerances from rtol", 1e-9),
        ("numbers", "all numbers are finite", 0.0),
        ("mesh", "elements have positive areas and fill the cell; torn sides meet in pairs", shape),
        ("interface", "interface nodes are where one fibre meets the matrix, with its normals and lengths", shape),
        ("arcs", "the initially debonded nodes agree with the case, in numbers of nodes", 0.0),
        ("stress", "stresses of the elements follow from u and the case's materials", law),
        ("stress 33", "stresses out of the plane follow from stresses in the plane and the materials", 1e-13),
        ("phases", "largest stresses of the phases follow from u, relative to the largest", 1e-7),
        ("mesh error", "errors of the elements add up to an estimate by averaged stresses, factor - 1", 1.5),
        ("periodicity", "u* is the same at the copies of a node in its subdomain, relative to the largest u", 1e-13),
        ("sides", "u* = 0 on sides that move by E x, relative to the largest u", 1e-13),
        ("continuity", "u* is the same where subdomains are glued, relative to the largest u", solver),
        ("equilibrium", "forces of the elements and tractions balance at every node, relative to the largest", balance),
        ("jump", "gap and slip are the differences of the faces' u*, relative to the largest u", THIN_BODIES),
        ("bond", "jumps of bonded and closed faces follow from their springs, relative to the largest u", solver),
        ("penetration", "debonded faces do not overlap, relative to the displacement imposed", contact),
        ("tension", "closed faces carry no tension, relative to the largest traction", contact),
        ("complementarity", "gap times traction vanishes, relative to the largest force and displacement", contact),
        ("free faces", "open faces carry no traction, closed faces no shear but friction, relative", contact),
        ("sliding", "friction opposes the slip of sliding faces, relative to the largest traction", contact),
        ("mean stress", "elements and path points have the mean stress of the state, relative to the largest", balance),
        ("mean strain", "the mean strain of elements and openings of faces is E, relative to E", solver),
        ("Hill", "the mean of stress : strain is mean stress : E less the work of the interface, relative", work),
        ("load", "the states have the strains and temperatures that the case asks for, relative to the largest", 1e-12),
        ("stress load", "the states have the stresses that the case asks for, relative to the largest", solver),
        ("tables", "points and columns in result.json agree with result.h5, relative to the largest", 1e-12),
        ("rates", "release rates at tips of arcs agree with their modes, and tips with the mesh, relative to G", 1e-9),
        ("symmetry", "stiffnesses of bonded or free faces are symmetric, relative to the largest entry", work),
        ("breaks", "bonds break as the points report and never heal, in numbers of bonds", 0.0),
        ("strength", "bonds that hold are within their strength, those that break are at it", STRENGTH),
        ("onset", "in every direction of an envelope, the first bond breaks at the given load", 1e-9),
        ("energy", "work = stored + dissipated along the path, relative to the largest energy", solver),
        ("heat", "work = stored + dissipated + heat of friction, which grows, relative to the energies so far", 1e-8),
        ("cell", "areas, fractions and counts in result.json agree with the mesh", 1e-10),
        ("moduli", "moduli follow from the stiffness, relative to each", sums),
        ("compliance", "compliance and expansion follow from stiffness and thermal stress, relative to each", sums),
        ("Levin", "thermal stress = - mean of expansion : stiffness : strain under unit strains, relative", solver),
        ("constants", "constants at fixed status agree with the fields, relative to each", solver),
        ("sensitivities", "constants change with the constants of the case as stated, relative", max(STEP, solver)),
        ("bounds", "bounds follow from fractions and materials, and the stiffness is between them", sums),
    )
    return [Finding(*row) for row in rows]


# Reasons why no law reads a number, by parts of its name; the first reason that fits counts.
REASONS = {
    "names of the program and the case, and how the run went": (
        "version", "date", "digest", "resumed", "solver", "timings", "memory", "iterations", "free_motions",
    ),
    "residuals of the solver, of which only the tolerance is checked": ("checks",),
    "texts": ("warnings", "remarks", "faults"),
    "closed formulas, which no field can confirm": ("estimates", "fibre_bounds", "maxwell"),
    "estimates of the mesh error, except for energies": ("mesh_error",),
    "derivatives under contact or with a temperature, except for energies": ("derivatives",),
    "energies that breaks at tips would release, except for their modes": ("G", "G_I", "G_II", "G_III"),
    "numbers of the mesher, or of a table that is not in the files": ("match_distance", "mesh_size", "refine"),
    "copies of other numbers, for readers": (
        "fibres", "peak", "mark", "debonding_angle", "dissipation_ratio", "parameter_values",
    ),
}  # fmt: skip
ATOMS = ("case", "result_h5")
NO_REASON, THINNED = "no law", "at points whose fields are not in the files"
# Files, and tables of result.h5, that repeat other numbers.
COPIES = "tables for viewers and spreadsheets"
COPIED = ("*.csv", "traction_vector", "jump_vector", "displacement_fibre", "displacement_matrix", "fibre_node",
          "matrix_node", "fibre/number", "fibre/phase", "fibre/body", "fibre/radius", "mesh/body", "mesh/fibre_number",
          "mesh/rank", "interface/vertex")  # fmt: skip


class Section(dict[str, Any]):
    """A table of result.json that records which entries laws read.  ATOMS count as one entry.

    `unread` maps unread entries to whether laws leave them open; the outermost table has all entries in `places`.
    """

    def __init__(self, content: Mapping[str, Any], unread: dict[str, bool] | None = None, place: str = "") -> None:
        super().__init__(content)
        self.unread = {} if unread is None else unread
        self._prefix = f"{place}." if place else ""
        for key, value in content.items():
            inner = self._prefix + key
            if isinstance(value, dict) and inner not in ATOMS:
                self[key] = Section(value, self.unread, inner)
            elif isinstance(value, list) and value and all(isinstance(entry, dict) for entry in value):
                self[key] = [Section(entry, self.unread, f"{inner}[{k}]") for k, entry in enumerate(value)]
            else:
                self.unread[inner] = False
        self.places = tuple(self.unread) if unread is None else ()

    def __getitem__(self, key: str) -> Any:
        if self.unread.get(self._prefix + key) is False:
            del self.unread[self._prefix + key]
        return super().__getitem__(key)

    def get(self, key: str, default: Any = None) -> Any:
        """Return an entry, which then counts as read, or `default` for a missing entry."""
        return self[key] if key in self else default  # noqa: SIM401, because `super().get` would not count it

    def hint(self, key: str, default: Any = None) -> Any:
        """Return an entry without counting it as read.  A law uses the value but does not check it."""
        return super().get(key, default)

    def leaves_open(self, *keys: str) -> None:
        """Count entries as unread from now on.  Laws use their values but do not determine them."""
        self.unread |= dict.fromkeys((self._prefix + key for key in keys), True)


Points = Sequence[Section]


def unchecked(document: Section) -> dict[str, list[str]]:
    """Map reasons to the names of numbers that no law has read, such as path[].iterations.

    If no law has read any number of a table, the name of the table represents them.  Copies are always in the list.
    """
    groups = (document.unread, document.places)
    unread, total = (Counter(re.sub(r"\[\d+\]", "[]", place) for place in places) for places in groups)
    read = {re.split(r"[.\[]", name)[0] for name in total if name not in unread}
    names_of: dict[str, list[str]] = {COPIES: [*COPIED]}
    for name, count in unread.items():
        table, parts = re.split(r"[.\[]", name)[0], {*name.replace("[]", "").split(".")}
        default = THINNED if count < total[name] else NO_REASON
        reason = next((text for text, names in REASONS.items() if parts & {*names}), default)
        names_of.setdefault(reason, []).append(name if table in read else table)
    return {reason: [*dict.fromkeys(names)] for reason, names in names_of.items()}
