"""Random small cases over the whole language of case files, and relations that their results must obey.

`python -m differential`, by `scripts/test differential`, runs many of them in one job: `random_cells` and `random_loads`
draw the cases, `relations` has what must hold, `comparison` measures it, `twin` solves once more from the files.
"""
