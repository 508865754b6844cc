"""FETI-based homogenization of fibre composites; see the README. Importing it does not start MPI or PETSc.

From a program of one's own: `run(Case.load("case.toml"), comm)` is the result as arrays.
"""

__version__ = "0.1.0"

from feti_homog.api import run
from feti_homog.config.case import Case
from feti_homog.errors import CaseError, ConvergenceError, FetiHomogError, MeshError

__all__ = ["Case", "CaseError", "ConvergenceError", "FetiHomogError", "MeshError", "__version__", "run"]
