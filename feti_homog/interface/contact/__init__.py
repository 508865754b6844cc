"""Open and closed nodes of debonded interfaces at one load.

Imports `feti`, `interface`, `materials`, `mesh` and `system`.  Main entry: `contact_problem.ContactProblem`.
"""

from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN, BondState, Equilibrium, Status

__all__ = [
    "BONDED",
    "CLOSED",
    "OPEN",
    "BondState",
    "Equilibrium",
    "Status",
    "contact_problem",
    "coupled_interfaces",
    "load_scales",
]  # fmt: skip
