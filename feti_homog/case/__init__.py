"""The case file: its sections and keys, checked before anything is computed.

May use `materials`, `microstructure`, `schema`, `runtime` and `errors`; starts neither MPI nor PETSc.  Main entries:
`case.load` and `case.parse`; `reference` and `json_schema` describe the file.
"""
