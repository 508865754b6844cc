"""All tuned numbers of the solver, with unit, purpose, and the command that measured them.

This module imports nothing from the program, so that scripts read it without MPI.  `Thresholds` holds the numbers that
studies vary: `scripts/measure_thresholds NAME VALUE...` prints the cost and the gain of each value.  The constants
below the class bound rounding and memory; no result depends on them beyond the tolerance of the solver.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Thresholds:
    """The sizes at which the solver changes its method, and parameters of soft modes.  Tests may replace the defaults.

    "Measured" refers to `scripts/measure_thresholds.py NAME VALUE...` with the values in brackets; "vectors" are coarse
    vectors per subdomain.  Numbers without a unit are ratios or counts.

    Attributes:
        dense_boundary_dofs: largest number n of boundary dofs for which `-feti_dual_operator auto` makes dense
            matrices of 8 n^2 bytes; also bounds the rows of a dense assembled Schur complement.
        soft_mode: bound tau: modes with theta < tau are soft, see `coarse.local_eigenproblems`.  The default of
            `-feti_coarse_threshold`; the condition number is about 1 / tau.  Measured [0.1, 0.24, 0.35, 0.5]: 30, 20,
            17, 14 iterations; 4.4, 5.4, 6.3, 7.3 vectors.
        face_factor: factor on tau in a face eigenproblem, which lacks the energy of the rest of the body.
            Measured [0.6, 0.8, 1, 1.25]: 20, 17, 16, 16 iterations; 7.5, 8.8, 9.5, 10.7 vectors.
        face_layers: layers of coarse triangles in the neighbourhood of a face.  Measured [1, 2, 3]: 15, 16, 17
            iterations; 14.5, 10.7, 10.2 vectors: one layer finds modes that the body does not have.
        decayed: displacements of an extended face mode below this fraction of the largest displacement are set to 0.
            Measured [1e-3, 0.01, 0.03, 0.1]: 16, 16, 16, 18 iterations.
        min_trace_dofs: least number of dofs in the trace space of a boundary or a face.  Measured
            [30, 60, 100, 250]: 18, 18, 18, 16 iterations; 6.7, 6.8, 6.9, 7.3 vectors.
        whole_boundary_dofs: boundary dofs of a whole body above which soft modes come from dense eigenproblems of
            its faces, not of its boundary.  Measured [1000, 5000] with a boundary of 3644: 1.0 and 3.4 s.
        influence_applications: least number of products with the dual operator for which influence columns pay off
            (`scripts/benchmark_path`).
        assembled_schur_dofs: largest number of dofs on shared nodes, with all bonds intact, for influence columns.
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

# Relative size below which a number counts as rounding: |K R| / |K| (a rotation that is wrong by 1 % gives 1e-7),
# eigenvalues of G^T G, pivots of H, energies of modes that no active row resists (one resisting row out of n gives
# about 1 / n), and residuals of iterative methods in place of a factorization.  Rounding itself is about 1e-15.
ZERO_TOLERANCE = 1e-10
# Columns that are solved, copied or computed together.  A smaller number takes more time; a column of right-hand sides
# takes 8 bytes per degree of freedom (`scripts/benchmark_path --to-the-end`).
COLUMNS_AT_ONCE = 64

# linalg

# Workspace of MUMPS beyond its estimate, in per cent: the default, 20, fails for a matrix of 13 084 rows on two ranks.
MUMPS_EXTRA_WORKSPACE_PERCENT = 100
# Degrees of freedom of a rank up to which the process keeps the memory that the set-up freed: the next case needs it.
MOST_DOFS_UNTRIMMED = 100_000
# Least number of degrees of freedom for which nested dissection along cuts of the mesh costs less than CHOLMOD's
# minimum degree, in ordering and factorization of a subdomain together.
LEAST_ORDERED_DOFS = 15_000
# Buffered entries of dense blocks at which the buffer is added to a sparse sum; an entry takes 16 bytes.
MAX_BUFFERED_ENTRIES = 4_000_000
# Unknowns of a coarse problem up to which every rank factors the whole matrix.  Paths of small cells factor at every
# event, in milliseconds; a distributed factorization waits for messages.  With 1 812 unknowns on two ranks, both take
# equal time (`scripts/benchmark scripts/cases/benchmark_1m.toml`, with and without `-feti_coarse_pc_type cholesky`).
REPLICATED_UNKNOWNS = 2000
# Rows of a block that fits the cache; triangles are mirrored and inverted by blocks (`scripts/measure_kernels.py`).
BLOCK_ROWS = 48
# Number of columns whose product with a matrix takes as long as a copy of the matrix.
COPIED_COLUMNS = 20

# decomposition

# METIS needs integer edge weights: lengths are rounded up to multiples of the longest edge over this number.  Cuts are
# 5 % shorter, but more numerous, than with one class (`tests/unit/feti/decomposition/test_partition.py`).
LENGTH_CLASSES = 100
# Largest load by METIS, which keeps neighbours together, over the largest balanced load; also METIS's own limit.
MAX_IMBALANCE = 1.03
# Largest difference between a strip and half of the triangles, relative to all triangles; number of widths to try.
STRIP_SLACK, STRIP_WIDTHS = 0.01, 33
# Number of scatters that stay cached, by their numbers of columns: one load, all unit loads, a full batch of influence
# columns, and a last batch.
KEPT_EXCHANGES = 4

# operators

# Time of a dense inverse / n^3, for n boundary dofs, relative to the time / dof of one product with the dual operator
# and the preconditioner by triangular solves (`scripts/benchmark_path`).
DENSE_INVERSE_COST = 1 / 700
# Largest lambda / mu of mixed elements in the diagonal of K that scales jumps (`scripts/robustness --poisson`).  Fibres
# beside a matrix with the same modulus and nu = 0.4999 take 15, 11 and 36 iterations with the bounds 2, 9 and inf, and
# 9 coarse vectors per subdomain with 2; pieces beside fibres a thousand times stiffer take 15, 15 and 79 iterations.
SCALED_LAME = 2.0
# Columns up to which dense products one after the other are faster than all at once (`scripts/measure_kernels.py`).
DENSE_COLUMNS_ONE_BY_ONE = 6
# Stiffness ratio of a body above which products with its inverse are refined.  In a thin body the ratio is the product
# of the largest diagonal entries of S and of its regularised inverse: up to 3e3 in discs and pieces around discs, 1.5e4
# in rings with a thickness of 1/20 of the radius, 4e6 with 1/100.  There forces balance to 4e-12, without refinement to
# 5e-8; in pieces with a neck of 1/2000 between fibres, with a ratio of 2e6, to 3e-12 and 6e-9.  In any body the ratio
# is 1 / `Subdomain.compressible_share`, above the bound from nu = 0.49999 on: a matrix with nu = 0.4999999 beside
# fibres of a thousandth of its modulus balances energies to 3e-9, without refinement to 2e-4.
ILL_CONDITIONED = 1e4

# solver, krylov

# Relative tolerance of both primal residuals: the default of `-feti_ksp_rtol`.
RTOL = 1e-8
# Iterations per load case: the default of `-feti_ksp_max_it`.
MAX_ITERATIONS = 2000
# Iterations in which the jump must halve once the forces are small enough; otherwise rounding stalls the iteration, and
# it restarts from its last multipliers.  Without rounding, CG at a condition number of 10 needs one or two.
STALL_ITERATIONS = 4
# Iterations in which the forces must halve before they are small enough: plateaus of CG are shorter where the coarse
# space leaves a condition number of about 1 / tau (`scripts/robustness`: at most 23 iterations in all).
FORCE_STALL_ITERATIONS = 50
# Restarts of an iteration that stalls; the last restart runs on through a stall.
MAX_RESTARTS = 2
# A jump on the active rows counts as rounding below ZERO_JUMP times the jump of the torn cell, and below
# ROUNDING_MARGIN times the estimate by `dual_solution.jump_rounding`: with a stiffness ratio of 1000, rounding was up
# to 20 times the estimate.  Averaged modes count as rounding below ROUNDING_MARGIN times the machine precision.
ZERO_JUMP, ROUNDING_MARGIN = 1e-13, 100.0

# exact, confirmation

# Largest number of solves by influence columns between two confirmations by F lambda.
MOST_UNCONFIRMED = 32
# Relative errors, measured by F lambda.  First: error of multipliers by influence columns above which the run fails.
# Second: error of multipliers and jumps by followed columns above which both are computed anew.
MOST_UNCONFIRMED_ERROR, MOST_FOLLOWED_ERROR = 1e-5, 1e-11
# Relative size below which pivots, jumps and forces by followed columns are rejected: errors could exceed 1e-5.
LEAST_FOLLOWED = MOST_FOLLOWED_ERROR / MOST_UNCONFIRMED_ERROR
# Largest error, relative to the largest entry, that counts as rounding: the asymmetry of new columns, above which the
# response gets a new reference cell; half the error by F lambda, if multipliers computed anew are no better.
MOST_ROUNDING = 1e-9
# Changed rows after which the cell is factored anew in its present state: the default of `-feti_influence_columns`.
# Cells with at most NEVER_REFACTORED_ROWS rows never gain by a new factor.  Above this number of followed columns, or
# twice the option if larger, unused columns of 8 bytes per owned row go (`scripts/benchmark_path --to-the-end`).
INFLUENCE_COLUMNS, NEVER_REFACTORED_ROWS = 1000, 2500
# Changes that are collected before they are applied to all followed columns (`scripts/benchmark_path --to-the-end`).
WAITING_COLUMNS = 32
# Fraction of the followed columns that stay when there is no room for new columns.
FOLLOWED_SHARE = 0.75
# Ratio of stiffnesses (mean diagonals of K) of a fibre and the body around the fibre above which influence columns use
# forces of the outer body: forces of the fibre lose as many digits as the ratio has.
STIFF_FIBRES = 1e3

# coarse

# Multiples of the identity, added to the coarse matrix with a unit diagonal until it can be factored: averaged modes
# may be linearly dependent.  The first was enough in all lists of `scripts/robustness`, with contrasts up to 1e6.
COARSE_REGULARISATIONS = (1e-12, 1e-10, 1e-8)
