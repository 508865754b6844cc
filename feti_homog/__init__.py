"""FETI-based homogenization of fibre composites; see the README. Importing it does not start MPI or PETSc."""

__version__ = "0.1.0"
