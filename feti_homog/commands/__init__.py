"""Commands of `feti-homog`, one module each: `add(actions)` gives the parser its options and its action.

Imports `analysis`, `api`, `case`, `fibres`, `mesh`, `microstructure`, `parallel`, `petsc`, `report`, `results`,
`runtime`, `sweep` and `verify`.  Modules import the computation inside their action, so that `--help` and `--version`
start without NumPy and MPI.  Main entries: `run` and the other commands.
"""
