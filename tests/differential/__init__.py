"""Random small cases over the whole language of case files, and relations that their results must obey.

`scripts/test differential` runs many of them in one job.  `random_cases` draws a case, `relations` has what must hold,
`comparison` and `paths` measure it, `twin` solves once more from the files.
"""
