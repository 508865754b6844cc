"""Imperfect bonding: debonded arcs, contact, strengths, and the states along a load path.

Imports `case`, `feti`, `interface.contact`, `materials`, `schema` and `system`.  Main entries: `loads.Load`,
`contact.contact_problem`, `contact.coupled_interfaces` and `path.path_following`.
"""

from feti_homog.interface.loads import ABSURD, Load, Macroscopic

__all__ = ["ABSURD", "Load", "Macroscopic", "debonded_arcs"]
