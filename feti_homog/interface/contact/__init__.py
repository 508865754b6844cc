"""Which debonded nodes are open and which closed, at one load.

May use `interface.loads`.  Main entry: `contact_problem.ContactProblem`.
"""
