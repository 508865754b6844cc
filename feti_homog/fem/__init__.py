"""Finite elements for plane elasticity, axial shear and conduction: linear and isoparametric quadratic triangles.

Imports `mesh`.  Main entry: `assembly.assemble`, the stiffness matrix and load columns of one subdomain.
"""

from feti_homog.fem.problem import AXIAL, CONDUCTION, GENERALIZED, PLANE, Problem

__all__ = [
    "AXIAL", "CONDUCTION", "GENERALIZED", "PLANE", "Problem", "arc_error", "assembly", "local_fits",
    "shape_functions", "stress_recovery",
]  # fmt: skip
