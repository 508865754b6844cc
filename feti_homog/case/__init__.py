"""The case file: its sections, keys and materials, checked before anything is computed.

May use `runtime` and `errors`; starts neither MPI nor PETSc.  Main entries: `case.load` and `case.parse`;
`reference` and `json_schema` describe the file.
"""
