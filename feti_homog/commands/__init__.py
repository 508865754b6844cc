"""Commands of `feti-homog`, one module each: `add(actions)` gives the parser its options and its action.

May use every floor but `cli`.  The modules import what a command computes with in its action: `--help` and `--version`
start without NumPy and MPI.  Main entry: `cli.main`.
"""
