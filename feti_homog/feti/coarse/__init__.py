"""Coarse spaces: rigid-body motions (natural) and soft modes of the subdomains beside them (adaptive, GenEO).

May use `preconditioners`, `operators`, `decomposition` and `linalg`.  Main entries: `natural` and `balanced`.
"""
