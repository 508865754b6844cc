"""Sizes at which the solver changes its ways, for programs that must not start MPI."""

# Rows up to which every rank factors the whole coarse matrix, which saves messages in every solve.
LARGEST_REDUNDANT = 20_000
