"""Vectorised plane elasticity on linear and (isoparametric) quadratic triangles."""
