"""Every number of the solver that was chosen: its unit, what it is for, and the command that measured it.

This module imports nothing of the program, so that scripts may read it without starting MPI.  `Thresholds` holds what
may be varied.  The constants below it are limits of rounding, and of memory and speed at a time; no result depends on
them beyond the solver's tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Thresholds:
    """Where the solver changes its ways.  Tests and studies pass others than the defaults.

    `scripts/benchmark scripts/cases/benchmark_1m.toml --tools feti` times what follows from the first two.

    Attributes:
        dense_boundary_dofs: boundary degrees of freedom of a subdomain up to which `-feti_dual_operator auto` ever
            makes dense matrices, of 8 n^2 bytes.
        whole_boundary_dofs: boundary degrees of freedom of a whole body above which its soft modes come from a dense
            eigenproblem for each face, not from one.
        replicated_vectors: coarse vectors up to which every rank factors the whole coarse matrix and solves for some
            of the load cases; above, all ranks factor it together (`scripts/scaling`).
    """

    dense_boundary_dofs: int = 6000
    whole_boundary_dofs: int = 2000
    replicated_vectors: int = 20_000


DEFAULTS = Thresholds()

# linalg

# Relative residual that a coarse solve must reach: the projector takes away nearly all of what it is applied to where
# materials differ much, so what is left has few digits.
COARSE_ACCURACY = 1e-14
# Weight rho of the constraints in the augmented matrix E + rho K^T K, with a unit diagonal of E and unit rows of K.
# Each solve shrinks the error of the constraints by about rho, and the factor loses about log10(rho) digits.
AUGMENTATION_WEIGHT = 1e7
# Solves with the augmented factor: the fewest, and the most that are tried to reach COARSE_ACCURACY.
MIN_COARSE_SOLVES, MAX_COARSE_SOLVES = 3, 4
# Solves with the indefinite factor, one of them iterative refinement.
INDEFINITE_COARSE_SOLVES = 2
# Per cent more workspace than MUMPS estimates, which the pivoting of an indefinite matrix may use up.
MUMPS_EXTRA_WORKSPACE_PERCENT = 200
# Entries of dense blocks that wait to be added to a sparse sum, at least: 16 bytes each.
MAX_BUFFERED_ENTRIES = 4_000_000
# Right-hand sides up to which the library is faster with one after the other than with all at once.
# `scripts/measure_kernels.py` measures these and the two below.
CHOLMOD_COLUMNS_ONE_BY_ONE, MUMPS_COLUMNS_ONE_BY_ONE = 2, 1
# Rows up to which LAPACK's dtrtri inverts a triangle faster than halving it.
TRIANGLE_INVERSE_ROWS = 48
# Rows of the blocks in which a triangle is mirrored, so that they fit the cache.
MIRRORED_BLOCK_ROWS = 64

# operators

# Seconds, up to a common factor, for the choice: of a dense inverse per n^3 of n boundary dofs, and of one application
# of the dual operator and the preconditioner by triangular solves per dof; measured with `scripts/benchmark_path`.
DENSE_INVERSE_SECONDS, APPLY_SECONDS = 5e-10, 3.5e-7
# Columns up to which dense products one after the other are faster than all at once (`scripts/measure_kernels.py`).
DENSE_COLUMNS_ONE_BY_ONE = 6
# Columns for which sparse factors are solved at once: bounds the memory of their right-hand sides, 8 bytes a dof each.
SPARSE_COLUMNS_AT_ONCE = 64
