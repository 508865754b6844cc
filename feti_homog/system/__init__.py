"""The process and its libraries.

Main entries are the packages, each on the packages before: `runtime` (one rank), `parallel` (all ranks), `petsc`.
"""
