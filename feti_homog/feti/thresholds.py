"""Sizes at which the solver changes its ways, for programs that must not start MPI."""

# Rows up to which every rank factors the whole coarse matrix and solves for some of the load cases.
LARGEST_REPLICATED = 20_000
