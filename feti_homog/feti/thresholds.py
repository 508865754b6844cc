"""Every chosen number of the solver: its unit, its purpose, and the command that measured it.

This module imports nothing of the program, so that scripts may read it without starting MPI.  `Thresholds` holds
numbers to vary: `scripts/measure_thresholds NAME VALUE...` prints costs and gains of each value.  The
constants below it are limits of rounding and of memory at a time; no result depends on them beyond the solver's
tolerance.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Thresholds:
    """Sizes at which the solver changes its methods.  Tests and studies pass others than the defaults.

    "Measured" is by `scripts/measure_thresholds.py NAME VALUE...` for the values in brackets.

    Attributes:
        dense_boundary_dofs: boundary dofs of a subdomain up to which `-feti_dual_operator auto` ever
            makes dense matrices, of 8 n^2 bytes; rows of the largest dense assembled Schur complement.
        soft_mode: tau, no unit; displacements p with S p = theta N p, theta < tau, are soft.  The default of
            `-feti_coarse_threshold`; the condition number is about 1 / tau.  Measured [0.1, 0.24, 0.35, 0.5]:
            30, 20, 17, 14 iterations, 4.4, 5.4, 6.3, 7.3 vectors a subdomain.
        face_factor: tau of a face's own eigenproblem over tau, no unit: the energy that other faces and the rest of
            the body add is not in it.  Measured [0.6, 0.8, 1, 1.25]: 20, 17, 16, 16 iterations; 7.5, 8.8, 9.5, 10.7
            vectors.
        face_layers: coarse triangles from a face to the far side of its neighbourhood.  Measured [1, 2, 3]: 15,
            16, 17 iterations; 14.5, 10.7, 10.2 vectors: one layer finds modes that are none of the body's.
        decayed: displacements on the rest of the boundary, relative to the largest of a face's mode, that are taken for
            0.  Measured [1e-3, 0.01, 0.03, 0.1]: 16, 16, 16, 18 iterations.
        min_trace_dofs: dofs that a trace space on a boundary or a face keeps at least.  Measured
            [30, 60, 100, 250]: 18, 18, 18, 16 iterations; 6.7, 6.8, 6.9, 7.3 vectors.
        whole_boundary_dofs: boundary dofs of a whole body above which its soft modes come from a dense
            eigenproblem for each face, not from one.  Measured [1000, 5000] with a boundary of 3644: 1.0 and 3.4 s.
        influence_applications: applications of the dual operator from which on influence columns pay
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

# linalg

# Relative tolerance of an iterative method that options ask for in place of a factorization.
ITERATIVE_RTOL = 1e-10
# Per cent more workspace than MUMPS estimates: its own 20 were too little for a matrix of 13 084 rows on two ranks.
MUMPS_EXTRA_WORKSPACE_PERCENT = 100
# Degrees of freedom of a rank up to which what its set-up leaves unused is not given back: it is used again.
MOST_DOFS_UNTRIMMED = 100_000
# Degrees of freedom of an interior from which on nested dissection by cuts of the mesh costs less than minimum degree,
# CHOLMOD's own, order and factor together.
LEAST_ORDERED_DOFS = 15_000
# Entries of dense blocks that wait to be added to a sparse sum, at least: 16 bytes each.
MAX_BUFFERED_ENTRIES = 4_000_000
# Right-hand sides up to which the library is faster with one after the other than with all at once.
# `scripts/measure_kernels.py` measures these and the two below.
CHOLMOD_COLUMNS_ONE_BY_ONE, MUMPS_COLUMNS_ONE_BY_ONE = 2, 1
# Unknowns of a coarse problem up to which every rank factors it whole. Paths of small cells factor at every event, in
# milliseconds; one factor of all ranks waits for messages. With 1 812 unknowns on two ranks both cost alike
# (`scripts/benchmark scripts/cases/benchmark_1m.toml`, with and without `-feti_coarse_pc_type cholesky`).
REPLICATED_UNKNOWNS = 2000
# Share of the entries of an assembled Schur complement from which on it is factored as a dense matrix.
DENSE_SHARE = 0.5
# Rows up to which LAPACK's dtrtri inverts a triangle faster than halving it.
TRIANGLE_INVERSE_ROWS = 48
# Rows of the blocks in which a triangle is mirrored, so that they fit the cache.
MIRRORED_BLOCK_ROWS = 64

# decomposition

# METIS takes whole numbers as weights of edges: lengths are rounded up to so many classes.  Cuts are 5 % shorter and
# more than with one class (`tests/unit/feti/decomposition/test_partition.py`).
LENGTH_CLASSES = 100
# Load of the fullest rank, relative to that of the most even assignment, that is accepted to keep neighbours together.
MAX_IMBALANCE = 1.03
# Share of the triangles by which the strips into which a cell is halved may differ from half of it, and how many widths
# are tried.
STRIP_SLACK, STRIP_WIDTHS = 0.01, 33
# Largest |K R| relative to |K|.  Rounding leaves about 1e-16; a rotation that is wrong by 1 % gives 1e-7 and more.
KERNEL_TOLERANCE = 1e-10

# Counts of columns whose vectors for an exchange between ranks are kept: of one load, of all unit loads, and of a full
# batch of influence columns; other batches have any count near it.
KEPT_EXCHANGES = 4

# operators

# Seconds, up to a common factor, for the choice: of a dense inverse per n^3 of n boundary dofs, and of one application
# of the dual operator and the preconditioner by triangular solves per dof; measured with `scripts/benchmark_path`.
DENSE_INVERSE_SECONDS, APPLY_SECONDS = 5e-10, 3.5e-7
# lambda / mu up to which the diagonal of K scales jumps, in mixed elements (`scripts/robustness --poisson`): beside a
# matrix of nu = 0.4999 fibres of its own modulus take 15 iterations and 9 coarse vectors a subdomain with 2, 11 with 9,
# 36 without, and pieces beside fibres a thousand times stiffer 15, 15 and 79 iterations.
SCALED_LAME = 2.0
# Columns up to which dense products one after the other are faster than all at once (`scripts/measure_kernels.py`).
DENSE_COLUMNS_ONE_BY_ONE = 6
# Columns for which sparse factors are solved at once: bounds the memory of their right-hand sides, 8 bytes a dof each.
SPARSE_COLUMNS_AT_ONCE = 64

# Largest diagonal entries of S and of its regularised inverse, multiplied, above which products of a thin body with the
# inverse are refined: up to 3e3 of discs and of pieces around them, 1.5e4 of rings a twentieth of their radius thick,
# 4e6 of a hundredth.  Forces balance to 4e-12 there, and to 5e-8 without.
ILL_CONDITIONED = 1e4
# Share of a diagonal (`Subdomain.compressible_share`) below which they are refined too: nu above 0.49999. Beside fibres
# of a thousandth of its modulus a matrix of nu = 0.4999999 balances energies to 3e-9, and to 2e-4 without.
INCOMPRESSIBLE_SHARE = 1e-4

# solver, krylov

# Relative tolerance of both primal residuals: the default of `-feti_ksp_rtol`.
RTOL = 1e-8
# Iterations per load case: the default of `-feti_ksp_max_it`.
MAX_ITERATIONS = 2000
# Iterations in which the jump must halve once the forces are small enough; else rounding stalls it, and the solve
# restarts from its last multipliers.  Without rounding CG at a condition number of 10 halves it in one or two.
STALL_ITERATIONS = 4
# Iterations in which the forces must halve before they are small enough: plateaus of CG are shorter where the coarse
# space leaves a condition number of about 1 / tau (`scripts/robustness`: at most 23 iterations in all).
FORCE_STALL_ITERATIONS = 50
# Restarts of a stalled iteration, before it is left to go on.
MAX_RESTARTS = 2
# A projected vector, relative to the one before, below which it is projected again: what rounding leaves of rigid-body
# motions is then that of a vector of its own size.
CANCELLED = 1e-2
# A jump that the active rows see, relative to that of the torn cell, is rounding if it is as small as the first of
# these; below the second, what is rounding is measured (`dual_solution.jump_rounding`) and multiplied by a margin, for
# it was up to 20 times as large with phases 1000 times apart.
ZERO_JUMP, SMALL_JUMP, ROUNDING_MARGIN = 1e-13, 1e-8, 100.0

# Solves by influence columns at most that F lambda does not confirm, between two that it does.
MOST_UNCONFIRMED = 32
# Error of their multipliers, when F lambda comes to confirm them, above which a run ends: that of its checks.
MOST_UNCONFIRMED_ERROR = 1e-5
# Error, as F lambda shows it, of followed multipliers and jumps above which they are made anew; and the
# largest of which twice is taken for rounding of F lambda, where that changed nothing.
MOST_FOLLOWED_ERROR, MOST_CONFIRMED_ROUNDING = 1e-11, 1e-9
# Jump that active rows see, relative to that of the torn cell, below which F lambda confirms every solve.
LEAST_UNCONFIRMED_JUMP = 1e-6

# exact

# Changed rows after which the cell as it stands is factored in place of them: the default of `-feti_influence_columns`;
# and rows of cells in which that never pays (`scripts/benchmark_path --to-the-end`).
INFLUENCE_COLUMNS, NEVER_REFACTORED_ROWS = 1000, 2500
# Influence columns that each rank finds together at least, with those of bonds near the one that breaks: fewer and
# larger batches, but columns that may not be needed (`scripts/benchmark_path --to-the-end`).  Ranks up to which all are
# found together: both bound the memory of right-hand sides (boundary dofs, both).
INFLUENCE_BATCH, CHUNK_RANKS = 64, 4
# Columns from which on unused ones are no longer followed, or twice as many as `-feti_influence_columns`, 8 bytes an
# owned row each; changes that wait before all of these follow (`scripts/benchmark_path --to-the-end`).
FOLLOWED_COLUMNS, WAITING_COLUMNS = 2400, 32
# Share of these columns that stay where there is no room for more.
FOLLOWED_SHARE = 0.75
# Columns of each batch of which the entries are compared with those that are followed, and the error, relative to the
# largest, above which the response is followed from a new reference cell.
CHECKED_COLUMNS, MOST_ASYMMETRY = 4, 1e-9
# Columns that are copied at once, 8 bytes an owned row each; and of how many columns a product takes as long as a copy
# of its matrix.
COPIED_AT_ONCE, COPIED_COLUMNS = 256, 20
# Least singular value of the rows that turn, relative to their stiffness, with which columns are followed: they lose as
# many digits.
LEAST_FOLLOWED_PIVOT = 1e-6
# Share of a force on a face that a row bears which holds a free body in its place, below which that is rounding.
RIGID_SHARE = 1e-6
# Stiffness of a fibre over that of what is around it, as the diagonals of K have them, above which influence columns
# take the forces of the latter: those of the fibre lose as many digits as this has.
STIFF_FIBRES = 1e3
# Steps of the power method for the norm of the inverse of the dual operator, which find it from below, and by how much
# what they find is multiplied.
NORM_ITERATIONS, NORM_MARGIN = 30, 1.2
# Pivots of H on inactive rows, relative to the stiffness beside each, that are rounding: forces on a free fibre as a
# whole have none.
SINGULAR_PIVOT = 1e-10

# coarse

# Eigenvalues of G^T G, relative to the largest diagonal entry of the bodies that are coupled, and energies of averaged
# modes, relative to the energy with all rows active, of motions that no active row resists: rounding leaves about
# 1e-15, and one resisting row of n about 1 / n.
UNCONSTRAINED = 1e-10
# Nodes of a face below which its neighbourhood has no eigenproblem of its own: a single node can only translate.
MIN_FACE_NODES = 2
# Eigenvalues of a matrix in single precision, relative to its largest, that are rounding.
SINGLE_PRECISION_NULL = 1e-6
# Multiples of the identity that the coarse matrix, scaled to a unit diagonal, gets, the first with which it can be
# factored: averaged modes may depend on each other.  In the lists of `scripts/robustness`, with contrasts to 1e6, the
# first was enough.
COARSE_REGULARISATIONS = (1e-12, 1e-10, 1e-8)
# Energy of an averaged mode with all rows active, relative to the largest, that is rounding of displacements: the
# square of their 1e-14.
ROUNDED_MODE_ENERGY = 1e-28
