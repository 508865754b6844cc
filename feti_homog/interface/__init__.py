"""Imperfect bonding: debonded arcs, contact, strengths, and the states along a load path.

Imports `case`, `interface.contact` and `schema`.  Main entries: `contact.contact_problem`, `contact.coupled_interfaces`
and `path.path_following`.
"""

from feti_homog.interface.loads import Load, Macroscopic

__all__ = ["Load", "Macroscopic", "debonded_arcs"]
