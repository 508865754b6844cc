"""Oracles: what the program computes, computed once more by slow and simple means that share little with it.

`monolithic` solves a bonded cell without tearing it, `quadratic_programme` one with debonded faces in contact,
`load_path` follows breaking bonds with it, and `dense_feti` does the dual problem's algebra with dense matrices.
`closed_forms` are formulas, and `references` numbers with the error and the source of each.
"""
