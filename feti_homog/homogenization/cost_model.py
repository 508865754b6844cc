"""Memory of a case, the ranks that it can use, and how often it applies its dual operator, before anything is solved.

Memory is linear in the degrees of freedom, for bodies are cut into pieces of one size.  `scripts/measure_cost.py`
measures its constants.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

from feti_homog.case.bond_laws import laws_with
from feti_homog.case.case import Case
from feti_homog.fem.problem import AXIAL, Problem
from feti_homog.feti.thresholds import INFLUENCE_COLUMNS, NEVER_REFACTORED_ROWS
from feti_homog.microstructure.phase_names import COATING

# Bytes of a rank without degrees of freedom, for each of these, and for each multiplier that has influence columns.
BASE_BYTES, DOF_BYTES, COLUMN_BYTES = 1.8e8, 1.5e3, 2.0e4
# Bytes more for each displacement of the largest problem of a cell that is one factor: of seven bonded cells of 31 000
# to 271 000 degrees of freedom estimates are 0.93 to 1.07 times the measured memory, of two of order 2 0.85 times.
FACTOR_BYTES = 2.9e2
# Bytes more of a path to complete debonding with influence columns: for each multiplier of a rank, and for each pair of
# one and a column, of which a cell that is factored anew has `INFLUENCE_COLUMNS`. Of five paths of 1 to 50 fibres, 120
# to 4 110 multipliers, on one rank, estimates are 0.93 to 1.17 times the measured memory.
PATH_BYTES, PAIR_BYTES = 7e4, 50
# Bytes for each pair of jumps of debonded faces with friction: six dense matrices (`interface.friction`).
FACE_PAIR_BYTES = 48
# Degrees of freedom of a rank; with fewer, its waiting for others takes more than it saves.
DOFS_OF_A_RANK = 50_000
# Typical numbers, by which operators are chosen; iterations with coatings are without influence columns.
ITERATIONS_OF_A_SOLVE, ITERATIONS_WITH_COATINGS, SOLVES_OF_A_CONTACT, SOLVES_OF_A_PATH = 20, 400, 3, 100


def applications(case: Case, problem: Problem, across: bool = False) -> int:
    """Estimate how many times the analysis applies the dual operator of a problem.

    Coatings cost no iterations where pieces reach `across` materials.
    """
    has_arcs = bool(case.arcs) or case.cell.has_own_mesh  # with a curve "debonded", perhaps
    touches = case.interface is not None and case.interface.contact and (has_arcs or case.section.is_followed)
    contact = touches and problem != AXIAL  # along the fibres nothing touches
    many = case.section.is_followed or (has_arcs and _asks_for_tips(case))
    solves = SOLVES_OF_A_PATH if many else case.section.solves(len(problem.loads), contact)
    iterations = ITERATIONS_WITH_COATINGS if COATING in case.materials and not across else ITERATIONS_OF_A_SOLVE
    return iterations * solves * (SOLVES_OF_A_CONTACT if contact else 1)


def _asks_for_tips(case: Case) -> bool:
    """Return whether an envelope with arcs needs the inverse of the dual operator, which many solves call for."""
    bond = case.interface
    by_energy = bond is not None and bond.criterion in laws_with("growth") and bond.growth == "released"
    return case.section.breaks and by_energy


def memory(nodes: Sequence[int], subdomains: Sequence[int], components: Sequence[int], columns: int) -> float:
    """Estimate the bytes of the largest rank; `nodes` and `subdomains` are of each rank.

    Args:
        components: displacements of a node in each problem.
        columns: multipliers that have influence columns.
    """
    in_one_factor = max(components) * max(nodes) if max(subdomains) == 1 else 0
    dofs = sum(components) * max(nodes)
    return BASE_BYTES + dofs * DOF_BYTES + in_one_factor * FACTOR_BYTES + columns / len(nodes) * COLUMN_BYTES


def memory_to_the_end(case: Case, few: float, multipliers: int, columns: int, ranks: int) -> float:
    """Estimate the bytes of the largest rank when all bonds of a path have broken; `few` are its bytes before."""
    stored = columns if columns <= NEVER_REFACTORED_ROWS else INFLUENCE_COLUMNS
    faces = FACE_PAIR_BYTES * multipliers**2 if case.has_friction else 0
    return few + columns / ranks * (PATH_BYTES + stored * PAIR_BYTES) + faces


def recommended_ranks(dofs: int, most: int) -> int:
    """Return how many ranks a cell can use: `most` are its bodies, for more ranks would cut them.

    Cut bodies cost iterations; of cells that are cut across materials coarse triangles stand for bodies.
    """
    return max(1, min(most, ceil(dofs / DOFS_OF_A_RANK)))


def in_words(size: float) -> str:
    """Return bytes in words."""
    size /= 2**20
    digits = 1 if size < 10 else 0
    return f"{size:.{digits}f} MiB" if size < 1000 else f"{size / 1024:.1f} GiB"
