"""Operators on the boundaries of subdomains, S and S+, explicit or implicit, and the dual operator F made of them.

May use `decomposition` and `linalg`.  Main entries: `interface_operators` and `dual_operator`.
"""
