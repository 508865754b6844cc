"""The case file: its sections and keys, checked before anything is computed.

Imports `materials`, `microstructure`, `schema` and `system`. Starts neither MPI nor PETSc.  Main entries: `case.load`
and `case.parse`; `reference` describes the file.
"""
