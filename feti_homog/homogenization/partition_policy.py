"""Choose the piece count, and estimate memory, useful ranks and dual operator applications.

The memory is linear in the degrees of freedom, because bodies are cut into equally large pieces.
`scripts/measure_cost.py` measures the constants.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.case import Case, bond_laws
from feti_homog.fem import Problem
from feti_homog.feti import thresholds
from feti_homog.feti.decomposition import partition
from feti_homog.homogenization import phase_laws
from feti_homog.materials import laws
from feti_homog.mesh import ReferenceLattice
from feti_homog.mesh.tiles import tiling
from feti_homog.microstructure import phase_names
from feti_homog.system.petsc import option_table, options_database
from feti_homog.typing import Int

# Poisson's ratio up to which lambda adds little to the stiffness at single nodes of mixed elements (`SCALED_LAME`).
MOST_POISSON = 0.45
# Stiffness ratio up to which a subdomain may have several phases: at larger ratios, rounding in dense matrices costs
# accuracy (4e-7 at 1e6, 2e-10 at 9e3) and then convergence.
MOST_CONTRAST = 1e3
# Options that only set the accuracy of the solver; other options need a dual problem, which one subdomain lacks.
TOLERANCES = {"feti_ksp_rtol", "feti_ksp_atol", "feti_ksp_max_it"}
# Bytes of a rank: without degrees of freedom, per degree of freedom, per plane subdomain, more on springs, and per
# multiplier with influence columns.  For 37 cells, estimates are 0.78 to 1.24 times the measured memory.  A coarse
# triangle takes as much as a degree of freedom; without refinement, estimates of four runs are 0.85 to 1.1 times it.
BASE_BYTES, DOF_BYTES, SUBDOMAIN_BYTES, SPRING_BYTES, COLUMN_BYTES = 1.5e8, 9.9e2, 7.0e5, 7.7e5, 2.6e4
INTERIOR_BYTES = 4.7e2  # more per degree of freedom if the run keeps the factors of interiors
# More per displacement of the largest problem in a cell of one factor; for seven cells, estimates are within 3 %.
FACTOR_BYTES = 1.2e3
# Additional bytes of a path to complete debonding: for each multiplier of a rank, and for each pair of a multiplier and
# an influence column; a cell that is factored anew has `INFLUENCE_COLUMNS` columns.  For five paths with 1 to 50 fibres
# and 120 to 4 110 multipliers, on one rank, estimates are 0.93 to 1.17 times the measured memory.  The six dense
# matrices of debonded faces with friction (`interface.friction`) also take PAIR_BYTES for each pair of jumps.
PATH_BYTES, PAIR_BYTES = 7e4, 50
# Degrees of freedom below which a rank waits longer than it computes: 57 500 take as long on two ranks as on one.
DOFS_OF_A_RANK = 50_000
# Typical numbers for the choice of operators; the iterations with coatings are counted without influence columns.
ITERATIONS_OF_A_SOLVE, ITERATIONS_WITH_COATINGS, SOLVES_OF_A_CONTACT, SOLVES_OF_A_PATH = 20, 400, 3, 100


@dataclass(frozen=True)
class PartitionPolicy:
    """The rules for default piece counts.  Sizes are degrees of freedom after refinement.

    Attributes:
        piece_dofs: piece size; smaller pieces slow down the coarse problem, larger ones the factors and dense matrices.
        piece_boundary_dofs: largest boundary between a piece and other bodies; for pieces in narrow bodies.
        cut_factor: ratio of a bonded body to a piece, by size or boundary, above which the body is cut.
        even_cut_factor, even_share: `even_cut_factor` replaces `cut_factor` for bodies up to the fraction `even_share`
            of a rank's load: ranks balance such bodies without cuts.
        breakable_boundary_dofs: where bonds may break, a body is cut if its boundary is larger: the cell is solved so
            often that uncut bodies pay off while the dense matrices of their boundaries are small.
        tiles: rules for the tiles of the coarse mesh.
        across_dofs: where nothing can part, cells up to this size are cut across materials, not body by body; so are
            label images of any size, because their bodies have long boundaries; 0 for no such cuts.
        subdomain_dofs: a subdomain costs as much as this many degrees of freedom; if bodies are smaller on average,
            cuts across materials pay off in cells larger than `across_dofs` by the same ratio.
        across_piece_dofs: size of a piece across materials, with as many multipliers as a smaller piece within a body.
        whole_dofs: on one rank, a cell across materials is whole up to this size: one sparse factor takes less time
            than dense piece matrices, which need half the memory.
        whole_ranks: largest number of ranks with one piece per rank across materials; the Schur complements are
            factored together, and are too large for more ranks.
        strip_dofs: cells from this size on are halved into strips.  Smaller cells have short boundaries anyway, and the
            irregular cuts of METIS make their estimated mesh errors depend less on the direction.

    `scripts/benchmark scripts/cases/benchmark_1m.toml --tools feti` times the rules for bonded bodies,
    `scripts/benchmark_path` the rules for bodies that may part, and `scripts/benchmark --table small` the last five.
    """

    piece_dofs: int = 2200
    piece_boundary_dofs: int = 500
    cut_factor: float = 2.5
    even_cut_factor: float = 16.0
    even_share: float = 1 / 16
    breakable_boundary_dofs: int = 2500
    tiles: tiling.TilePolicy = tiling.DEFAULT_TILES
    across_dofs: int = 0
    subdomain_dofs: int = 550
    across_piece_dofs: int = 7000
    whole_dofs: int = 400_000
    whole_ranks: int = 2
    strip_dofs: int = 30_000

    def across_pieces(self, dofs: int, bodies: int, n_ranks: int, is_image: bool = False) -> int:
        """Return the number of pieces across materials, a multiple of `n_ranks`; 0 if the cell is to be cut by body."""
        limit = self.across_dofs * max(1.0, self.subdomain_dofs * bodies / dofs)
        if not self.across_dofs or (dofs > limit and not is_image):
            return 0
        if n_ranks <= self.whole_ranks and dofs <= self.whole_dofs:
            return n_ranks
        return n_ranks * max(1, round(dofs / (n_ranks * self.across_piece_dofs)))


DEFAULT_POLICY = PartitionPolicy()
# The policy of runs: cells up to this size are cheaper across materials.
BY_COST = PartitionPolicy(across_dofs=400_000)


def can_be_cut_across(case: Case) -> bool:
    """Return whether subdomains may reach across materials.

    They may if nothing can part and the case prescribes neither the cut nor the dual solver.  Nearly incompressible
    phases and very different stiffnesses need the scaling of single bodies, so they rule such subdomains out, too.
    """
    asked, free = case.decomposition, ("auto", None, None, "torus")
    if case.interfaces or (asked.cut, asked.subdomains, asked.max_dofs, case.cell.bodies) != free:
        return False
    options = {*case.petsc, *options_database.given_options()} - TOLERANCES
    if any(name.startswith("feti_") and not option_table.only_prints(name) for name in options):
        return False
    ratios = (laws.isotropic_ratio(material) or 0.0 for material in case.materials.values())
    # Contrast: the largest ratio of the largest entries of two phases' stiffnesses, in any problem.
    pairs = [(problem, phase) for problem in phase_laws.problems(case) for phase in case.materials]
    sizes = np.array([np.abs(phase_laws.law(case, phase, problem)[:4, :4]).max() for problem, phase in pairs])
    sizes = sizes.reshape(-1, len(case.materials))
    return max(ratios) <= MOST_POISSON and float((sizes.max(axis=1) / sizes.min(axis=1)).max()) <= MOST_CONTRAST


def wanted_pieces(
    case: Case, load: Int, edges: Int, lattice: ReferenceLattice, n_ranks: int, policy: PartitionPolicy = DEFAULT_POLICY
) -> Int:
    """Choose the piece count (b,) of each of b bodies.

    The case determines the counts, or else the policy, which gives each rank at least one piece.

    Args:
        load: (b,) coarse triangles in each body.
        edges: (b,) coarse edges between each body and other bodies.
    """
    # A coarse triangle adds about M^2 / 2 nodes.
    dofs_of_triangle = lattice.intervals**2
    if case.decomposition.max_dofs is not None:
        return partition.pieces_for_size(load, dofs_of_triangle, case.decomposition.max_dofs)
    if case.decomposition.subdomains is not None:
        return partition.pieces_for_count(load, case.decomposition.subdomains)
    all_dofs = int(load.sum()) * dofs_of_triangle
    boundary = edges * 2 * lattice.intervals
    if case.interface is None:
        evenly_shared = min(policy.even_cut_factor * policy.piece_dofs, policy.even_share * all_dofs / n_ranks)
        largest = max(policy.cut_factor * policy.piece_dofs, evenly_shared)
        to_cut = (load * dofs_of_triangle > largest) | (boundary > policy.cut_factor * policy.piece_boundary_dofs)
    else:
        to_cut = boundary > policy.breakable_boundary_dofs
    by_size = partition.pieces_for_size(load, dofs_of_triangle, policy.piece_dofs)
    by_boundary = np.minimum(-(-boundary // policy.piece_boundary_dofs), load)
    pieces = np.where(to_cut, np.maximum(by_size, by_boundary), 1)
    return pieces if pieces.sum() >= n_ranks else partition.pieces_for_count(load, n_ranks)


def applications(case: Case, problem: Problem, across: bool = False) -> int:
    """Estimate how often a run applies the dual operator of a problem; `across` if pieces reach across phases."""
    has_arcs = bool(case.arcs) or case.cell.has_own_mesh  # the mesh may have a curve "debonded"
    touches = case.interface is not None and case.interface.contact and (has_arcs or case.section.is_followed)
    contact = touches and problem.turns  # in axial shear no faces touch
    bond = case.interface
    by_energy = bond is not None and bond.criterion in bond_laws.laws_with("growth") and bond.growth == "released"
    # Envelopes with arcs need the inverse operator, which pays off if there are many solves.
    many = case.section.is_followed or (has_arcs and case.section.breaks and by_energy)
    solves = SOLVES_OF_A_PATH if many else case.section.solves(len(problem.loads), contact)
    has_coatings = phase_names.COATING in case.materials and not across
    iterations = ITERATIONS_WITH_COATINGS if has_coatings else ITERATIONS_OF_A_SOLVE
    return iterations * solves * (SOLVES_OF_A_CONTACT if contact else 1)


def keeps_interiors(case: Case) -> bool:
    """Return whether the run recovers many states, which makes the factors of interiors worth their memory."""
    return case.analysis.type == "angle" or (case.section.is_followed and case.output.fields)


def memory(
    case: Case, nodes: Sequence[int], subdomains: Sequence[int], components: Sequence[int], columns: int, triangles: int
) -> float:
    """Estimate the memory of the largest rank, in bytes.

    Args:
        nodes, subdomains: numbers of nodes and subdomains on each rank.
        components: displacements at a node in each problem.
        columns: multipliers that have influence columns.
        triangles: coarse triangles of the cell.
    """
    dofs = sum(components) * max(nodes)
    of_interiors = dofs * INTERIOR_BYTES if keeps_interiors(case) else 0.0
    factors = max(components) * max(nodes) * FACTOR_BYTES if max(subdomains) == 1 else of_interiors
    springs = SPRING_BYTES if phase_laws.has_springs(case) else 0.0
    matrices = sum(components) / 2 * max(subdomains) * (SUBDOMAIN_BYTES + springs)
    of_all_ranks = columns * COLUMN_BYTES + triangles * DOF_BYTES
    return BASE_BYTES + dofs * DOF_BYTES + factors + matrices + of_all_ranks / len(nodes)


def memory_to_the_end(case: Case, before: float, multipliers: int, columns: int, ranks: int) -> float:
    """Estimate the memory of the largest rank after all bonds break, in bytes.

    `before` is this memory before bonds break; `columns` of all `multipliers` have influence columns.
    """
    stored = columns if columns <= thresholds.NEVER_REFACTORED_ROWS else thresholds.INFLUENCE_COLUMNS
    faces = PAIR_BYTES * multipliers**2 if case.has_friction else 0
    return before + columns / ranks * (PATH_BYTES + stored * PAIR_BYTES) + faces


def recommended_ranks(dofs: int, bodies: int) -> int:
    """Return the largest useful number of ranks for a cell with `dofs` degrees of freedom.

    The number is at most the number of bodies, because more ranks would cut bodies, which costs iterations.  In cells
    that are cut across materials, `bodies` counts coarse triangles.
    """
    return max(1, min(bodies, dofs // DOFS_OF_A_RANK))


def in_words(size: float) -> str:
    """Format a number of bytes in MiB, or in GiB from 1000 MiB on."""
    size /= 2**20
    digits = 1 if size < 10 else 0
    return f"{size:.{digits}f} MiB" if size < 1000 else f"{size / 1024:.1f} GiB"
