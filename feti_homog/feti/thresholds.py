"""Every tuned number of the solver: its unit, its purpose, and the command that measured it.

This module imports nothing from the program, so that scripts may read it without starting MPI.  `Thresholds` holds
the numbers that studies vary: `scripts/measure_thresholds NAME VALUE...` prints the cost and the gain of each value.
The constants below the class bound rounding and memory; no result depends on them beyond the solver's tolerance.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Thresholds:
    """The sizes at which the solver changes its methods.  Tests and studies pass other values than the defaults.

    "Measured" means by `scripts/measure_thresholds.py NAME VALUE...` for the values in brackets.

    Attributes:
        dense_boundary_dofs: most boundary dofs of a subdomain for which `-feti_dual_operator auto` makes dense
            matrices, of 8 n^2 bytes; rows of the largest dense assembled Schur complement.
        soft_mode: tau, no unit; displacements p with S p = theta N p, theta < tau, are soft.  The default of
            `-feti_coarse_threshold`; the condition number is about 1 / tau.  Measured [0.1, 0.24, 0.35, 0.5]:
            30, 20, 17, 14 iterations, 4.4, 5.4, 6.3, 7.3 vectors a subdomain.
        face_factor: tau of a face eigenproblem over tau, no unit: a face eigenproblem lacks the energy of the rest
            of the body.  Measured [0.6, 0.8, 1, 1.25]: 20, 17, 16, 16 iterations; 7.5, 8.8, 9.5, 10.7 vectors.
        face_layers: coarse triangles from a face to the far side of its neighbourhood.  Measured [1, 2, 3]: 15,
            16, 17 iterations; 14.5, 10.7, 10.2 vectors: one layer finds modes that the body does not have.
        decayed: displacements outside the face that are set to 0, relative to the largest of a face mode.
            Measured [1e-3, 0.01, 0.03, 0.1]: 16, 16, 16, 18 iterations.
        min_trace_dofs: least number of dofs in the trace space of a boundary or a face.  Measured
            [30, 60, 100, 250]: 18, 18, 18, 16 iterations; 6.7, 6.8, 6.9, 7.3 vectors.
        whole_boundary_dofs: boundary dofs of a whole body above which every face has a dense eigenproblem for soft
            modes, not the boundary.  Measured [1000, 5000] with a boundary of 3644: 1.0 and 3.4 s.
        influence_applications: least number of products with the dual operator for which influence columns pay
            (`scripts/benchmark_path`).
        assembled_schur_dofs: largest cell that is factored for influence columns, in degrees of freedom on shared nodes
            with all bonds intact.
    """

    dense_boundary_dofs: int = 6000
    soft_mode: float = 0.35
    face_factor: float = 1.25
    face_layers: int = 2
    decayed: float = 0.01
    min_trace_dofs: int = 100
    whole_boundary_dofs: int = 2000
    influence_applications: int = 1000
    assembled_schur_dofs: int = 40_000


DEFAULTS = Thresholds()

# Relative size below which a number is zero but for rounding: |K R| beside |K| (a rotation that is wrong by 1 % gives
# 1e-7), eigenvalues of G^T G, pivots of H, energies of modes that no active row resists (one resisting row out of n
# gives about 1 / n), and residuals of iterative methods in place of a factorization.  Rounding leaves about 1e-15.
ZERO_TOLERANCE = 1e-10
# Columns that are solved, copied or computed together.  Fewer take more time, and the right-hand sides take 8 bytes a
# degree of freedom and column (`scripts/benchmark_path --to-the-end`).
COLUMNS_AT_ONCE = 64

# linalg

# MUMPS gets this much more workspace than its estimate, in per cent: its own 20 were too little for a matrix of 13 084
# rows on two ranks.
MUMPS_EXTRA_WORKSPACE_PERCENT = 100
# Degrees of freedom of a rank up to which the process keeps the memory that the set-up freed: the next case needs it.
MOST_DOFS_UNTRIMMED = 100_000
# Degrees of freedom of a subdomain from which nested dissection by cuts of the mesh costs less than CHOLMOD's own
# minimum degree, ordering and factorization together.
LEAST_ORDERED_DOFS = 15_000
# Least number of entries of dense blocks that wait to be added to a sparse sum; an entry takes 16 bytes.
MAX_BUFFERED_ENTRIES = 4_000_000
# Unknowns of a coarse problem up to which every rank factors the whole matrix. Paths of small cells factor at every
# event, in milliseconds; a factor on all ranks waits for messages. With 1 812 unknowns on two ranks both cost alike
# (`scripts/benchmark scripts/cases/benchmark_1m.toml`, with and without `-feti_coarse_pc_type cholesky`).
REPLICATED_UNKNOWNS = 2000
# Rows of a block that fits the cache, in which triangles are mirrored and inverted (`scripts/measure_kernels.py`).
BLOCK_ROWS = 48
# Columns whose product takes as long as a copy of the matrix.
COPIED_COLUMNS = 20

# decomposition

# METIS takes integers as weights of edges: lengths are rounded up to multiples of the longest edge over this number.
# Cuts are 5 % shorter and more numerous than with one class (`tests/unit/feti/decomposition/test_partition.py`).
LENGTH_CLASSES = 100
# Load of the fullest rank, relative to the most even assignment, up to which neighbours stay together; the imbalance
# that METIS allows.
MAX_IMBALANCE = 1.03
# The strips into which a cell is halved differ from half of the triangles by at most this fraction of all; number of
# widths that are tried.
STRIP_SLACK, STRIP_WIDTHS = 0.01, 33
# Numbers of columns for which the vectors of an exchange are kept: one load, all unit loads, a full batch of influence
# columns, and a last batch.
KEPT_EXCHANGES = 4

# operators

# Time of a dense inverse per n^3 for n boundary dofs, relative to one application of the dual operator and the
# preconditioner by triangular solves per dof of the subdomain (`scripts/benchmark_path`).
DENSE_INVERSE_COST = 1 / 700
# lambda / mu up to which the diagonal of K scales jumps, in mixed elements (`scripts/robustness --poisson`): beside a
# matrix of nu = 0.4999 fibres of its own modulus take 15 iterations and 9 coarse vectors a subdomain with 2, 11 with 9,
# 36 without, and pieces beside fibres a thousand times stiffer 15, 15 and 79 iterations.
SCALED_LAME = 2.0
# Columns up to which dense products one after the other are faster than all at once (`scripts/measure_kernels.py`).
DENSE_COLUMNS_ONE_BY_ONE = 6
# Ratio of the largest to the least stiffness of a body above which products with its inverse are refined.  Of a thin
# body, the product of the largest diagonal entries of S and of its regularised inverse: up to 3e3 for discs and pieces
# around them, 1.5e4 for rings a twentieth of their radius thick, 4e6 for a hundredth.  Forces balance to 4e-12 there,
# and to 5e-8 without refinement.  Of any body 1 / `Subdomain.compressible_share`, so that nu is above 0.49999: beside
# fibres of a thousandth of its modulus a matrix of nu = 0.4999999 balances energies to 3e-9, and to 2e-4 without.
ILL_CONDITIONED = 1e4

# solver, krylov

# Relative tolerance of both primal residuals: the default of `-feti_ksp_rtol`.
RTOL = 1e-8
# Iterations per load case: the default of `-feti_ksp_max_it`.
MAX_ITERATIONS = 2000
# Iterations in which the jump must halve once the forces are small enough; otherwise rounding stalls it, and the solve
# restarts from its last multipliers.  Without rounding CG at a condition number of 10 halves it in one or two.
STALL_ITERATIONS = 4
# Iterations in which the forces must halve before they are small enough: plateaus of CG are shorter where the coarse
# space leaves a condition number of about 1 / tau (`scripts/robustness`: at most 23 iterations in all).
FORCE_STALL_ITERATIONS = 50
# Restarts of a stalled iteration, after which it goes on.
MAX_RESTARTS = 2
# A jump on the active rows is rounding if it is below the first number times the jump of the torn cell.  A larger one
# is rounding up to this multiple of the estimate by `dual_solution.jump_rounding`: with phases 1000 times apart
# rounding was up to 20 times the estimate.  So are averaged modes up to this multiple of the machine precision.
ZERO_JUMP, ROUNDING_MARGIN = 1e-13, 100.0

# exact, confirmation

# Largest number of solves by influence columns between two that F lambda confirms.
MOST_UNCONFIRMED = 32
# Error of these multipliers, found by F lambda, above which a run ends, as by its checks; and error of followed
# multipliers and jumps above which they are computed anew.
MOST_UNCONFIRMED_ERROR, MOST_FOLLOWED_ERROR = 1e-5, 1e-11
# Relative size below which pivots, jumps and forces are not taken from followed columns: errors of the latter would
# pass the checks of a run no more.
LEAST_FOLLOWED = MOST_FOLLOWED_ERROR / MOST_UNCONFIRMED_ERROR
# Largest error, relative to the largest entry, that is taken for rounding: the asymmetry of new columns, above which
# the response is followed from a new reference cell; half the error by F lambda where new multipliers are no better.
MOST_ROUNDING = 1e-9
# Changed rows after which the cell is factored anew in its present state: the default of `-feti_influence_columns`; and
# rows of cells in which that never pays, the number of followed columns (8 bytes an owned row) from which unused ones
# are dropped (`scripts/benchmark_path --to-the-end`).
INFLUENCE_COLUMNS, NEVER_REFACTORED_ROWS = 1000, 2500
# Changes that wait until they are applied to all followed columns (`scripts/benchmark_path --to-the-end`).
WAITING_COLUMNS = 32
# Fraction of the followed columns that stay where there is no room for more.
FOLLOWED_SHARE = 0.75
# Stiffness of a fibre relative to the body around it, by the diagonals of K, above which influence columns take the
# forces of that body: forces of the fibre lose as many digits.
STIFF_FIBRES = 1e3

# coarse

# Multiples of the identity that are added to the coarse matrix, scaled to a unit diagonal, until it can be factored:
# averaged modes may depend on each other.  In the lists of `scripts/robustness`, with contrasts to 1e6, the first was
# enough.
COARSE_REGULARISATIONS = (1e-12, 1e-10, 1e-8)
