"""Plane elasticity on linear and (isoparametric) quadratic triangles, vectorized over elements.

Imports `mesh`.  Main entry: `assembly.assemble`, the stiffness matrix and load columns of one subdomain.
"""
