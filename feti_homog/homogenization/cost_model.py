"""Cost of a case: seconds, memory, and how many ranks are worth while; estimates before anything is solved.

About linear in the degrees of freedom, for bodies are cut into pieces of one size.  The constants are those that
`.venv/bin/python scripts/measure_cost.py` prints, on a 2-core machine; those of setup, subdomains, applications,
columns and states were fitted later to the processor time of cases of 700 to 130 000 degrees of freedom beside other
programs.  Times are within a factor of 1.5; those of paths lie between few events and as many as bonds have teeth, so
that a job's time limit should leave room.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from feti_homog.case.bond_laws import LAWS, laws_with
from feti_homog.case.case import Case
from feti_homog.case.interface_section import InterfaceSection
from feti_homog.fem.problem import AXIAL, Problem
from feti_homog.feti.thresholds import INFLUENCE_COLUMNS, NEVER_REFACTORED_ROWS
from feti_homog.homogenization import phase_laws
from feti_homog.materials.voigt import PLANE_STATES
from feti_homog.microstructure.phase_names import COATING

# Seconds to start Python, MPI, PETSc and gmsh.
START_SECONDS = 0.9
# Seconds for each coarse triangle, on rank 0.
MESH_SECONDS = 2.7e-5
# Seconds for each degree of freedom to assemble and factor, and for each subdomain besides.
SETUP_SECONDS, SUBDOMAIN_SECONDS = 5.7e-6, 1.2e-2
# Seconds for each degree of freedom in one application of operator and preconditioner.
APPLY_SECONDS = 5.5e-8
# Seconds for each multiplier that has influence columns, to make these and their inverse.
COLUMN_SECONDS = 1.4e-4
# Seconds for each degree of freedom to estimate the errors of the mesh, of cells that are refined.
ERROR_SECONDS = 1.3e-6
# Bytes of a rank without degrees of freedom, for each of these, and for each multiplier that has influence columns.
BASE_BYTES, DOF_BYTES, COLUMN_BYTES = 1.8e8, 1.5e3, 2.0e4
# Bytes more for each displacement of the largest problem of a cell that is one factor: of seven bonded cells of 31 000
# to 271 000 degrees of freedom estimates are 0.93 to 1.07 times what runs took, of two of order 2 0.85 times.
FACTOR_BYTES = 2.9e2
# Bytes more of a path to complete debonding with influence columns: for each multiplier of a rank, and for each pair of
# one and a column, of which a cell that is factored anew has `INFLUENCE_COLUMNS`. Of five paths of 1 to 50 fibres, 120
# to 4 110 multipliers, on one rank, estimates are 0.93 to 1.17 times what runs took.
PATH_BYTES, PAIR_BYTES = 7e4, 50
# Bytes for each pair of jumps of debonded faces with friction: six dense matrices (`interface.friction`).
FACE_PAIR_BYTES = 48
# Bytes of result.h5: of a state for each node, element and interface node in the plane, and what is along the fibres
# besides; of the mesh for each node and element, and of the interface's nodes.
STATE_BYTES, AXIAL_BYTES = np.array([16, 36, 138]), np.array([8, 16, 16])
MESH_BYTES, CORNER_BYTES = np.array([16, 16, 80]), 8
# Seconds to make and write the fields of a state, in any case and for each element; of a point of a path, whose
# displacements follow from its checkpoint, and for which errors of the mesh are estimated.
STATE_SECONDS, STATE_ELEMENT_SECONDS = 2.8e-2, 6e-7
POINT_SECONDS, POINT_ELEMENT_SECONDS = 3.4e-2, 2.5e-6
# Seconds of an event of a path: in any case, for each degree of freedom on every rank, and for each of a rank
# (`scripts/scaling events`). Later events of a large cell take up to four times as long.
EVENT_SECONDS, EVENT_DOF_SECONDS, EVENT_RANK_DOF_SECONDS = 2.4e-3, 1.3e-7, 3.3e-7
# Degrees of freedom of a rank; with fewer, its waiting for others takes more than it saves.
DOFS_OF_A_RANK = 50_000
# Typical numbers, by which a case is estimated and its operators are chosen.
ITERATIONS_OF_A_SOLVE, SOLVES_OF_A_CONTACT, SOLVES_OF_A_PATH = 20, 3, 100
# The same of a solve with coatings, were it not for influence columns (`feti.solver_plan`).
ITERATIONS_WITH_COATINGS = 400


@dataclass(frozen=True)
class Estimate:
    """Seconds of the whole run, bytes of the rank that needs most, and the ranks that the case wants."""

    seconds: float
    memory: float
    ranks: int


def applications(case: Case, problem: Problem, easy: bool = False) -> int:
    """About how many times the analysis applies the dual operator of a problem.

    Solves are `easy` by influence columns, and of pieces across materials: coatings then cost no iterations.
    """
    # A mesh may have a curve "debonded"; along the fibres nothing touches.
    may_open = bool(case.arcs) or case.cell.has_own_mesh or case.section.is_followed
    contact = case.interface is not None and case.interface.contact and may_open and problem != AXIAL
    many = case.section.is_followed or _asks_for_tips(case)
    solves = SOLVES_OF_A_PATH if many else case.section.solves(len(problem.loads), contact)
    return _iterations(case, easy) * solves * (SOLVES_OF_A_CONTACT if contact else 1)


def has_errors(case: Case) -> bool:
    """Return whether errors of the mesh are estimated: on a path only for states that are written."""
    return case.output.mesh_error and (case.output.fields or not case.section.is_followed)


def _iterations(case: Case, easy: bool) -> int:
    """About those of a solve by a preconditioner."""
    return ITERATIONS_WITH_COATINGS if COATING in case.materials and not easy else ITERATIONS_OF_A_SOLVE


def _asks_for_tips(case: Case) -> bool:
    """Return whether an envelope needs the inverse of the dual operator, which many solves call for."""
    bond = case.interface
    by_energy = bond is not None and bond.criterion in laws_with("growth") and bond.growth == "released"
    return case.section.breaks and by_energy and (bool(case.arcs) or case.cell.has_own_mesh)


def estimate(
    nodes: Sequence[int],
    subdomains: Sequence[int],
    coarse_triangles: int,
    bodies: int,
    problems: Mapping[int, int],
    columns: int,
    with_errors: bool = False,
) -> Estimate:
    """Estimate the cost of a case with `nodes` and `subdomains` on each rank.

    `problems` has for each problem, by its displacements of a node, how many times it applies its dual operator,
    `columns` multipliers have influence columns, and errors of the mesh are estimated `with_errors`.

    As many ranks are suggested as there are bodies at most, for more would cut bodies, which costs iterations; of cells
    that are cut across materials, coarse triangles stand for these.
    """
    once = SETUP_SECONDS + with_errors * ERROR_SECONDS
    of_node = sum(c * (once + applications * APPLY_SECONDS) for c, applications in problems.items())
    of_subdomain = len(problems) * SUBDOMAIN_SECONDS
    slowest = max(n * of_node + k * of_subdomain for n, k in zip(nodes, subdomains, strict=True))
    dofs = [sum(problems) * n for n in nodes]
    in_one_factor = max(problems) * max(nodes) if max(subdomains) == 1 else 0
    return Estimate(
        seconds=START_SECONDS + coarse_triangles * MESH_SECONDS + slowest + columns / len(nodes) * COLUMN_SECONDS,
        memory=BASE_BYTES + max(dofs) * DOF_BYTES + in_one_factor * FACTOR_BYTES + columns / len(nodes) * COLUMN_BYTES,
        ranks=max(1, min(bodies, ceil(sum(dofs) / DOFS_OF_A_RANK))),
    )


def memory_to_the_end(found: Estimate, columns: int, ranks: int) -> float:
    """Bytes of the rank that needs most when all bonds have broken, of a path with so many influence columns."""
    kept = columns if columns <= NEVER_REFACTORED_ROWS else INFLUENCE_COLUMNS
    return found.memory + columns / ranks * (PATH_BYTES + kept * PAIR_BYTES)


def fields_line(case: Case, nodes: int, elements: int, interface_nodes: int, ranks: int) -> str:
    """Return how many states result.h5 has, its size, and the time that they take, in a line as `estimate_lines`."""
    asked = case.output.states
    is_spatial = PLANE_STATES[case.analysis.plane].is_spatial
    rows = np.array([nodes, elements, interface_nodes])
    state = int(rows @ (STATE_BYTES + is_spatial * AXIAL_BYTES))
    mesh = int(rows @ MESH_BYTES) + 3 * case.cell.order * CORNER_BYTES * elements
    if case.section.is_followed and isinstance(asked, str):
        return f"fields     {_size(mesh)} of result.h5, and {_size(state)} for each state"
    count, is_most = _states(case)
    noun = "state" if count == 1 else "states"
    words = f"{'at most ' if is_most else ''}{count} {noun} of {_size(state)}"
    of_each = STATE_SECONDS + elements / ranks * STATE_ELEMENT_SECONDS
    if case.section.is_followed:
        of_each = POINT_SECONDS + elements / ranks * POINT_ELEMENT_SECONDS
    return f"fields     {words}, {_size(mesh + count * state)} in result.h5, {_rounded(count * of_each)}"


def _states(case: Case) -> tuple[int, bool]:
    """Return how many states result.h5 has, and whether that is the most that it may have."""
    if case.section.is_followed:
        assert isinstance(case.output.states, int)
        return case.output.states, True
    may_open = bool(case.arcs) or case.cell.has_own_mesh  # by its curve "debonded", if it has one
    contact = case.interface is not None and case.interface.contact and may_open
    loads = sum(len(problem.loads) for problem in phase_laws.problems(case))
    return case.section.solves(loads, contact), contact and not case.arcs


def events_lines(
    case: Case, multipliers: int, fibres: int, teeth: int, nodes: Sequence[int], seconds: float, memory: float
) -> list[str]:
    """Return how many events a path may have and how long all of them take, in a line as `estimate_lines`.

    None of another analysis, or of a cell without interfaces. There are at most as many events as bonds, times the
    teeth of each; nodes on cuts of bodies are counted with them. `nodes` are those of each rank, `seconds` the estimate
    for few events, `memory` the bytes of the rank that needs most for all.
    """
    if not (case.section.is_followed and case.interfaces):
        return []
    share = float(np.mean([_unbroken_share(each, max(fibres, 1)) for each in case.interfaces]))
    bonds = round(multipliers // 2 * share)
    words = f"up to about {bonds} bonds break" + (f" in {teeth} teeth each" if teeth > 1 else "")
    dofs = 2.0 * sum(nodes)
    event = EVENT_SECONDS + dofs * (EVENT_DOF_SECONDS + EVENT_RANK_DOF_SECONDS / len(nodes))
    longest = _rounded(seconds + bonds * teeth * event)
    time = f"{1e3 * event:.2g} ms or more for each"
    lines = [
        f"events     {words}, {time}: from {_rounded(seconds)} for few to {longest} or more "
        f"and {_size(memory)} on the largest rank for all"
        if bonds
        else f"events     of contact alone, for no bond is left to break, {time}"
    ]
    faces = _size(FACE_PAIR_BYTES * multipliers**2)
    when = f"up to {faces} more on the first rank if all bonds break" if bonds else f"{faces} more on the first rank"
    return [*lines, f"friction   {when}"] if case.has_friction else lines


def checkpoint_line(size: float) -> str:
    """Return how many bytes the checkpoint of a path may take, in a line as `estimate_lines`."""
    return f"checkpoint up to {_size(size)} while the path is followed"


def _unbroken_share(interface: InterfaceSection, fibres: int) -> float:
    """Return the share of the bonds of an interface that may break, all of so many fibres alike."""
    limits = LAWS[interface.criterion].limits
    if limits and all(getattr(interface, name) is None for name in limits):
        return 0.0
    arcs = [(fibres if isinstance(arc.fibre, str) else len(arc.fibre), arc.angle or 0.0) for arc in interface.debonded]
    return max(1.0 - sum(count * angle for count, angle in arcs) / (360.0 * fibres), 0.0)


def estimate_lines(found: Estimate, n_ranks: int, across: bool = False) -> list[str]:
    """Return an estimate for `n_ranks` ranks in two lines, each with a label of eleven columns.

    Bodies that are cut `across` do not limit the ranks.
    """
    memory = _size(found.memory)
    noun = "rank" if n_ranks == 1 else "ranks"
    most = "" if across else ", at most one per body"
    return [
        f"estimate   on {n_ranks} {noun} about {_rounded(found.seconds)}, {memory} on the largest, without pictures",
        f"ranks      recommended: {found.ranks} ({DOFS_OF_A_RANK} degrees of freedom per rank{most})",
    ]


def _size(size: float) -> str:
    """Return bytes in words."""
    if size < 2**17:
        return f"{size / 1024:.0f} KiB"
    size /= 2**20
    digits = 1 if size < 10 else 0
    return f"{size:.{digits}f} MiB" if size < 1000 else f"{size / 1024:.1f} GiB"


def _rounded(seconds: float) -> str:
    """Return a time in words, to two digits."""
    if seconds < 120:
        return f"{seconds:.2g} s" if seconds < 100 else f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
