"""Imperfect bonding: debonded arcs, contact, strengths, and the states along a path of load.

Main entries: `contact.contact_problem`, `contact.coupled_interfaces` and `path.path_following`.
"""
