"""Imperfect bonding: debonded arcs, contact, strengths, and the states along a path of load.

May use `feti` and the floors below it.  Main entries: `contact.contact_problem`, `coupled_interfaces` and
`path.path_following`.
"""
